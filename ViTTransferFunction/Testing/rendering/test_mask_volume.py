"""Volumes of structures from masks: everything that a mask has is in them, at its place."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.rendering.class_membership import memberships
from ViTTransferFunction.Logic.rendering.composition import DEPTH, INTENSITY, LIGHT, NUMBER, SURFACE
from ViTTransferFunction.Logic.rendering.mask_volume import mask_volume

RED, GREEN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
SHAPE = (20, 24, 28)


def grid(spacing_mm: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Geometry:
    turn = np.array([[0.8, -0.6, 0.0], [0.48, 0.64, -0.6], [0.36, 0.48, 0.8]])
    ijk_to_ras = np.eye(4)
    ijk_to_ras[:3, :3] = turn * spacing_mm
    ijk_to_ras[:3, 3] = 12.0, -40.0, 300.0
    return Geometry(SHAPE, ijk_to_ras)


def ball_mask(centre_kji: tuple[float, float, float], radius: float) -> np.ndarray:
    return np.linalg.norm(np.moveaxis(np.indices(SHAPE), 0, -1) - centre_kji, axis=-1) < radius


def at_voxels(geometry: Geometry, voxels: np.ndarray, fine: Geometry) -> tuple[np.ndarray, np.ndarray]:
    """Depths at the centres of the masks' voxels, as a renderer interpolates them, and the nearest numbers, (K, J, I) both."""
    kji = fine.ras_to_ijk(geometry.voxel_centres_ras()).T[::-1]
    depths = map_coordinates(voxels[..., DEPTH].astype(np.float32), kji, order=1)
    numbers = map_coordinates(voxels[..., NUMBER], kji, order=0)
    return depths.reshape(geometry.shape), numbers.reshape(geometry.shape)


@pytest.mark.parametrize("spacing_mm", [(1.0, 1.0, 1.0), (0.8, 0.8, 4.0), (2.0, 0.9, 1.1)])
def test_masks_lie_where_their_voxels_do_in_oblique_anisotropic_grids(spacing_mm: tuple[float, float, float]) -> None:
    geometry = grid(spacing_mm)
    left, right = ball_mask((9.0, 11.0, 7.0), 5.0), ball_mask((10.0, 12.0, 20.0), 6.0)
    depths, numbers = at_voxels(geometry, *mask_volume(geometry, [left, right], [1.0, 1.0]))
    inside = depths > SURFACE
    assert 2.0 * (inside & (left | right)).sum() / (inside.sum() + (left | right).sum()) > 0.97
    assert (numbers[left & inside] == 1).all()
    assert (numbers[right & inside] == 2).all()


@pytest.mark.parametrize("spacing_mm", [(1.0, 1.0, 1.0), (0.8, 0.8, 4.0), (3.0, 3.0, 10.0)])
@pytest.mark.parametrize("line", [np.s_[10, 12, 9:27], np.s_[2:19, 12, 22], np.s_[10, 1:23, 22]])
def test_a_line_of_single_voxels_is_drawn_beside_a_ball(line: Any, spacing_mm: tuple[float, float, float]) -> None:
    geometry = grid(spacing_mm)
    mask = np.zeros(SHAPE, dtype=bool)
    mask[line] = True
    ball = ball_mask((10.0, 12.0, 8.0), 5.0)
    depths, _ = at_voxels(geometry, *mask_volume(geometry, [mask | ball], [1.0]))
    shown = depths[mask & ~ball] > SURFACE
    # It may end early, by a part of a voxel.
    assert shown.sum() >= len(shown) - 2


