"""Clicks deep within what is wrong, by a map of a sphere."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.class_map import FULL_SCALE, ClassMap
from ViTTransferFunction.Logic.core.classes.gross_correction import corrects_grossly
from ViTTransferFunction.Logic.core.volumes.geometry import Box, Geometry

ISOTROPIC = np.eye(4)
ANISOTROPIC = np.diag([0.7, 0.7, 4.0, 1.0])
OBLIQUE = np.array([[0.6, -0.96, 0.0, 11.0], [0.48, 0.36, -2.4, -7.0], [0.64, 0.48, 1.8, 40.0], [0.0, 0.0, 0.0, 1.0]])
"""Spacing 1.0×1.2×3.0 mm, rotated about two axes."""
GRIDS = {"isotropic": ISOTROPIC, "anisotropic": ANISOTROPIC, "oblique": OBLIQUE}
RADIUS_MM, DEPTH_MM = 15.0, 5.0
AXES = np.concatenate([np.eye(3), -np.eye(3), np.array([[1.0, 1.0, -1.0]]) / np.sqrt(3.0)])


def sphere(ijk_to_ras: np.ndarray, in_bytes: bool = False) -> tuple[ClassMap, Geometry, np.ndarray]:
    """A map that shows a sphere in the middle of a volume of 100 mm; the volume's geometry; and the middle, (3,) RAS."""
    spacing = np.linalg.norm(ijk_to_ras[:3, :3], axis=0)
    i, j, k = (int(n) for n in np.round(100.0 / spacing))
    geometry = Geometry((k, j, i), ijk_to_ras)
    middle = geometry.ijk_to_ras_points((np.array([[i, j, k]]) - 1.0) / 2.0)[0]
    away = np.linalg.norm(geometry.voxel_centres_ras() - middle, axis=1).reshape(geometry.shape)
    # As steep as an edge in an image, so that the surface lies at the radius between voxels, too.
    array = np.clip(0.5 + (RADIUS_MM - away) / 8.0, 0.0, 1.0).astype(np.float32)
    array = np.rint(FULL_SCALE * array).astype(np.uint8) if in_bytes else array
    return ClassMap(array, geometry, 0.5), geometry, middle


@pytest.mark.parametrize("in_bytes", [False, True])
@pytest.mark.parametrize("grid", GRIDS)
def test_a_negative_point_is_gross_where_it_is_deeper_than_that_within_what_is_shown(grid: str, in_bytes: bool) -> None:
    shown, geometry, middle = sphere(GRIDS[grid], in_bytes)
    for axis in AXES:
        deep, shallow = (middle + (RADIUS_MM - depth) * axis for depth in (1.3 * DEPTH_MM, 0.7 * DEPTH_MM))
        assert corrects_grossly(shown, geometry, deep, False, DEPTH_MM)
        assert not corrects_grossly(shown, geometry, shallow, False, DEPTH_MM)
        assert not corrects_grossly(shown, geometry, middle + 3.0 * RADIUS_MM * axis / 1.5, False, DEPTH_MM)


@pytest.mark.parametrize("in_bytes", [False, True])
@pytest.mark.parametrize("grid", GRIDS)
def test_a_positive_point_is_gross_where_it_is_farther_than_that_from_what_is_shown(grid: str, in_bytes: bool) -> None:
    shown, geometry, middle = sphere(GRIDS[grid], in_bytes)
    for axis in AXES:
        far, near = (middle + (RADIUS_MM + distance) * axis for distance in (1.3 * DEPTH_MM, 0.7 * DEPTH_MM))
        assert corrects_grossly(shown, geometry, far, True, DEPTH_MM)
        assert not corrects_grossly(shown, geometry, near, True, DEPTH_MM)
    assert not corrects_grossly(shown, geometry, middle, True, DEPTH_MM)


@pytest.mark.parametrize("grid", GRIDS)
def test_beyond_the_volume_nothing_is_wrong_and_nothing_is_right(grid: str) -> None:
    _, geometry, _ = sphere(GRIDS[grid])
    everywhere = ClassMap(np.ones(geometry.shape, dtype=np.float32), geometry, 0.5)
    nowhere = ClassMap(np.zeros(geometry.shape, dtype=np.float32), geometry, 0.5)
    corner = geometry.ijk_to_ras_points(np.array([[-0.4, -0.4, -0.4]]))[0]
    beyond = geometry.ijk_to_ras_points(np.array([[-0.6, 5.0, 5.0]]))[0]
    assert corrects_grossly(everywhere, geometry, corner, False, DEPTH_MM)
    assert corrects_grossly(nowhere, geometry, corner, True, DEPTH_MM)
    assert not corrects_grossly(everywhere, geometry, beyond, False, DEPTH_MM)
    assert not corrects_grossly(nowhere, geometry, beyond, True, DEPTH_MM)


def test_what_was_cut_off_a_map_is_not_shown() -> None:
    whole, geometry, middle = sphere(ISOTROPIC)
    box: Box = (slice(30, 70),) * 3
    part = ClassMap(whole.array[box], geometry.part(box), whole.iso)
    far = middle + np.array([30.0, 0.0, 0.0])
    assert corrects_grossly(part, geometry, far, True, DEPTH_MM)
    assert not corrects_grossly(part, geometry, far, False, DEPTH_MM)
    # The box ends within what is shown.
    box = (slice(30, 70), slice(30, 70), slice(30, 52))
    part = ClassMap(whole.array[box], geometry.part(box), whole.iso)
    assert not corrects_grossly(part, geometry, middle, False, DEPTH_MM)
    assert corrects_grossly(part, geometry, middle - np.array([7.0, 0.0, 0.0]), False, DEPTH_MM)


def test_a_thin_structure_that_is_near_is_found_in_any_direction() -> None:
    geometry = Geometry((40, 40, 40), np.eye(4))
    array = np.zeros(geometry.shape, dtype=np.float32)
    array[18:20, 21:23, :] = 1.0
    thin = ClassMap(array, geometry, 0.5)
    turned = [(np.sin(angle), np.cos(angle)) for angle in np.linspace(0.0, 2.0 * np.pi, 40)]
    beside = [np.array([20.3, 21.5 + 4.0 * y, 18.5 + 4.0 * z]) for y, z in turned]
    assert not any(corrects_grossly(thin, geometry, point, True, DEPTH_MM) for point in beside)


def test_a_map_of_cells_is_judged_between_their_centres() -> None:
    _, geometry, middle = sphere(OBLIQUE)
    cells = geometry.resized((20, 20, 20))
    away = np.linalg.norm(cells.voxel_centres_ras() - middle, axis=1).reshape(cells.shape)
    shown = ClassMap(np.clip(0.5 + (RADIUS_MM - away) / 20.0, 0.0, 1.0).astype(np.float32), cells, 0.5)
    outwards = AXES[-1]
    assert corrects_grossly(shown, geometry, middle + 8.0 * outwards, False, DEPTH_MM)
    assert not corrects_grossly(shown, geometry, middle + 12.0 * outwards, False, DEPTH_MM)
    assert not corrects_grossly(shown, geometry, middle + 18.0 * outwards, True, DEPTH_MM)
    assert corrects_grossly(shown, geometry, middle + 22.0 * outwards, True, DEPTH_MM)
