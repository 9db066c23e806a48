"""What begins with a small outline is looked at closely where it is shown as something else in the outline's slice."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.class_map import FULL_SCALE, ClassMap
from ViTTransferFunction.Logic.core.classes.small_outlines import agreement, asks_for_close_up, reach_mm
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry

OBLIQUE = np.array([[0.6, -0.8, 0.0, 10.0], [0.8, 0.6, 0.0, -20.0], [0.0, 0.0, 3.0, 30.0], [0.0, 0.0, 0.0, 1.0]])
VOXELS = Geometry((40, 100, 100), OBLIQUE)
MIDDLE_IJK = np.array([50.0, 50.0, 20.0])


def circle(radius_mm: float, shift_mm: float = 0.0) -> np.ndarray:
    """(60, 3) RAS millimetres, in a slice."""
    angles = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    in_slice = radius_mm * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    return VOXELS.ijk_to_ras_points(MIDDLE_IJK + in_slice + np.array([shift_mm, 0.0, 0.0]))


def ball(radius_mm: float, in_bytes: bool = False) -> ClassMap:
    """A map that shows a ball around the middle, on the box that holds it."""
    box = (slice(10, 30), slice(20, 80), slice(20, 80))
    part = VOXELS.part(box)
    middle = VOXELS.ijk_to_ras_points(MIDDLE_IJK[None])
    away = np.linalg.norm(part.voxel_centres_ras() - middle, axis=1).reshape(part.shape)
    array = np.clip(0.5 + (radius_mm - away) / 20.0, 0.0, 1.0).astype(np.float32)
    return ClassMap(np.rint(FULL_SCALE * array).astype(np.uint8) if in_bytes else array, part, 0.5)


@pytest.mark.parametrize("in_bytes", [False, True])
def test_what_is_shown_as_it_was_outlined_agrees_with_the_outline(in_bytes: bool) -> None:
    assert agreement(ball(12.0, in_bytes), circle(12.0)) > 0.97


def test_a_flood_a_miss_and_a_part_disagree_as_dice_says(subtests: pytest.Subtests) -> None:
    shown = ball(12.0)
    for outline, expected in ((circle(6.0), 2 * 36 / (36 + 144)), (circle(24.0), 2 * 144 / (576 + 144))):
        with subtests.test(expected=expected):
            assert agreement(shown, outline) == pytest.approx(expected, abs=0.03)
    # Beside it, and beyond the grid of the map.
    assert agreement(shown, circle(6.0, 20.0)) == 0.0
    assert agreement(shown, circle(6.0, 45.0)) == 0.0


def test_what_is_shown_elsewhere_in_the_plane_counts_and_what_is_beside_it_does_not() -> None:
    shown = ball(6.0)
    other = np.zeros(shown.array.shape, dtype=np.float32)
    k, j, i = np.ogrid[:20, :60, :60]
    for middle_k, middle, expected in ((0, 10, 1.0), (10, 10, 2 * 36 / (36 + 36 + 64)), (10, 50, 2 * 36 / (36 + 36 + 64))):
        disc = (np.abs(k - middle_k) < 1) & ((j - middle) ** 2 + (i - middle) ** 2 <= 8.0**2)
        both = ClassMap(np.maximum(shown.array, other + disc), shown.geometry, 0.5)
        assert agreement(both, circle(6.0)) == pytest.approx(expected, abs=0.06)


@pytest.mark.parametrize(
    ("radius_mm", "cell_mm", "asks"), [(6.0, 4.0, True), (6.0, 2.5, False), (12.0, 8.0, False), (11.0, 8.0, False)]
)
def test_small_and_shown_as_something_else_asks_for_a_close_up_and_neither_alone_does(
    radius_mm: float, cell_mm: float, asks: bool
) -> None:
    assert asks_for_close_up(ball(12.0), circle(radius_mm), cell_mm, 1.0) == asks


def test_a_structure_may_reach_half_its_outlines_length_beyond() -> None:
    assert reach_mm(circle(12.0), 1.0) == pytest.approx(12.0, rel=0.1)