def test_what_the_border_cuts_is_closed_there() -> None:
    voxels, _ = mask_volume(grid(), [ball_mask((0.0, 12.0, 14.0), 8.0)], [0.5])
    middle = voxels[:, voxels.shape[1] // 2, voxels.shape[2] // 2, DEPTH]
    assert middle[0] < SURFACE
    assert middle[: len(middle) // 2].max() > 240


def test_of_two_that_overlap_the_more_opaque_one_has_the_voxels() -> None:
    geometry = grid()
    inner, outer = ball_mask((9.5, 11.5, 13.5), 4.0), ball_mask((9.5, 11.5, 13.5), 8.0)
    # Its outermost voxels are a mixture.
    core = ball_mask((9.5, 11.5, 13.5), 3.0)
    for masks, opacities, number in (([inner, outer], [1.0, 0.3], 1), ([outer, inner], [0.3, 1.0], 2)):
        depths, numbers = at_voxels(geometry, *mask_volume(geometry, masks, opacities))
        assert (numbers[core] == number).all()
        assert (depths[core] > 160).all()


def test_what_is_not_seen_casts_no_shadow() -> None:
    masks = [ball_mask((9.5, 11.5, 9.5), 4.0), ball_mask((9.5, 11.5, 18.5), 4.0)]
    both, one = (mask_volume(grid(), masks, [1.0, opacity])[0] for opacity in (0.1, 0.0))
    lighter = one[..., LIGHT] > both[..., LIGHT]
    assert lighter[one[..., NUMBER] == 1].any()
    assert (one[..., LIGHT] >= both[..., LIGHT]).all()


def test_what_is_around_the_masks_is_in_the_volume_where_it_is_wanted() -> None:
    geometry, intensities = grid(), np.full(SHAPE, -1000, dtype=np.int16)
    intensities[2, 3, 4] = 200
    voxels, fine = mask_volume(
        geometry, [ball_mask((9.5, 11.5, 13.5), 4.0)], [1.0], None, (intensities, np.linspace(-1000.0, 200.0, 256)), whole=True
    )
    bright = np.argwhere(voxels[..., INTENSITY] > 60).mean(axis=0)
    place = fine.ijk_to_ras_points(bright[None, ::-1])
    assert place == pytest.approx(geometry.ijk_to_ras_points(np.array([[4, 3, 2]])), abs=0.5)


def test_bone_is_shown_whole_beside_a_voxel_without_intensity() -> None:
    bone = ball_mask((10.0, 12.0, 14.0), 5.0)
    intensities = np.where(bone, 400.0, 0.0)
    intensities[10, 12, 20] = np.nan
    depths, _ = at_voxels(grid(), *mask_volume(grid(), [bone], [1.0], [(intensities, 200.0)]))
    assert (depths[bone] > SURFACE).all()


def test_the_volume_just_encloses_the_masks() -> None:
    geometry = grid()
    _, fine = mask_volume(geometry, [ball_mask((9.5, 11.5, 13.5), 2.0)], [1.0])
    assert fine.extent_mm == pytest.approx([8.0, 8.0, 8.0])


def test_no_axis_has_more_voxels_than_every_graphics_card_takes() -> None:
    mask = np.ones((1, 1, 3000), dtype=bool)
    voxels, fine = mask_volume(Geometry(mask.shape, np.eye(4)), [mask], [1.0])
    assert max(voxels.shape) <= 2047
    assert fine.extent_mm == pytest.approx([3004.0, 5.0, 5.0])


@pytest.mark.parametrize("budget", [40, 400, 4000])
def test_a_single_voxel_is_drawn_also_where_voxels_are_too_many_to_draw_all(
    monkeypatch: pytest.MonkeyPatch, budget: int
) -> None:
    monkeypatch.setattr("ViTTransferFunction.Logic.rendering.mask_volume.VOXEL_BUDGET", budget)
    voxel, ball = np.zeros(SHAPE, dtype=bool), ball_mask((10.0, 12.0, 8.0), 5.0)
    voxel[10, 13, 23] = True
    voxels, fine = mask_volume(grid(), [voxel, ball], [1.0, 1.0])
    assert np.prod(voxels.shape[:3]) < 1.5 * budget
    shown = np.argwhere((voxels[..., DEPTH] > SURFACE) & (voxels[..., NUMBER] == 1))
    assert len(shown)
    centre = grid().ijk_to_ras_points(np.array([[23, 13, 10]]))
    distance_mm = np.linalg.norm(fine.ijk_to_ras_points(shown.mean(axis=0)[None, ::-1]) - centre)
    assert distance_mm < fine.spacing_mm.max()


def test_a_class_that_reaches_the_border_fits_into_any_number_of_voxels() -> None:
    similarity = np.ones((49, 4, 4), dtype=np.float32)
    for count in range(50, 120):
        ((_, membership),) = memberships([similarity], [0.5], (count, 8, 8), [1.0])
        assert membership.values.shape == (count, 8, 8)
        assert membership.box[0] == slice(0, count)
