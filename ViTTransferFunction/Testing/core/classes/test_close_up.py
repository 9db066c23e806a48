"""Boxes in which structures are looked at by themselves: where they lie, and what they follow."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.class_map import ClassMap
from ViTTransferFunction.Logic.core.classes.close_up import LEAST_VOXELS, CloseUp
from ViTTransferFunction.Logic.core.classes.close_up_choice import close_up_of
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.geometry import Box, Geometry

OBLIQUE = Geometry(
    (60, 80, 100),
    np.array([[0.0, -2.0, 0.0, 30.0], [1.0, 0.0, 0.0, -7.0], [0.0, 0.0, 3.0, 5.0], [0.0, 0.0, 0.0, 1.0]]),
)
"""Voxels of 1 × 2 × 3 mm, turned."""


def points_at(geometry: Geometry, *kji: tuple[float, float, float]) -> np.ndarray:
    return geometry.ijk_to_ras_points(np.array(kji)[:, ::-1])


def extents(box: Box) -> list[tuple[int, int]]:
    return [(extent.start, extent.stop) for extent in box]


def test_a_box_of_voxels_is_what_its_close_up_covers() -> None:
    box = slice(10, 30), slice(20, 50), slice(5, 65)
    close_up = CloseUp.of_box(box, OBLIQUE)
    assert close_up.size_mm == pytest.approx((60.0, 60.0, 60.0))
    assert close_up.box_in(OBLIQUE, points_at(OBLIQUE, (15, 30, 40))) == box


def test_a_point_beyond_enlarges_the_box_that_far_and_no_other_side() -> None:
    close_up = CloseUp.of_box((slice(10, 26), slice(20, 45), slice(5, 65)), OBLIQUE)
    box = close_up.box_in(OBLIQUE, points_at(OBLIQUE, (15, 30, 40), (15, 30, 90)))
    assert extents(box)[:2] == [(10, 26), (20, 45)]
    assert box[2] == slice(5, 100)  # 9 mm more than the point, but the volume ends before.
    assert extents(close_up.box_in(OBLIQUE, points_at(OBLIQUE, (15, 30, 70))))[2] == (5, 80)


def test_a_box_reaches_no_further_than_the_volume_and_is_no_thinner_than_the_network_can_look_at() -> None:
    point = points_at(OBLIQUE, (0, 0, 0))
    close_up = CloseUp(tuple(point[0]), (1.0, 1.0, 1.0))
    assert extents(close_up.box_in(OBLIQUE, point)) == [(0, LEAST_VOXELS)] * 3
    flat = Geometry((3, 80, 100), np.eye(4))
    assert close_up.box_in(flat, points_at(flat, (1, 40, 50)))[0] == slice(0, 3)


@pytest.mark.parametrize(
    ("centre", "size"),
    [
        ((0.0, 0.0), (1.0, 1.0, 1.0)),
        ((0.0, 0.0, float("nan")), (1.0, 1.0, 1.0)),
        ((0.0,) * 3, (1.0, 0.0, 1.0)),
        ("RAS", (1.0,) * 3),
    ],
)
def test_what_is_no_box_is_refused(centre: Any, size: Any) -> None:
    with pytest.raises(InputError, match=r"of a close-up is .*expected three numbers in millimetres"):
        CloseUp(centre, size)


def test_the_close_up_of_a_structure_holds_its_clicked_part_and_a_margin() -> None:
    cells = OBLIQUE.resized((20, 20, 20))
    array = np.zeros(cells.shape, dtype=np.float32)
    array[8:10, 6:9, 4:8] = 0.7
    array[15, 15, 15] = 0.9  # Not clicked.
    middle = cells.ijk_to_ras_points(np.array([[5.0, 7.0, 9.0]]))
    close_up = close_up_of(ClassMap(array, cells, 0.5), middle, OBLIQUE)
    # Cells of 3 × 4 × 5 voxels, and a margin of 0.045 · 180 mm: 2.7, 4.05 and 8.1 voxels; along K that is widened to 16.
    assert extents(close_up.box_in(OBLIQUE, middle)) == [(19, 35), (19, 41), (11, 49)]


def test_the_close_up_of_a_structure_holds_its_points_where_its_map_shows_nothing() -> None:
    cells = OBLIQUE.resized((20, 20, 20))
    nothing = np.zeros(cells.shape, dtype=np.float32)
    # The last two in the outermost corner.
    points = points_at(OBLIQUE, (30, 40, 50), (30, 48, 70), (59.49, 79.49, 99.49), (59.5, 79.5, 99.5))
    # A margin of 8.1 mm as above, around voxel centres.
    alone = close_up_of(ClassMap(nothing, cells, 0.5), points[:2], OBLIQUE)
    assert extents(alone.box_in(OBLIQUE, points[:1])) == [(22, 39), (36, 53), (42, 79)]
    shown = nothing.copy()
    shown[9:11, 9:11, 9:11] = 0.9
    both = close_up_of(ClassMap(shown, cells, 0.5), points[:2], OBLIQUE)
    assert extents(both.box_in(OBLIQUE, points[:1])) == [(22, 38), (31, 53), (36, 79)]
    of_corner = close_up_of(ClassMap(nothing, cells, 0.5), points[2:], OBLIQUE)
    assert extents(of_corner.box_in(OBLIQUE, points[2:])) == [(44, 60), (64, 80), (84, 100)]


def test_the_close_up_of_a_structure_that_was_clicked_on_a_face_of_the_volume_holds_it() -> None:
    cells = OBLIQUE.resized((20, 20, 20))
    array = np.zeros(cells.shape, dtype=np.float32)
    array[14:, 14:, 14:] = 0.9
    shown = ClassMap(array, cells, 0.5)
    within, on_faces = points_at(OBLIQUE, (59.0, 79.0, 99.0)), points_at(OBLIQUE, (59.5, 79.5, 99.5))
    assert close_up_of(shown, on_faces, OBLIQUE) == close_up_of(shown, within, OBLIQUE)


def test_a_map_in_bytes_of_a_part_of_the_volume_gives_the_same_close_up() -> None:
    box = slice(20, 40), slice(10, 50), slice(10, 60)
    geometry = OBLIQUE.part(box)
    array = np.zeros(geometry.shape, dtype=np.float32)
    array[5:10, 10:20, 10:30] = 1.0
    middle = geometry.ijk_to_ras_points(np.array([[20.0, 15.0, 7.0]]))
    whole = np.zeros(OBLIQUE.shape, dtype=np.float32)
    whole[box] = array
    of_part = close_up_of(ClassMap((255 * array).astype(np.uint8), geometry, 0.5), middle, OBLIQUE)
    assert of_part == close_up_of(ClassMap(whole, OBLIQUE, 0.5), middle, OBLIQUE)


def test_a_structure_that_fills_the_scan_is_not_looked_at_by_itself() -> None:
    array = np.ones((20, 20, 20), dtype=np.float32)
    with pytest.raises(InputError, match=r"box fills 100% of the scan.*at most 15%"):
        close_up_of(ClassMap(array, OBLIQUE.resized((20, 20, 20)), 0.5), points_at(OBLIQUE, (30, 40, 50)), OBLIQUE)


def test_a_flood_has_a_box_only_as_far_as_the_structure_may_reach() -> None:
    flood = ClassMap(np.ones(OBLIQUE.shape, dtype=np.float32), OBLIQUE, 0.5)
    part = ClassMap(np.zeros(OBLIQUE.shape, dtype=np.float32), OBLIQUE, 0.5)
    part.array[28:33, 38:43, 48:53] = 1.0
    points = points_at(OBLIQUE, (30, 40, 50))
    # And a margin of 8.1 mm: along I and J 20.1 mm to either side, along K that is widened to 16 voxels.
    assert close_up_of(flood, points, OBLIQUE, reach_mm=12.0).size_mm == (41.0, 42.0, 51.0)
    assert close_up_of(part, points, OBLIQUE, reach_mm=50.0) == close_up_of(part, points, OBLIQUE)
