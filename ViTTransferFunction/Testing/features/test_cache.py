"""Features kept on disk."""

from __future__ import annotations

import os
import shutil
from collections import namedtuple
from pathlib import Path

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Logic.core.geometry import Geometry
from ViTTransferFunction.Logic.features.cache import FeatureCache
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume


def features_named(key: str, seed: int = 0) -> FeatureVolume:
    array = np.random.default_rng(seed).random((4, 5, 6, 8)).astype(np.float16)
    matrix = np.array([[0.0, -2.0, 0.3, 5.0], [3.0, 0.0, 0.0, -7.0], [0.0, 0.2, 4.0, 1.0], [0.0, 0.0, 0.0, 1.0]])
    return FeatureVolume(array, Geometry((4, 5, 6), matrix), key)


@pytest.fixture
def cache(tmp_path: Path) -> FeatureCache:
    return FeatureCache(tmp_path / "features")


def test_what_was_stored_comes_back_exactly(cache: FeatureCache) -> None:
    stored = features_named("a")
    cache.put(stored)
    found = cache.get("a")
    assert found is not None
    assert found.array.dtype == np.float16
    np.testing.assert_array_equal(found.array, stored.array)
    np.testing.assert_array_equal(found.geometry.ijk_to_ras, stored.geometry.ijk_to_ras)
    assert cache.get("b") is None


def test_stored_features_hold_no_pickles(cache: FeatureCache) -> None:
    cache.put(features_named("a"))
    (path,) = cache.folder.iterdir()
    with np.load(path, allow_pickle=False) as content:
        assert sorted(content) == ["features", "ijk_to_ras"]


@pytest.mark.parametrize("content", [b"", b"not features", b"PK\x03\x04 half a file"])
def test_damaged_features_are_removed_and_count_as_absent(cache: FeatureCache, content: bytes) -> None:
    cache.folder.mkdir(parents=True)
    (cache.folder / "a.npz").write_bytes(content)
    assert cache.get("a") is None
    assert not list(cache.folder.iterdir())


def test_an_interrupted_write_leaves_nothing_behind(cache: FeatureCache, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(file: object, **_: np.ndarray) -> None:
        file.write(b"half")  # type: ignore[attr-defined]
        raise KeyboardInterrupt

    monkeypatch.setattr(np, "savez", interrupted)
    with pytest.raises(KeyboardInterrupt):
        cache.put(features_named("a"))
    assert not list(cache.folder.iterdir())


def test_beyond_the_limit_the_features_used_longest_ago_go_first(cache: FeatureCache) -> None:
    for age, key in enumerate(("newest", "middle", "oldest")):
        cache.put(features_named(key))
        os.utime(cache.folder / f"{key}.npz", (1e9 - age, 1e9 - age))
    cache.get("oldest")  # Use makes it the most recent.
    cache.limit_bytes = int(3.5 * cache.size_bytes() / 3)
    cache.put(features_named("another"))
    assert {entry.key for entry in cache.entries()} == {"another", "oldest", "newest"}


def test_what_another_process_has_just_removed_is_not_listed(cache: FeatureCache, monkeypatch: pytest.MonkeyPatch) -> None:
    cache.put(features_named("a"))
    listed = [cache.folder / "removed.npz", cache.folder / "a.npz"]
    monkeypatch.setattr(Path, "glob", lambda *_: iter(listed))
    assert [entry.key for entry in cache.entries()] == ["a"]


def test_size_is_shown_and_clearing_frees_it(cache: FeatureCache) -> None:
    assert cache.size_bytes() == 0
    cache.put(features_named("a"))
    cache.put(features_named("b"))
    size = cache.size_bytes()
    assert size > 2 * 4 * 5 * 6 * 8 * 2
    assert cache.clear() == size
    assert cache.size_bytes() == 0


def test_a_full_disk_is_reported_before_work_is_spent(cache: FeatureCache, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(100, 99, 1))
    with pytest.raises(InputError, match=r"disk .* is full.*VITTF_CACHE"):
        cache.check_room(10**6)


def test_the_folder_is_the_users_cache_unless_given(a_cache_of_its_own: Path) -> None:
    assert FeatureCache().folder == a_cache_of_its_own / "features"
