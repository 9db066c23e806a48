"""Features kept on disk."""

from __future__ import annotations

import errno
import gc
import hashlib
import io
import logging
import os
import re
import time
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.system.atomic_file import ABANDONED_S
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.features import cache as cache_module
from ViTTransferFunction.Logic.features.cache import SPARE_BYTES, FeatureCache
from ViTTransferFunction.Logic.features.feature_file import write_features
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume, Moments
from ViTTransferFunction.Testing.support.disks import set_free_space


def key(name: str) -> str:
    """A key as caches have them."""
    return hashlib.sha256(name.encode()).hexdigest()


def features_named(name: str, seed: int = 0) -> FeatureVolume:
    array = np.random.default_rng(seed).random((4, 5, 6, 8)).astype(np.float16)
    matrix = np.array([[0.0, -2.0, 0.3, 5.0], [3.0, 0.0, 0.0, -7.0], [0.0, 0.2, 4.0, 1.0], [0.0, 0.0, 0.0, 1.0]])
    geometry = Geometry((4, 5, 6), matrix)
    return FeatureVolume(array, geometry, key(name), geometry.resized((7, 9, 10)))


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FeatureCache:
    monkeypatch.setattr(cache_module, "_told", set())
    return FeatureCache(tmp_path / "features")


def test_what_was_stored_comes_back_exactly(cache: FeatureCache) -> None:
    stored = features_named("a")
    assert cache.put(stored) == ""
    found = cache.get(key("a"))
    assert found is not None
    assert found.array.dtype == np.float16
    np.testing.assert_array_equal(found.array, stored.array)
    np.testing.assert_array_equal(found.geometry.ijk_to_ras, stored.geometry.ijk_to_ras)
    assert found.cells.shape == stored.cells.shape
    np.testing.assert_array_equal(found.cells.ijk_to_ras, stored.cells.ijk_to_ras)
    assert cache.get(key("b")) is None


def with_moments(features: FeatureVolume) -> FeatureVolume:
    mean, covariance = np.random.default_rng(1).random(8), np.random.default_rng(2).random((8, 8))
    return replace(features, moments=Moments(mean, covariance))


def test_moments_come_back_exactly_where_they_were_known(cache: FeatureCache) -> None:
    stored = with_moments(features_named("a"))
    cache.put(stored)
    cache.put(features_named("b"))
    found, without = cache.get(key("a")), cache.get(key("b"))
    assert found is not None
    assert found.moments is not None
    assert stored.moments is not None
    np.testing.assert_array_equal(found.moments.mean, stored.moments.mean)
    np.testing.assert_array_equal(found.moments.covariance, stored.moments.covariance)
    assert without is not None
    assert without.moments is None


@pytest.mark.parametrize("change", [{"mean": np.ones(7)}, {"covariance": np.ones((8, 7))}, {"mean": np.full(8, np.nan)}])
def test_features_whose_moments_are_not_theirs_are_not_used(cache: FeatureCache, change: dict[str, np.ndarray]) -> None:
    cache.put(with_moments(features_named("a")))
    path = cache.folder / f"{key('a')}.npz"
    with np.load(path) as content:
        np.savez(path, **{**content, **change})
    assert cache.get(key("a")) is None
    assert not path.exists()


def test_stored_features_hold_no_pickles(cache: FeatureCache) -> None:
    cache.put(features_named("a"))
    (path,) = cache.folder.iterdir()
    with np.load(path, allow_pickle=False) as content:
        assert sorted(content) == ["cells", "cells_to_ras", "features", "ijk_to_ras"]


@pytest.mark.parametrize("content", [b"", b"not features", b"PK\x03\x04 half a file"])
def test_damaged_features_are_removed_and_count_as_absent(cache: FeatureCache, content: bytes) -> None:
    cache.folder.mkdir(parents=True)
    (cache.folder / f"{key('a')}.npz").write_bytes(content)
    assert cache.get(key("a")) is None
    assert not list(cache.folder.iterdir())


