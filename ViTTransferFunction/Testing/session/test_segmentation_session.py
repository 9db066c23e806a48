"""A volume from clicks to labels, on features with a known answer."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, get_args

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.classes.iso_proposals import SMALLEST_SIZE
from ViTTransferFunction.Logic.core.system.errors import Cancelled, InputError
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import FARTHEST_VOXELS, Volume
from ViTTransferFunction.Logic.core.volumes.voxel_map import VoxelMap
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.refinement.refinement import RefinementMethod, refine
from ViTTransferFunction.Logic.session import loaded_features, segmentation_session
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Logic.similarity.cell_intensities import CellIntensities
from ViTTransferFunction.Logic.similarity.similarity_rule import SimilarityMethod
from ViTTransferFunction.Testing.support.calls import Calls
from ViTTransferFunction.Testing.support.cancelling import cancel_at_call, cancel_at_once
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_features
from ViTTransferFunction.Testing.support.masks import dice
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras, requests_of


@pytest.mark.parametrize(("method", "least"), [("none", 0.7), ("bilateral", 0.9), ("guided", 0.85)])
def test_one_click_a_class_finds_each_sphere(session: SegmentationSession, spheres: Spheres, method: str, least: float) -> None:
    segmentation = session.segment(requests_of(spheres), method)  # type: ignore[arg-type]
    for label in (1, 2, 3):
        assert dice(segmentation.labels == label, spheres[1] == label) > least


def test_results_say_the_iso_value_and_the_volume_in_millilitres(session: SegmentationSession, spheres: Spheres) -> None:
    segmentation = session.segment(requests_of(spheres))
    for label, result in enumerate(segmentation.classes, start=1):
        voxels = int((segmentation.labels == label).sum())
        assert result.name == f"sphere {label}"
        assert result.voxels == voxels
        assert result.millilitres == pytest.approx(voxels * 12.0 / 1000.0)
        assert 0.0 < result.iso < 1.0


def test_an_iso_value_that_the_user_set_is_used_as_it_is(session: SegmentationSession, spheres: Spheres) -> None:
    loose, strict = (session.segment(requests_of(spheres, iso=iso)).classes[0] for iso in (0.3, 0.9))
    assert (loose.iso, strict.iso) == (0.3, 0.9)
    assert loose.voxels > strict.voxels


def test_the_larger_the_size_the_larger_the_structure(session: SegmentationSession, spheres: Spheres) -> None:
    voxels = [session.segment(requests_of(spheres, size=size)).classes[0].voxels for size in (-1.0, -0.5, 0.0, 0.5, 1.0, 2.0)]
    assert voxels == sorted(voxels)
    assert voxels[0] < 0.9 * voxels[-1]


def test_a_smaller_structure_is_a_higher_threshold_on_the_same_map(session: SegmentationSession, spheres: Spheres) -> None:
    usual, smaller = (
        session.refined_map(session.low_resolution_maps([request])[0], [request], 0, "bilateral")
        for request in (ClassRequest("sphere", centre_ras(spheres, 1), size=size) for size in (0.0, SMALLEST_SIZE))
    )
    assert usual.iso < smaller.iso
    np.testing.assert_array_equal(usual.voxels.array, smaller.voxels.array)


def test_a_larger_size_loses_hardly_a_voxel_of_a_noisy_structure(spheres: Spheres) -> None:
    volume, labels = spheres
    noise = np.random.default_rng(3).normal(0.0, 120.0, labels.shape)
    noisy = replace(volume, array=(volume.array + noise).astype(np.float32))
    cache_known_features(noisy, labels)
    session = open_session(noisy, SessionSettings(grid=GRID))
    assert session.load_features().cached
    before = np.zeros(labels.shape, dtype=bool)
    for size in (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0):
        request = ClassRequest("sphere", centre_ras(spheres, 3), size=size)
        refined = session.refined_map(session.low_resolution_maps([request])[0], [request], 0, "bilateral")
        now = refined.voxels.array >= refined.iso
        assert (before & ~now).sum() <= 0.006 * before.sum()
        assert now.sum() > before.sum()
        before = now


@pytest.mark.parametrize("refinement", ["bilateral", "guided"])
def test_a_refined_segment_leaves_out_what_was_clicked_as_not_its_own(
    session: SegmentationSession, spheres: Spheres, refinement: RefinementMethod
) -> None:
    centre = centre_ras(spheres, 1)
    beside = centre + np.array([4.0, 0.0, 0.0])
    voxel = tuple(spheres[0].geometry.nearest_voxels(beside)[0])
    unsaid = session.segment([ClassRequest("sphere", centre)], refinement).labels
    own = session.segment([ClassRequest("sphere", centre, negative=beside)], refinement).labels
    of_another = session.segment([ClassRequest("sphere", centre), ClassRequest("other", beside)], refinement).labels
    assert (unsaid[voxel], own[voxel], of_another[voxel]) == (1, 0, 2)


@pytest.mark.parametrize("dtype", ["u1", ">i2", "u4", "f2", "f8", "g"])
def test_whatever_numbers_a_volume_comes_in_it_is_segmented_alike(
    session: SegmentationSession, spheres: Spheres, dtype: str
) -> None:
    """All of these hold the intensities exactly."""
    volume = spheres[0]
    integers = np.clip(np.rint(volume.array), 0.0, 255.0)

    def labels_of(array: np.ndarray) -> np.ndarray:
        stored = SegmentationSession(Volume(array, volume.geometry), session.preset)
        stored.use_features(session.features.source)
        return stored.segment(requests_of(spheres)).labels

    np.testing.assert_array_equal(labels_of(integers.astype(dtype)), labels_of(integers.astype(np.int16)))


@pytest.mark.parametrize("power", [-95, 60, 110])
def test_in_whatever_unit_a_volume_comes_it_is_segmented_alike(
    session: SegmentationSession, spheres: Spheres, power: int
) -> None:
    volume, requests = spheres[0], requests_of(spheres)
    scaled = SegmentationSession(Volume(np.ldexp(volume.array, power), volume.geometry), session.preset)
    scaled.use_features(session.features.source)
    np.testing.assert_array_equal(scaled.segment(requests).labels, session.segment(requests).labels)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "padding", [-9999.0, -1e10, float(np.finfo(np.float32).min), 65535.0, 1e10, float(np.finfo(np.float32).max)]
)
def test_a_volume_that_is_padded_with_what_no_scanner_measures_is_segmented_as_if_it_were_masked(
    session: SegmentationSession, spheres: Spheres, padding: float
) -> None:
    volume, labels = spheres
    padded = np.indices(volume.shape)[0] < np.argwhere(labels > 0)[:, 0].min() - 1

    def labels_of(outside: float) -> np.ndarray:
        of_scan = SegmentationSession(Volume(np.where(padded, outside, volume.array), volume.geometry), session.preset)
        of_scan.use_features(session.features.source)
        return of_scan.segment(requests_of(spheres)).labels

    found, masked = labels_of(padding), labels_of(np.nan)
    for label in (1, 2, 3):
        assert dice(found == label, labels == label) > 0.9
        assert dice(found == label, masked == label) > 0.95


def test_as_far_away_as_a_volume_may_lie_it_is_segmented_alike(session: SegmentationSession, spheres: Spheres) -> None:
    volume, labels = spheres
    matrix = volume.geometry.ijk_to_ras.copy()
    matrix[:3, 3] = 0.99 * FARTHEST_VOXELS * volume.geometry.spacing_mm.min()
    far = Volume(volume.array, Geometry(volume.shape, matrix)), labels
    cache_known_features(*far)
    far_session = open_session(far[0], SessionSettings(grid=GRID))
    far_session.load_features()
    # With a proximity, distances decide.
    found, expected = (
        each.segment(requests_of(at, proximity=0.5)).labels for each, at in ((far_session, far), (session, spheres))
    )
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("power", [-148, -132, -120, -110])
def test_a_volume_in_units_so_large_that_single_precision_does_not_do_is_refused(spheres: Spheres, power: int) -> None:
    """A reciprocal of its windows, times some thousands, would be infinite."""
    volume = spheres[0]
    with pytest.raises(InputError, match=r"in single precision\. Save it with other units"):
        Volume(np.ldexp(volume.array.astype(np.float64), power), volume.geometry)


def test_who_clicks_twice_on_the_same_place_says_no_more_than_once(session: SegmentationSession, spheres: Spheres) -> None:
    centre = centre_ras(spheres, 1)
    inside, outside = np.concatenate([centre, centre + 4.0, centre - 6.0]), np.concatenate([centre + 9.0, centre - 12.0])
    once = session.segment([ClassRequest("sphere", inside, negative=outside)])
    for place in range(3):
        again = ClassRequest("sphere", inside[[0, 1, 2, place]], negative=outside[[0, 1, 0]])
        found = session.segment([again])
        np.testing.assert_array_equal(found.labels, once.labels)
        assert found.classes[0].iso == once.classes[0].iso


@pytest.mark.slow
def test_tens_of_thousands_of_points_are_segmented_and_keep_all_their_parts(
    session: SegmentationSession, spheres: Spheres
) -> None:
    make_spheres_1_and_2_alike(session)
    voxels = np.argwhere(np.isin(spheres[1], (1, 2)))[:, ::-1]
    within = np.random.default_rng(0).uniform(-0.4, 0.4, (50_000, 3)) + voxels[np.arange(50_000) % len(voxels)]
    requests = [ClassRequest("spheres", spheres[0].geometry.ijk_to_ras_points(within))]
    assert dice(session.segment(requests).labels == 1, np.isin(spheres[1], (1, 2))) > 0.9


def make_spheres_1_and_2_alike(session: SegmentationSession) -> None:
    """Make them equal to the network, so that a click on one finds both."""
    source = session.features.source
    array = source.array.copy()
    array[..., 1] += array[..., 2]
    array[..., 2] = 0.0
    session.use_features(FeatureVolume(array, source.geometry, source.key))


def test_parts_without_a_click_are_dropped_unless_asked_for(session: SegmentationSession, spheres: Spheres) -> None:
    make_spheres_1_and_2_alike(session)
    clicked = [ClassRequest("sphere 1", centre_ras(spheres, 1), iso=0.2)]
    dropped = session.segment(clicked).labels > 0
    kept = session.segment(clicked, only_annotated_components=False).labels > 0
    assert dice(dropped, spheres[1] == 1) > 0.9
    assert dice(kept, np.isin(spheres[1], (1, 2))) > 0.9


def test_maps_are_shown_one_by_one_as_they_are_made(session: SegmentationSession, spheres: Spheres) -> None:
    shown: list[tuple[str, tuple[int, ...]]] = []
    session.segment(requests_of(spheres), on_map=lambda request, full: shown.append((request.name, full.voxels.array.shape)))
    assert shown == [(f"sphere {n}", session.volume.shape) for n in (1, 2, 3)]


def test_a_click_is_answered_at_low_resolution(session: SegmentationSession, spheres: Spheres) -> None:
    for low in session.low_resolution_maps(requests_of(spheres)):
        assert low.array.shape == session.features.geometry.shape
        assert 0.0 < low.iso < low.array.max()


def test_volumes_at_low_resolution_are_those_of_the_segments_to_the_size_of_a_cell(
    session: SegmentationSession, spheres: Spheres
) -> None:
    requests = requests_of(spheres)
    volumes_ml = session.low_resolution_volumes_ml(requests, session.low_resolution_maps(requests))
    radii_mm = [np.cbrt(3000.0 * ml / (4.0 * np.pi)) for ml in volumes_ml]
    assert radii_mm == pytest.approx([16.0] * 3, abs=session.features.geometry.spacing_mm.max() / 2.0)


def test_volumes_at_low_resolution_leave_out_what_the_segments_do(session: SegmentationSession, spheres: Spheres) -> None:
    look_alikes = np.isin(spheres[1], (1, 2)).sum() / (spheres[1] == 1).sum()
    make_spheres_1_and_2_alike(session)
    clicked = [ClassRequest("sphere 1", centre_ras(spheres, 1), iso=0.2)]
    low_maps = session.low_resolution_maps(clicked)
    (alone,), (both,) = (session.low_resolution_volumes_ml(clicked, low_maps, only) for only in (True, False))
    assert both == pytest.approx(look_alikes * alone, rel=0.1)


@pytest.mark.parametrize("method", get_args(SimilarityMethod))
def test_proximity_fades_a_map_with_distance_whatever_the_method(
    session: SegmentationSession, spheres: Spheres, method: SimilarityMethod
) -> None:
    chosen = SegmentationSession(session.volume, replace(session.preset, similarity=method))
    chosen.use_features(session.features.source)
    (plain,) = chosen.low_resolution_maps(requests_of(spheres)[:1])
    (faded,) = chosen.low_resolution_maps(requests_of(spheres, proximity=1.0)[:1])
    assert faded.array.max() > 0.5 * plain.array.max()
    far = np.s_[:, :, -3:]
    assert faded.array[far].max() <= 0.05 * plain.array[far].max() + 1e-6


def test_intensities_are_looked_at_once_for_the_same_cells_and_anew_for_others(
    session: SegmentationSession, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = session.low_resolution_maps(requests_of(spheres))
    looked_at: list[tuple[int, ...]] = []

    class Counted(CellIntensities):
        def __init__(self, volume: Volume, cells: Geometry) -> None:
            looked_at.append(cells.shape)
            super().__init__(volume, cells)

    monkeypatch.setattr(loaded_features, "CellIntensities", Counted)
    features = session.features.source
    other = SegmentationSession(session.volume, session.preset)
    for _ in range(2):
        other.use_features(features)
        other.prepare_clicks()
        found = other.low_resolution_maps(requests_of(spheres))
        assert all(np.array_equal(a.array, b.array) for a, b in zip(found, before, strict=True))
    fewer = FeatureVolume(features.array[::2], session.volume.geometry.resized(features.array[::2].shape[:3]), "fewer")
    other.use_features(fewer)
    assert other.low_resolution_maps(requests_of(spheres))[0].array.shape == fewer.geometry.shape
    assert looked_at == [features.geometry.shape, fewer.geometry.shape]


def test_intensities_are_looked_at_before_there_are_features_so_that_the_first_click_does_not_wait_for_it(
    spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache_known_features(*spheres)
    session = open_session(spheres[0], SessionSettings(grid=GRID))
    looks = Calls(monkeypatch, loaded_features, "CellIntensities")
    session.prepare_clicks()
    assert looks.count == 1
    session.load_features()
    session.low_resolution_maps(requests_of(spheres))
    assert looks.count == 1


def test_an_unrefined_structure_has_the_threshold_of_its_clicks_and_a_refined_one_another(
    session: SegmentationSession, spheres: Spheres
) -> None:
    requests = requests_of(spheres)
    unrefined, refined = (session.segment(requests, method).classes for method in ("none", "bilateral"))
    of_clicks = [low.iso for low in session.low_resolution_maps(requests)]
    assert [result.iso for result in unrefined] == of_clicks
    left_out = session.segment([replace(requests[0], refine=False), *requests[1:]]).classes
    assert [result.iso for result in left_out] == [of_clicks[0], *(result.iso for result in refined[1:])]
    assert all(result.iso != iso for result, iso in zip(refined, of_clicks, strict=True))


def test_a_refinement_is_cancelled_between_its_steps(
    session: SegmentationSession, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    requests = requests_of(spheres)
    low_maps = session.low_resolution_maps(requests)
    refined: list[VoxelMap] = []

    def noted(*arguments: Any, **named: Any) -> VoxelMap:
        refined.append(refine(*arguments, **named))
        return refined[-1]

    monkeypatch.setattr(segmentation_session, "refine", noted)
    with pytest.raises(Cancelled):
        session.refined_map(low_maps[0], requests, 0, "bilateral", cancel_at_call(2))
    assert refined == []


def test_unusable_classes_are_refused_before_any_work(session: SegmentationSession, spheres: Spheres) -> None:
    one, *_ = requests_of(spheres)
    with pytest.raises(InputError, match="2 classes are named"):
        session.segment([one, one])


def test_cancelling_leaves_the_session_usable(session: SegmentationSession, spheres: Spheres) -> None:
    with pytest.raises(Cancelled):
        session.segment(requests_of(spheres), progress=cancel_at_once)
    assert session.segment(requests_of(spheres)).labels.any()


def test_the_volume_and_the_points_are_never_altered(session: SegmentationSession, spheres: Spheres) -> None:
    array, classes = session.volume.array.copy(), requests_of(spheres)
    points = [request.positive.copy() for request in classes]
    session.segment(classes)
    np.testing.assert_array_equal(session.volume.array, array)
    for request, before in zip(classes, points, strict=True):
        np.testing.assert_array_equal(request.positive, before)


def test_features_come_before_maps(spheres: Spheres) -> None:
    session = SegmentationSession(spheres[0], PRESETS[DEFAULT_PRESET])
    with pytest.raises(RuntimeError, match="load_features comes first"):
        session.low_resolution_maps(requests_of(spheres))


def test_a_refinement_takes_the_answer_to_the_click_and_another_click_or_other_features_do_not(
    session: SegmentationSession, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    computed = []
    original = type(session.rule).maps

    def counted(self: Any, *arguments: Any) -> Any:
        computed.append(arguments)
        return original(self, *arguments)

    monkeypatch.setattr(type(session.rule), "maps", counted)
    requests = requests_of(spheres)
    session.low_resolution_maps(requests)
    session.segment(requests)
    assert len(computed) == 1
    session.low_resolution_maps(requests_of(spheres, proximity=0.5))
    session.use_features(session.features.source)
    session.low_resolution_maps(requests_of(spheres, proximity=0.5))
    assert len(computed) == 3


@pytest.mark.parametrize("beyond", [0, 1])
def test_a_second_click_at_the_edge_of_what_lies_in_dark_surroundings_does_not_lose_it(beyond: int) -> None:
    """As at that of a nodule in a lung, where a voxel may be as dark as the lung: all of that would be looked for."""
    rng, shape, cells = np.random.default_rng(0), (64, 64, 64), (16, 16, 16)
    nodule = np.linalg.norm(np.indices(shape).T - 32.0, axis=-1).T < 8.0
    array = np.full(shape, 40.0)
    array[8:-8, 8:-8] = np.where(nodule, 40.0, -850.0)[8:-8, 8:-8]
    volume = Volume((array + rng.normal(0.0, 30.0, shape)).astype(np.float32), Geometry(shape, np.eye(4)))
    # Features that tell little: how much of a cell is nodule, and lung, beside ten channels of chance.
    known = np.stack([nodule, array < -400.0], axis=-1).reshape(16, 4, 16, 4, 16, 4, 2).mean(axis=(1, 3, 5))
    features = np.concatenate([3.0 * known, rng.normal(size=(*cells, 10))], axis=-1).astype(np.float16)
    session = SegmentationSession(volume, PRESETS[DEFAULT_PRESET])
    session.use_features(FeatureVolume(features, volume.geometry.resized(cells), "a nodule"))
    points = np.array([[32.0, 32.0, 32.0], [40.0 + beyond, 32.0, 32.0]])
    assert dice(session.segment([ClassRequest("nodule", points[:1])]).labels == 1, nodule) > 0.98
    assert dice(session.segment([ClassRequest("nodule", points)]).labels == 1, nodule) > 0.98
