"""Classes that are looked at by themselves, in a box with features of its own."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.class_map import ClassMap
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.classes.close_up import CloseUp
from ViTTransferFunction.Logic.core.classes.close_up_choice import close_up_of
from ViTTransferFunction.Logic.core.system.errors import Cancelled
from ViTTransferFunction.Logic.core.volumes.geometry import Box, Geometry
from ViTTransferFunction.Logic.core.volumes.intensity_window import CT_SOFT_TISSUE, display_window
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.network_channels import network_channels
from ViTTransferFunction.Logic.features.settings import FeatureSettings, grid_shape
from ViTTransferFunction.Logic.session import loaded_features, segmentation_session
from ViTTransferFunction.Logic.session.close_ups import MOST_PATCHES, Part, close_up_settings, largest_within
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.presets import PRESETS
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Testing.support.calls import Calls
from ViTTransferFunction.Testing.support.cancelling import cancel_at_once
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_close_up, cache_known_features
from ViTTransferFunction.Testing.support.masks import dice
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras, requests_of


@pytest.fixture
def looked_at(session: SegmentationSession, spheres: Spheres) -> list[ClassRequest]:
    """Requests for the spheres, the first of which is looked at by itself; the features of its box are known."""
    first, *others = requests_of(spheres)
    close_up = close_up_of(session.low_resolution_maps([first, *others])[0], first.positive, spheres[0].geometry)
    cache_known_close_up(*spheres, close_up, first.positive)
    return [replace(first, close_up=close_up), *others]


def within_box(request: ClassRequest, geometry: Geometry) -> np.ndarray:
    """(K, J, I) bool: the voxels that a class is looked at in."""
    assert request.close_up is not None
    inside = np.zeros(geometry.shape, dtype=bool)
    inside[request.close_up.box_in(geometry, request.positive)] = True
    return inside


def test_a_class_is_shown_in_the_whole_volume_until_its_close_up_is_there(
    session: SegmentationSession, looked_at: list[ClassRequest], spheres: Spheres
) -> None:
    whole = session.low_resolution_maps(requests_of(spheres))
    assert session.awaiting_close_ups(looked_at)
    before = session.low_resolution_maps(looked_at)
    session.look_closer(looked_at)
    assert not session.awaiting_close_ups(looked_at)
    after = session.low_resolution_maps(looked_at)
    assert np.array_equal(before[0].array, whole[0].array)
    assert not np.array_equal(after[0].array, whole[0].array)
    for index in (1, 2):
        assert np.array_equal(after[index].array, whole[index].array)


def test_a_class_reaches_no_further_than_its_close_up(
    session: SegmentationSession, looked_at: list[ClassRequest], spheres: Spheres
) -> None:
    session.look_closer(looked_at)
    segmentation = session.segment(looked_at)
    of_first = segmentation.labels == 1
    assert dice(of_first, spheres[1] == 1) > 0.9
    assert not (of_first & ~within_box(looked_at[0], spheres[0].geometry)).any()
    for label in (2, 3):
        assert dice(segmentation.labels == label, spheres[1] == label) > 0.9


def test_finer_cells_follow_a_surface_more_closely_without_refinement(
    session: SegmentationSession, looked_at: list[ClassRequest], spheres: Spheres
) -> None:
    whole = session.segment(requests_of(spheres), "none").labels == 1
    session.look_closer(looked_at)
    closer = session.segment(looked_at, "none").labels == 1
    truth = spheres[1] == 1
    assert dice(closer, truth) > dice(whole, truth) + 0.02


def test_a_box_of_so_few_voxels_that_it_has_no_grid_of_cells_leaves_its_class_in_the_whole_volume() -> None:
    array = np.random.default_rng(0).normal(0.0, 100.0, (3, 3, 3))
    volume = Volume(array, Geometry(array.shape, np.eye(4)))
    nodule = ClassRequest("nodule", np.array([[1.0, 1.0, 1.0]]), close_up=CloseUp((1.0, 1.0, 1.0), (2.0, 2.0, 2.0)))
    session = open_session(volume, SessionSettings())
    session.look_closer([nodule])
    assert not session.awaiting_close_ups([nodule])


def test_segmenting_does_not_wait_for_close_ups(
    session: SegmentationSession, looked_at: list[ClassRequest], spheres: Spheres
) -> None:
    whole = session.segment(requests_of(spheres)).labels
    assert np.array_equal(session.segment(looked_at).labels, whole)
    assert session.awaiting_close_ups(looked_at)


def test_a_positive_point_beyond_the_box_has_a_larger_box_looked_at(
    session: SegmentationSession, looked_at: list[ClassRequest], spheres: Spheres
) -> None:
    session.look_closer(looked_at)
    beyond = replace(looked_at[0], positive=np.concatenate([looked_at[0].positive, centre_ras(spheres, 2)]))
    assert session.awaiting_close_ups([beyond])
    negative = replace(looked_at[0], negative=centre_ras(spheres, 2))
    assert not session.awaiting_close_ups([negative])
    assert len(session.low_resolution_maps([negative])) == 1


def test_a_close_up_is_loaded_once_where_somebody_painted_far_beyond_its_box(
    session: SegmentationSession, looked_at: list[ClassRequest], spheres: Spheres
) -> None:
    start, end = looked_at[0].positive, centre_ras(spheres, 2)
    stroke = start + (end - start) * np.linspace(0.0, 0.75, 2000)[:, None]
    painted = replace(looked_at[0], positive=stroke)
    assert painted.close_up is not None
    cache_known_close_up(*spheres, painted.close_up, stroke)
    session.look_closer([painted, *looked_at[1:]])
    assert not session.awaiting_close_ups([painted, *looked_at[1:]])
    # Fewer points of it are left beside others, and its box is the same.
    more = replace(looked_at[1], negative=np.repeat(start, 600, axis=0))
    assert not session.awaiting_close_ups([painted, more, looked_at[2]])


def test_a_close_up_that_nobody_asks_for_any_more_is_forgotten(
    session: SegmentationSession, looked_at: list[ClassRequest], spheres: Spheres
) -> None:
    session.look_closer(looked_at)
    session.look_closer(requests_of(spheres))
    assert session.awaiting_close_ups(looked_at)


def test_close_ups_that_are_there_are_not_loaded_again_beside_another(
    session: SegmentationSession, looked_at: list[ClassRequest], spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    session.look_closer(looked_at)
    box = CloseUp(tuple(centre_ras(spheres, 2)[0]), (30.0, 30.0, 30.0))
    cache_known_close_up(*spheres, box, looked_at[1].positive)
    loads = Calls(monkeypatch, SegmentationSession, "load_features")
    both = [looked_at[0], replace(looked_at[1], close_up=box), looked_at[2]]
    session.look_closer(both)
    assert loads.count == 1
    assert not session.awaiting_close_ups(both)


def test_a_click_after_a_closer_look_looks_at_no_intensities_any_more(
    session: SegmentationSession, looked_at: list[ClassRequest], monkeypatch: pytest.MonkeyPatch
) -> None:
    looks = Calls(monkeypatch, loaded_features, "CellIntensities")
    session.look_closer(looked_at)
    assert looks.count == 1
    session.low_resolution_maps(looked_at)
    assert looks.count == 1


def test_in_a_part_count_all_classes_with_points_in_it_by_these_points(looked_at: list[ClassRequest], spheres: Spheres) -> None:
    first, second, third = looked_at
    assert first.close_up is not None
    box = first.close_up.box_in(spheres[0].geometry, first.positive)
    across = replace(second, positive=np.concatenate([second.positive, first.positive + 1.0]), negative=third.positive)
    part = Part(box, SimpleNamespace(volume=spheres[0].part(box)))
    (of_second, of_first), place = part.requests([third, across, first], 2)
    assert (of_second.id, of_first.id, place) == (second.id, first.id, 1)
    np.testing.assert_array_equal(of_second.positive, first.positive + 1.0)
    assert len(of_second.negative) == 0
    assert of_first.close_up is None


def test_an_answer_of_a_class_stays_where_other_classes_alone_have_changed(
    session: SegmentationSession, looked_at: list[ClassRequest]
) -> None:
    session.look_closer(looked_at)
    first = session.low_resolution_maps(looked_at)[0]
    moved = [looked_at[0], replace(looked_at[1], positive=looked_at[1].positive + 1.0), looked_at[2]]
    assert session.low_resolution_maps(moved)[0] is first
    moved = [replace(looked_at[0], positive=looked_at[0].positive + 1.0), *looked_at[1:]]
    assert session.low_resolution_maps(moved)[0] is not first


def test_a_fixed_iso_value_and_a_size_count_in_a_close_up_as_well(
    session: SegmentationSession, looked_at: list[ClassRequest]
) -> None:
    first, *others = looked_at
    asked = (replace(first, iso=0.9), first, replace(first, size=1.0))
    session.look_closer(looked_at)
    isos = [session.segment([of_first, *others]).classes[0] for of_first in asked]
    assert isos[0].iso == 0.9
    assert isos[0].voxels < isos[1].voxels <= isos[2].voxels


def test_a_cancelled_close_up_leaves_the_class_in_the_whole_volume(
    session: SegmentationSession, looked_at: list[ClassRequest], spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(SegmentationSession, "load_features", lambda self, progress: progress(0, 1, "Computing features"))
    with pytest.raises(Cancelled):
        session.look_closer(looked_at, cancel_at_once)
    assert session.awaiting_close_ups(looked_at)
    whole = session.low_resolution_maps(requests_of(spheres))
    assert np.array_equal(session.low_resolution_maps(looked_at)[0].array, whole[0].array)


def test_progress_says_which_structure_is_looked_at(
    session: SegmentationSession, looked_at: list[ClassRequest], monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded = SegmentationSession.load_features

    def load(self: SegmentationSession, progress: object) -> object:
        progress(1, 2, "Computing features")  # type: ignore[operator]
        return loaded(self)

    monkeypatch.setattr(SegmentationSession, "load_features", load)
    told: list[tuple[int, int, str]] = []
    session.look_closer(looked_at, lambda done, total, what: told.append((done, total, what)))
    assert told == [(1, 2, "Looking closer at sphere 1")]


def test_where_nothing_in_the_box_differs_the_class_is_looked_at_in_the_whole(
    session: SegmentationSession, looked_at: list[ClassRequest], spheres: Spheres
) -> None:
    volume, labels = spheres
    plain = Volume(np.where(labels > 0, 100.0, 0.0).astype(np.float32), volume.geometry, "plain")
    cache_known_features(plain, labels)
    other = open_session(plain, SessionSettings(grid=GRID))
    other.load_features()
    within = ClassRequest("middle", centre_ras(spheres, 1), close_up=CloseUp(tuple(centre_ras(spheres, 1)[0]), (4.0, 4.0, 4.0)))
    box = within.close_up.box_in(volume.geometry, within.positive)  # type: ignore[union-attr]
    plain.array[box] = 100.0
    other.look_closer([within])
    assert not other.awaiting_close_ups([within])
    assert other.segment([within]).classes[0].voxels > 0


def test_a_part_is_looked_at_in_the_windows_of_its_whole() -> None:
    array = np.full((40, 40, 40), -1000.0, dtype=np.float32)
    array[10:30, 10:30, 10:30] = np.random.default_rng(0).normal(50.0, 10.0, (20, 20, 20))
    whole = Volume(array, Geometry((40, 40, 40), np.eye(4)), "CT")
    part = whole.part((slice(12, 28),) * 3)
    assert part.array.min() > -500.0
    assert display_window(part) == CT_SOFT_TISSUE == display_window(whole)
    assert network_channels(part) == network_channels(whole)
    assert part.digest != Volume(part.array, part.geometry).digest


def test_similarity_fades_as_fast_in_a_part_as_in_the_whole(
    session: SegmentationSession, looked_at: list[ClassRequest], monkeypatch: pytest.MonkeyPatch
) -> None:
    edges: list[float] = []

    def everywhere(cells: Geometry, points_ras: np.ndarray, strength: float, longest_edge_mm: float) -> np.ndarray:
        edges.append(longest_edge_mm)
        return np.ones(cells.shape, dtype=np.float32)

    monkeypatch.setattr(segmentation_session, "proximity", everywhere)
    near = [replace(looked_at[0], proximity=0.5), *looked_at[1:]]
    # In the whole, until its close-up is there.
    session.low_resolution_maps(near)
    session.look_closer(near)
    session.low_resolution_maps(near)
    assert edges == [session.volume.geometry.extent_mm.max()] * 2


def test_cells_of_a_close_up_are_no_smaller_than_voxels_and_its_patches_are_few() -> None:
    settings = close_up_settings(FeatureSettings(grid=64, most_patches=20_000), Geometry((20, 20, 90), np.diag([1, 1, 3, 1])))
    assert (settings.grid, settings.most_patches) == (64, MOST_PATCHES)
    assert close_up_settings(FeatureSettings(grid=64), Geometry((30, 20, 40), np.eye(4))).grid == 40
    anisotropic = close_up_settings(FeatureSettings(grid=64, isotropic=False), Geometry((30, 20, 40), np.diag([1, 1, 3, 1])))
    assert anisotropic.grid == 40


def test_in_thick_slices_cells_of_a_close_up_are_as_fine_as_voxels_within_a_slice() -> None:
    of_thick_slices = Geometry((14, 60, 80), np.diag([0.5, 0.5, 5.0, 1.0]))
    assert close_up_settings(FeatureSettings(grid=64), of_thick_slices).grid == 64
    coarse = Geometry((30, 20, 40), np.diag([10, 10, 20, 1]))
    assert grid_shape(coarse, close_up_settings(PRESETS["balanced"].features, coarse)) == (60, 20, 40)


def test_a_thin_structure_is_not_lost_on_coarser_cells() -> None:
    whole = Geometry((40, 40, 40), np.diag([1.0, 2.0, 1.0, 1.0]))
    cells = whole.resized((10, 10, 10))
    box = slice(8, 32), slice(10, 30), slice(4, 36)
    part = whole.part(box)
    array = np.zeros(part.shape, dtype=np.float32)
    array[:, 9:11, 15:17] = 1.0
    largest = largest_within(ClassMap(array, part, 0.5), cells)
    assert largest.shape == cells.shape
    # Along K from voxel 8 to 31, in the cells 2 to 7; across, at the voxels 19 to 21 of 40.
    reached = np.argwhere(largest >= 0.5)
    assert sorted(set(reached[:, 0])) == [2, 3, 4, 5, 6, 7]
    assert set(map(tuple, reached[:, 1:])) <= {(4, 4), (4, 5), (5, 4), (5, 5)}
    assert len(reached) >= 6


PARTS = [
    (slice(0, 6), slice(0, 12), slice(0, 5)),
    (slice(6, 12), slice(3, 7), slice(7, 12)),
    (slice(0, 12), slice(0, 12), slice(0, 12)),
]


@pytest.mark.parametrize("box", PARTS)
def test_a_cell_has_the_largest_of_its_voxels_up_to_the_faces_of_the_volume(box: Box) -> None:
    whole = Geometry((12, 12, 12), np.diag([-1.0, 2.0, 1.5, 1.0]))
    voxels = np.zeros(whole.shape, dtype=np.float32)
    voxels[box] = np.random.default_rng(0).uniform(0.1, 1.0, voxels[box].shape)
    of_cells = largest_within(ClassMap(voxels[box], whole.part(box), 0.5), whole.resized((4, 4, 4)))
    np.testing.assert_array_equal(of_cells, voxels.reshape(4, 3, 4, 3, 4, 3).max(axis=(1, 3, 5)))


# A face of the volume, computed by it, comes out a little before the face.
TURNED = np.array([[0.6, -1.6, 0.0, 100.1], [0.8, 1.2, 0.0, -50.3], [0.0, 0.0, 1.5, 70.7], [0.0, 0.0, 0.0, 1.0]])


@pytest.mark.parametrize("box", PARTS)
@pytest.mark.parametrize("ijk_to_ras", [np.diag([-1.0, 2.0, 1.5, 1.0]), TURNED], ids=["along the axes", "turned"])
def test_cells_smaller_than_voxels_have_the_map_as_far_as_it_reaches(box: Box, ijk_to_ras: np.ndarray) -> None:
    whole = Geometry((12, 12, 12), ijk_to_ras)
    part, cells = whole.part(box), whole.resized((17, 30, 20))
    reached = part.contains(cells.voxel_centres_ras()).reshape(cells.shape)
    reached[tuple(cells.nearest_voxels(part.voxel_centres_ras()).T)] = True
    of_cells = largest_within(ClassMap(np.full(part.shape, 0.7, dtype=np.float32), part, 0.5), cells)
    np.testing.assert_allclose(of_cells, np.where(reached, 0.7, 0.0), rtol=1e-6)


@pytest.mark.slow
def test_features_of_a_close_up_are_computed_once_and_kept(
    spheres: Spheres, tiny_weights: SessionSettings, looked_at: list[ClassRequest]
) -> None:
    told: list[str] = []
    steps = []
    for _ in range(2):
        session = open_session(spheres[0], tiny_weights)
        session.load_features()
        session.look_closer(looked_at, lambda done, total, what: told.append(what))
        steps.append(len(told))
        assert session.low_resolution_maps(looked_at)[0].array.any()
    assert steps[0] == steps[1] > 0