def test_features_that_another_program_has_open_count_as_absent_and_stay(
    cache: FeatureCache, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache.put(features_named("a"))
    with monkeypatch.context() as held:
        held.setattr(Path, "open", lambda *_, **__: (_ for _ in ()).throw(PermissionError(errno.EACCES, "Permission denied")))
        assert cache.get(key("a")) is None
    assert cache.get(key("a")) is not None


def with_a_flipped_bit(path: Path) -> Iterator[None]:
    """Flips one bit of a file after the other: in all of the archive's own bytes, and in some of the features'."""
    sound = path.read_bytes()
    random = np.random.default_rng(0)
    archive = {*range(400), *range(len(sound) - 1000, len(sound))}
    for position in sorted(archive | set(random.integers(0, len(sound), 300).tolist())):
        flipped = bytearray(sound)
        flipped[position] ^= 1 << int(random.integers(8))
        path.write_bytes(flipped)
        yield


def test_whatever_bit_of_a_file_flips_no_other_features_come_back(cache: FeatureCache) -> None:
    stored = with_moments(features_named("a"))
    cache.put(stored)
    lost = 0
    for _ in with_a_flipped_bit(cache.folder / f"{key('a')}.npz"):
        found = cache.get(key("a"))
        lost += found is None
        if found is not None:
            np.testing.assert_array_equal(found.array, stored.array)
            np.testing.assert_array_equal(found.geometry.ijk_to_ras, stored.geometry.ijk_to_ras)
            if found.moments is not None:
                assert stored.moments is not None
                np.testing.assert_array_equal(found.moments.covariance, stored.moments.covariance)
    assert lost > 800


def test_features_of_a_smaller_shape_than_their_file_has_are_not_used(cache: FeatureCache) -> None:
    cache.put(features_named("a"))
    path = cache.folder / f"{key('a')}.npz"
    path.write_bytes(path.read_bytes().replace(b"(4, 5, 6, 8)", b"(4, 5, 2, 8)"))
    assert cache.get(key("a")) is None


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names here")
def test_a_pipe_in_the_place_of_features_is_not_waited_for(cache: FeatureCache) -> None:
    cache.folder.mkdir(parents=True)
    os.mkfifo(cache.folder / f"{key('a')}.npz")
    assert cache.get(key("a")) is None


def test_features_that_are_infinite_are_not_used(cache: FeatureCache) -> None:
    cache.put(features_named("a"))
    path = cache.folder / f"{key('a')}.npz"
    with np.load(path) as content:
        np.savez(path, features=np.full_like(content["features"], np.inf), ijk_to_ras=content["ijk_to_ras"])
    assert cache.get(key("a")) is None


@pytest.mark.parametrize("name", ["features", "ijk_to_ras", "cells", "cells_to_ras"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_one_value_that_is_no_number_keeps_features_from_being_used(cache: FeatureCache, name: str, value: float) -> None:
    cache.put(features_named("a"))
    path = cache.folder / f"{key('a')}.npz"
    with np.load(path) as content:
        arrays = dict(content)
    arrays[name].flat[-1] = value
    np.savez(path, **arrays)
    assert cache.get(key("a")) is None
    assert not path.exists()


def test_features_of_another_shape_are_not_used(cache: FeatureCache) -> None:
    stored = features_named("a")
    cache.put(stored)
    path = cache.folder / f"{key('a')}.npz"
    with np.load(path) as content:
        np.savez(path, **{**content, "features": stored.array[:-1]})
    assert cache.get(key("a")) is None


def test_features_without_cells_are_not_used(cache: FeatureCache) -> None:
    stored = features_named("a")
    cache.put(stored)
    np.savez(cache.folder / f"{key('a')}.npz", features=stored.array[:0], ijk_to_ras=stored.geometry.ijk_to_ras)
    assert cache.get(key("a")) is None


def test_an_entry_that_is_a_folder_or_leads_nowhere_counts_as_absent(cache: FeatureCache) -> None:
    (cache.folder / f"{key('a')}.npz").mkdir(parents=True)
    if os.name != "nt":  # Windows lets few users make links.
        (cache.folder / f"{key('b')}.npz").symlink_to("nowhere")
    for name in ("a", "b"):
        assert cache.get(key(name)) is None
        assert key(name) not in cache
    assert (cache.entries(), cache.size_bytes(), cache.clear()) == ([], 0, 0)
    cache.put(features_named("b"))
    assert cache.get(key("b")) is not None


def test_a_folder_that_cannot_be_written_is_told_once_and_nothing_else_happens(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cache_module, "_told", set())
    (tmp_path / "file").write_text("")
    cache = FeatureCache(tmp_path / "file" / "features")
    for name in ("a", "b"):
        assert "cannot be kept" in cache.put(features_named(name))
        assert cache.get(key(name)) is None
    assert (cache.entries(), cache.clear()) == ([], 0)
    (message,) = caplog.messages
    assert "cannot be kept" in message
    assert "VITTF_CACHE" in message


def test_a_disk_that_does_not_say_how_large_it_is_is_not_taken_for_a_full_one(
    cache: FeatureCache, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_free_space(monkeypatch, 0, total_bytes=0)
    assert cache.put(features_named("a")) == ""
    assert key("a") in cache


def test_a_disk_that_fills_meanwhile_loses_no_work(
    cache: FeatureCache, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(np.lib.format, "write_array", full)
    cache.put(features_named("a"))
    assert not list(cache.folder.iterdir())
    assert "the disk is full" in caplog.text


@pytest.mark.parametrize("room", [0, 100, 1000])
@pytest.mark.filterwarnings("error::pytest.PytestUnraisableExceptionWarning")
def test_wherever_the_disk_is_full_the_archive_is_closed(room: int) -> None:
    class Full(io.BytesIO):
        def write(self, data: Any) -> int:
            if self.tell() + len(data) > room:
                raise OSError(errno.ENOSPC, "No space left on device")
            return super().write(data)

    with pytest.raises(OSError, match="No space left"):
        write_features(Full(), features_named("a"))
    gc.collect()


OPENED = pytest.mark.skipif(os.name == "nt", reason="Windows lets nobody remove a file that is open")


@pytest.mark.parametrize("step", [pytest.param("read", marks=OPENED), "touch", "list"])
def test_what_another_process_removes_meanwhile_is_gone(
    cache: FeatureCache, step: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache.put(features_named("a"))
    path = cache.folder / f"{key('a')}.npz"

    def before(owner: object, name: str) -> None:
        """Remove the file just before `name` is called."""
        original = getattr(owner, name)

        def called(*arguments: Any, **options: Any) -> Any:
            path.unlink(missing_ok=True)
            return original(*arguments, **options)

        monkeypatch.setattr(owner, name, called)

    if step == "read":
        before(zipfile, "ZipFile")
    elif step == "touch":
        before(os, "utime")
    else:
        before(Path, "lstat")
    cache.get(key("a"))
    assert (cache.entries(), cache.clear()) == ([], 0)
    assert not path.exists()


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_features_that_are_no_numbers_are_not_kept(cache: FeatureCache, value: float, caplog: pytest.LogCaptureFixture) -> None:
    features = features_named("a")
    features.array[3, 4, 5, 7] = value
    with caplog.at_level(logging.WARNING):
        cache.put(features)
    assert key("a") not in cache
    assert "not numbers" in caplog.text


@pytest.mark.skipif(os.name == "nt", reason="Windows has other permissions")
def test_only_the_user_can_read_what_is_kept(cache: FeatureCache) -> None:
    cache.folder.mkdir(parents=True, mode=0o755)
    cache.put(features_named("a"))
    assert cache.folder.stat().st_mode & 0o777 == 0o700
    assert [path.stat().st_mode & 0o777 for path in cache.folder.iterdir()] == [0o600]


@pytest.mark.parametrize("code", [errno.EPERM, errno.ENOTSUP])
def test_on_a_share_on_which_nobody_may_change_rights_features_are_kept(
    cache: FeatureCache, code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object, **__: object) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(Path, "chmod", refused)
    assert cache.put(features_named("a")) == ""
    assert cache.get(key("a")) is not None


def test_clearing_removes_nothing_but_what_was_written_here(cache: FeatureCache) -> None:
    cache.put(features_named("a"))
    (cache.folder / ".writing-12345678.npz").write_bytes(b"half")
    theirs = ("mine.npz", "notes.txt", f"{key('b')}.npz.bak", f"{key('b')}.nii.gz")
    for name in theirs:
        (cache.folder / name).write_bytes(b"theirs")
    cache.clear()
    assert sorted(path.name for path in cache.folder.iterdir()) == sorted(theirs)


def test_an_interrupted_write_leaves_nothing_behind(cache: FeatureCache, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(file: object, *_: np.ndarray, **__: object) -> None:
        file.write(b"half")  # type: ignore[attr-defined]
        raise KeyboardInterrupt

    monkeypatch.setattr(np.lib.format, "write_array", interrupted)
    with pytest.raises(KeyboardInterrupt):
        cache.put(features_named("a"))
    assert not list(cache.folder.iterdir())


def test_what_a_killed_process_left_half_written_goes_with_the_next_features_a_day_later(cache: FeatureCache) -> None:
    cache.folder.mkdir(parents=True)
    for name, age_s in ((".writing-00000001.npz", 2 * ABANDONED_S), (".writing-00000002.npz", 0.5 * ABANDONED_S)):
        (cache.folder / name).write_bytes(b"half")
        os.utime(cache.folder / name, (time.time() - age_s,) * 2)
    cache.put(features_named("a"))
    assert {path.name for path in cache.folder.iterdir()} == {".writing-00000002.npz", f"{key('a')}.npz"}


def test_beyond_the_limit_the_features_used_longest_ago_go_first(cache: FeatureCache, monkeypatch: pytest.MonkeyPatch) -> None:
    for age, name in enumerate(("newest", "middle", "oldest")):
        cache.put(features_named(name))
        os.utime(cache.folder / f"{key(name)}.npz", (1e9 - age, 1e9 - age))
    cache.get(key("oldest"))  # Use makes it the most recent.
    monkeypatch.setattr(cache_module, "LIMIT_BYTES", int(3.5 * cache.size_bytes() / 3))
    cache.put(features_named("another"))
    assert {entry.key for entry in cache.entries()} == {key("another"), key("oldest"), key("newest")}
    monkeypatch.setattr(cache_module, "LIMIT_BYTES", 1)
    cache.put(features_named("too large"))
    assert [entry.key for entry in cache.entries()] == [key("too large")]


def test_size_is_shown_and_clearing_frees_it(cache: FeatureCache) -> None:
    assert cache.size_bytes() == 0
    cache.put(features_named("a"))
    cache.put(features_named("b"))
    size = cache.size_bytes()
    assert size > 2 * 4 * 5 * 6 * 8 * 2
    assert cache.clear() == size
    assert cache.size_bytes() == 0


def test_features_that_would_fill_the_disk_are_not_kept(cache: FeatureCache, monkeypatch: pytest.MonkeyPatch) -> None:
    set_free_space(monkeypatch, SPARE_BYTES)
    assert re.search(
        r"cannot be kept in .* again next time \(its disk is full: 67 MB free.*VITTF_CACHE", cache.put(features_named("a"))
    )
    assert not list(cache.folder.iterdir())


def test_the_folder_is_the_users_cache_unless_given(a_cache_of_its_own: Path) -> None:
    assert FeatureCache().folder == a_cache_of_its_own / "features"
