"""Where points at rims are looked at."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from ViTTransferFunction.Logic.core.volumes.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.core.volumes.orientation import Orientation
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.similarity.intensity_blocks import IntensityBlocks
from ViTTransferFunction.Logic.similarity.point_places import PointPlaces
from ViTTransferFunction.Testing.support.volumes import stored_as, volume_of

EDGE, CELLS = 48, (12, 12, 12)
WINDOW = IntensityWindow(-160.0, 240.0)


def places_in(volume: Volume) -> PointPlaces:
    return PointPlaces(IntensityBlocks(volume, volume.geometry.resized(CELLS), WINDOW))


def negative_seen_at(array: np.ndarray, negative: tuple[int, int, int], positive: tuple[int, int, int]) -> np.ndarray:
    """Where a negative point at a voxel is looked at, in voxels (k, j, i), while a positive one lies at another voxel."""
    volume = volume_of(array)
    points = [volume.geometry.ijk_to_ras_points(np.array([voxel[::-1]], dtype=float)) for voxel in (negative, positive)]
    (seen,) = volume.geometry.ras_to_ijk(places_in(volume).of_negatives(*points))
    return seen[::-1]


RIM = np.zeros((EDGE,) * 3, dtype=np.float32)
RIM[8:16] = RIM[16:18, 8:10, 8:10] = 200.0
"""A slab, two cells thick, with a bump of one block on it."""
ON_BUMP, IN_SLAB, BESIDE_BUMP = (17, 9, 9), (12, 30, 30), (19, 11, 11)


def test_a_negative_point_at_the_rim_is_looked_at_where_its_cell_is_unlike_the_structure() -> None:
    seen = negative_seen_at(RIM, ON_BUMP, IN_SLAB)
    np.testing.assert_array_equal(np.floor((seen + 0.5) / 4), [4, 2, 2])
    assert RIM[tuple(np.floor(seen).astype(int))] == 0.0


@pytest.mark.parametrize(
    ("negative", "positive"),
    [(IN_SLAB, (12, 10, 10)), (BESIDE_BUMP, IN_SLAB), (ON_BUMP, (30, 30, 30))],
    ids=["in a cell of one kind", "on what is typical already", "unlike the positive point"],
)
def test_other_negative_points_are_looked_at_where_they_are(
    negative: tuple[int, int, int], positive: tuple[int, int, int]
) -> None:
    np.testing.assert_allclose(negative_seen_at(RIM, negative, positive), negative, atol=1e-5)


def test_a_negative_point_in_a_cell_that_is_mostly_unknown_is_looked_at_where_it_is() -> None:
    array = np.full((EDGE,) * 3, np.nan, dtype=np.float32)
    array[:8], array[8:16], array[16:18, 8:10, 8:10] = 0.0, 200.0, 200.0
    np.testing.assert_allclose(negative_seen_at(array, ON_BUMP, IN_SLAB), ON_BUMP, atol=1e-5)


@pytest.mark.parametrize("stored", [Orientation((0, 1, 2), (True, True, True)), Orientation((2, 0, 1), (False, True, False))])
def test_negative_points_are_looked_at_in_the_same_places_however_the_volume_is_stored(stored: Orientation) -> None:
    """Of the eight blocks of a cell there are always two as near to the median."""
    volume = volume_of(RIM + np.random.default_rng(0).normal(0.0, 5.0, RIM.shape))
    negative, positive = (volume.geometry.ijk_to_ras_points(np.array([at[::-1]], dtype=float)) for at in (ON_BUMP, IN_SLAB))
    expected = places_in(volume).of_negatives(negative, positive)
    assert not np.array_equal(expected, negative)
    found = places_in(stored_as(volume, stored)).of_negatives(negative, positive)
    np.testing.assert_allclose(found, expected, atol=1e-5)


def positives_seen_at(volume: Volume, *positive: tuple[int, int, int]) -> np.ndarray:
    """Where positive points at voxels are looked at, in voxels (k, j, i), (P, 3)."""
    points = volume.geometry.ijk_to_ras_points(np.array(positive, dtype=float)[:, ::-1])
    seen: np.ndarray = volume.geometry.ras_to_ijk(places_in(volume).of_positives(points))[:, ::-1]
    return seen


def nodule(
    radius: float = 6.0, middle: float = 20.0, blur: float = 0.0, intensity: float = 40.0, lung: float = -800.0
) -> Volume:
    """A ball in a lung; lengths in voxels."""
    array = np.full((EDGE,) * 3, lung, dtype=np.float32)
    distances = np.linalg.norm(np.indices(array.shape).T - middle, axis=-1).T
    array[distances < radius] = intensity
    return volume_of(gaussian_filter(array, blur))


MIDDLE, AT_EDGE, IN_LUNG = (20, 20, 20), (20, 20, 27), (20, 20, 34)


def test_a_later_positive_point_in_what_is_around_a_structure_is_looked_at_in_the_structure_beside_it() -> None:
    volume = nodule()
    for at_edge in (AT_EDGE, (20, 20, 29)):
        first, second = positives_seen_at(volume, MIDDLE, at_edge)
        np.testing.assert_allclose(first, MIDDLE, atol=1e-5)
        assert volume.array[tuple(np.rint(second).astype(int))] == 40.0
        assert np.linalg.norm(second - at_edge) <= 1.5 * EDGE / CELLS[0] + np.sqrt(3.0)


@pytest.mark.parametrize(
    "positive",
    [(AT_EDGE,), (MIDDLE, IN_LUNG), (MIDDLE, IN_LUNG, AT_EDGE), (MIDDLE, (20, 20, 24)), (AT_EDGE, MIDDLE)],
    ids=["alone", "far from all that is like the first", "like one before", "like the first", "the one in the structure"],
)
def test_other_positive_points_are_looked_at_where_they_are(positive: tuple[tuple[int, int, int], ...]) -> None:
    np.testing.assert_allclose(positives_seen_at(nodule(), *positive), positive, atol=1e-5)


IN_MIXED_BLOCK = (20, 20, 22)
"""In a ball of three voxels, in a block most of which is lung."""


def test_a_first_point_in_a_block_that_is_mostly_something_else_is_looked_at_in_the_block_like_its_voxels() -> None:
    np.testing.assert_allclose(positives_seen_at(nodule(3.0), IN_MIXED_BLOCK), [(20.5, 20.5, 20.5)], atol=1e-5)


@pytest.mark.parametrize(("before", "moves"), [((38, 38, 38), True), ((20, 20, 34), False)], ids=["tissue", "lung"])
def test_a_later_one_is_only_if_its_voxels_are_like_those_before(before: tuple[int, int, int], moves: bool) -> None:
    volume = nodule(3.0)
    volume.array[36:42, 36:42, 36:42] = 40.0
    _, seen = positives_seen_at(volume, before, IN_MIXED_BLOCK)
    assert np.allclose(seen, (20.5, 20.5, 20.5), atol=1e-5) == moves


@pytest.mark.parametrize(("intensity", "around"), [(3000.0, 40.0), (40.0, 900.0)], ids=["hot", "marrow in bone"])
def test_beside_what_is_brighter_than_the_window_a_point_is_looked_at_where_it_is(intensity: float, around: float) -> None:
    bright = nodule(3.0, intensity=intensity, lung=around)
    np.testing.assert_allclose(positives_seen_at(bright, IN_MIXED_BLOCK), [IN_MIXED_BLOCK], atol=1e-5)


def test_voxels_across_thick_slices_say_nothing_of_those_at_a_point() -> None:
    array = nodule(3.0).array
    array[19], array[21] = 0.0, 0.0
    for thickness, units in ((1.0, -40.0), (2.0, 0.0)):
        volume = volume_of(array, (1.0, 1.0, thickness))
        blocks = IntensityBlocks(volume, volume.geometry.resized(CELLS), WINDOW)
        point = volume.geometry.ijk_to_ras_points(np.array([[20.0, 20.0, 20.0]]))
        np.testing.assert_allclose(blocks.units_of_voxels_at(point), np.rint(units * 1024 / 400))


def test_a_later_point_at_the_rim_of_a_small_and_blurred_structure_is_looked_at_in_it() -> None:
    """What is beside the middle of one so small is as unlike the middle as what is beside its rim."""
    small = nodule(4.0, middle=20.5, blur=1.5)
    for at_rim in ((20, 20, 23), (20, 20, 24), (20, 20, 25)):
        _, seen = positives_seen_at(small, MIDDLE, at_rim)
        np.testing.assert_allclose(seen, (20.5, 20.5, 20.5), atol=1e-5)
    np.testing.assert_allclose(positives_seen_at(small, MIDDLE, (20, 20, 27))[1], (20, 20, 27), atol=1e-5)


@pytest.mark.parametrize(
    ("structure", "around", "is_nearest"),
    [(40.0, -800.0, False), (-800.0, 40.0, True), (40.0, 500.0, True), (2000.0, 1000.0, True)],
    ids=["tissue in lung", "lung in tissue", "tissue in bone", "what is bright in what is darker"],
)
def test_a_point_in_what_is_around_is_looked_at_on_the_way_to_those_before_it(
    structure: float, around: float, is_nearest: bool
) -> None:
    """What is alike and nearer lies on the other side, and may be something else, where the structure is grey."""
    array = np.full((EDGE,) * 3, around, dtype=np.float32)
    array[:, :, 14:22] = array[:, :, 30:40] = structure
    _, seen = positives_seen_at(volume_of(array), (20, 20, 18), (20, 20, 27))
    assert (30 <= seen[2] < 40) if is_nearest else (14 <= seen[2] < 22)


def test_a_positive_point_on_nothing_finite_is_looked_at_where_it_is() -> None:
    volume = nodule()
    volume.array[:, :, 26:] = np.nan
    np.testing.assert_allclose(positives_seen_at(volume, MIDDLE, AT_EDGE), [MIDDLE, AT_EDGE], atol=1e-5)


@pytest.mark.parametrize("stored", [Orientation((0, 1, 2), (True, True, True)), Orientation((2, 0, 1), (False, True, False))])
def test_positive_points_are_looked_at_in_the_same_places_however_the_volume_is_stored(stored: Orientation) -> None:
    volume = nodule()
    volume.array[...] += np.random.default_rng(0).normal(0.0, 5.0, volume.shape)
    points = volume.geometry.ijk_to_ras_points(np.array([MIDDLE, (20.3, 20.2, 28.0), (25.4, 26.0, 19.6)])[:, ::-1])

    def seen(scan: Volume) -> np.ndarray:
        return places_in(scan).of_positives(points)

    assert not np.array_equal(seen(volume), points)
    np.testing.assert_allclose(seen(stored_as(volume, stored)), seen(volume), atol=1e-5)


def test_where_a_class_is_looked_at_is_found_out_once(monkeypatch: pytest.MonkeyPatch) -> None:
    volume = nodule()
    asked = []
    nearest = IntensityBlocks.nearest

    def counted(blocks: IntensityBlocks, points_ras: np.ndarray) -> np.ndarray:
        asked.append(len(points_ras))
        return nearest(blocks, points_ras)

    monkeypatch.setattr(IntensityBlocks, "nearest", counted)
    places = places_in(volume)
    points = volume.geometry.ijk_to_ras_points(np.array([MIDDLE, AT_EDGE], dtype=float)[:, ::-1])
    seen = [places.of_positives(each) for each in (points, points.copy(), points[:1])]
    assert asked == [2, 1]
    np.testing.assert_array_equal(seen[0], seen[1])
    assert not np.array_equal(seen[0], points)
    np.testing.assert_array_equal(seen[2], points[:1])
