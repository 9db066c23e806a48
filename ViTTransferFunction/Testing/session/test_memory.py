"""Large volumes take little more memory than they have themselves, and what cannot fit is refused before it is begun."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.system import available_memory
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes import intensity_window
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.intensity_window import IntensityWindow, display_window
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.background_tokens import background_cells
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.session import labels
from ViTTransferFunction.Logic.session.memory_need import check_memory_for_features, check_memory_for_refinement
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Logic.similarity import iso_chooser
from ViTTransferFunction.Logic.weights import sources
from ViTTransferFunction.Testing.support.allocation import peak_bytes
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_features
from ViTTransferFunction.Testing.support.spheres import Spheres

SHAPE = (96, 120, 128)


@pytest.fixture(scope="module")
def organ() -> tuple[Volume, np.ndarray]:
    """A large volume with one small structure in it, and its labels."""
    k, j, i = np.ogrid[tuple(slice(0, n) for n in SHAPE)]
    truth = ((k - 30) ** 2 + (j - 40) ** 2 + (i - 90) ** 2 < 14**2).astype(np.uint8)
    array = np.where(truth, 400, 0).astype(np.int16)
    array += np.random.default_rng(0).integers(-40, 40, SHAPE, dtype=np.int16)
    return Volume(array, Geometry(SHAPE, np.eye(4)), "large"), truth


@pytest.fixture
def session(organ: tuple[Volume, np.ndarray], monkeypatch: pytest.MonkeyPatch) -> SegmentationSession:
    """A session on it. Samples of a map, which large volumes have no more of, are few."""
    monkeypatch.setattr(iso_chooser, "STABILITY_SAMPLES", 10_000)
    volume, truth = organ
    session = SegmentationSession(volume, PRESETS[DEFAULT_PRESET])
    cells = truth.reshape(12, 8, 15, 8, 16, 8).mean(axis=(1, 3, 5))
    features = np.stack([cells, 1.0 - cells], axis=-1).astype(np.float16)
    session.use_features(FeatureVolume(features, volume.geometry.resized((12, 15, 16)), "key"))
    return session


REQUESTS = (ClassRequest("organ", np.array([[90.0, 40.0, 30.0]])),)


def test_segmenting_takes_less_than_twice_the_volume(session: SegmentationSession) -> None:
    assert peak_bytes(lambda: session.segment(REQUESTS)) < 2 * session.volume.array.nbytes


@pytest.mark.parametrize("dtype", [np.int16, np.float32])
def test_looking_at_a_volume_makes_no_copy_of_it(
    organ: tuple[Volume, np.ndarray], dtype: type, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(intensity_window, "SAMPLE_SIZE", 10_000)
    array: np.ndarray = organ[0].array.astype(dtype)

    def look() -> None:
        volume = Volume(array, organ[0].geometry)
        assert volume.digest
        display_window(volume)
        background_cells(array, IntensityWindow(0.0, 400.0), (24, 30, 32))

    assert peak_bytes(look) < 0.25 * array.nbytes


@pytest.mark.parametrize("slab_voxels", [1, 1000, 10**9])
def test_components_are_the_same_found_slab_by_slab(slab_voxels: int, monkeypatch: pytest.MonkeyPatch) -> None:
    random = (np.random.default_rng(3).random((11, 12, 13)) < 0.12).astype(np.uint8)
    components, _ = ndimage.label(random, structure=np.ones((3, 3, 3)))
    seed = np.argwhere(random)[20]
    monkeypatch.setattr(labels, "SLAB_VOXELS", slab_voxels)
    kept = random.copy()
    labels.keep_annotated_components(kept, Geometry(random.shape, np.eye(4)), {1: seed[None, ::-1].astype(float)})
    np.testing.assert_array_equal(kept, components == components[tuple(seed)])
    assert 1 < kept.sum() < random.sum()


def test_what_cannot_fit_is_refused_before_features_are_loaded(spheres: Spheres, monkeypatch: pytest.MonkeyPatch) -> None:
    cache_known_features(*spheres)
    session = open_session(spheres[0], SessionSettings(grid=GRID))
    monkeypatch.setattr(available_memory, "available_memory_bytes", lambda: 1000)
    with pytest.raises(InputError, match=r"Segmenting '.*' \(.* voxels\) takes at least .* resample it"):
        session.load_features()


def test_what_cannot_fit_is_refused_before_weights_are_downloaded(spheres: Spheres, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sources, "_download", lambda *_: pytest.fail("downloaded for nothing"))
    monkeypatch.setattr(available_memory, "available_memory_bytes", lambda: 1000)
    with pytest.raises(InputError, match="takes at least"):
        open_session(spheres[0], SessionSettings(grid=GRID)).load_features()


@pytest.mark.parametrize(
    ("features_bytes", "cached", "least"),
    [(10_000, True, 10_000 + 24), (10_000, False, 30_000), (10, False, 10 + 24)],
    ids=["features and labels", "features while they are computed", "labels of few features"],
)
def test_features_need_as_much_memory_as_their_largest_step(
    features_bytes: int, cached: bool, least: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    volume = Volume(np.arange(24, dtype=np.int16).reshape(2, 3, 4), Geometry((2, 3, 4), np.eye(4)))
    monkeypatch.setattr(available_memory, "available_memory_bytes", lambda: least)
    check_memory_for_features(volume, features_bytes, cached)
    monkeypatch.setattr(available_memory, "available_memory_bytes", lambda: least - 1)
    with pytest.raises(InputError, match=r"\(4×3×2 voxels\)"):
        check_memory_for_features(volume, features_bytes, cached)


def test_features_in_the_cache_need_no_memory_to_be_computed(spheres: Spheres, monkeypatch: pytest.MonkeyPatch) -> None:
    cache_known_features(*spheres)
    session = open_session(spheres[0], SessionSettings(grid=GRID))
    estimate = session.estimate()
    monkeypatch.setattr(available_memory, "available_memory_bytes", lambda: 2 * estimate.memory_bytes)
    assert session.load_features().cached


@pytest.mark.parametrize("held_voxels", [(10, 1000), (1000, 10)])
def test_of_several_structures_the_largest_has_to_fit(held_voxels: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    volume = Volume(np.arange(24.0).reshape(2, 3, 4), Geometry((2, 3, 4), np.eye(4)))
    monkeypatch.setattr(available_memory, "available_memory_bytes", lambda: 3000)
    with pytest.raises(InputError, match="takes at least"):
        check_memory_for_refinement(volume, held_voxels, 1)


def test_a_structure_too_large_to_refine_is_refused_before_any_is(
    session: SegmentationSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    volume = np.prod(SHAPE)
    monkeypatch.setattr(available_memory, "available_memory_bytes", lambda: 3 * volume)
    assert session.segment(REQUESTS).labels.any()
    monkeypatch.setattr(available_memory, "available_memory_bytes", lambda: 2 * volume)
    monkeypatch.setattr(session, "refined_map", None)
    with pytest.raises(InputError, match="takes at least"):
        session.segment(REQUESTS)
