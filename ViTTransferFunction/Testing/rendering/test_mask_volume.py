"""Volumes of colours and codes from masks: everything that a mask has is in them, at its place."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from ViTTransferFunction.Logic.core.geometry import Geometry
from ViTTransferFunction.Logic.rendering import mask_volume
from ViTTransferFunction.Logic.rendering.class_membership import memberships
from ViTTransferFunction.Logic.rendering.iso_surfaces import SMOOTH_RAMP
from ViTTransferFunction.Logic.rendering.mask_volume import mask_rgba
from ViTTransferFunction.Logic.rendering.optical_properties import SURFACE, optical_density

RED, GREEN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
SHAPE = (20, 24, 28)
SEEN = float(np.interp(0.5, SMOOTH_RAMP[:3], [0.0, SURFACE, 255.0]))
"""Code on the surface of an opaque mask: what lies under it is hidden, what lies over it is as good as clear."""


def grid(spacing_mm: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Geometry:
    turn = np.array([[0.8, -0.6, 0.0], [0.48, 0.64, -0.6], [0.36, 0.48, 0.8]])
    ijk_to_ras = np.eye(4)
    ijk_to_ras[:3, :3] = turn * spacing_mm
    ijk_to_ras[:3, 3] = 12.0, -40.0, 300.0
    return Geometry(SHAPE, ijk_to_ras)


def ball_mask(centre_kji: tuple[float, float, float], radius: float) -> np.ndarray:
    return np.linalg.norm(np.moveaxis(np.indices(SHAPE), 0, -1) - centre_kji, axis=-1) < radius


def at_voxels(geometry: Geometry, rgba: np.ndarray, fine: Geometry) -> np.ndarray:
    """Colours and codes at the centres of the masks' voxels, as a renderer interpolates them, (K, J, I, 4)."""
    kji = fine.ras_to_ijk(geometry.voxel_centres_ras()).T[::-1]
    found = [map_coordinates(rgba[..., channel].astype(np.float32), kji, order=1) for channel in range(4)]
    return np.stack(found, axis=-1).reshape(*geometry.shape, 4)


def gathered_opacity(codes: np.ndarray) -> float:
    """Of a ray along voxels with these codes."""
    steps = np.arange(0.0, len(codes) - 1, 0.05)
    density = np.interp(np.interp(steps, np.arange(len(codes)), codes), np.arange(256), optical_density())
    return 1.0 - np.exp(-0.05 * density.sum())


@pytest.mark.parametrize("spacing_mm", [(1.0, 1.0, 1.0), (0.8, 0.8, 4.0), (2.0, 0.9, 1.1)])
def test_masks_lie_where_their_voxels_do_in_oblique_anisotropic_grids(spacing_mm: tuple[float, float, float]) -> None:
    geometry = grid(spacing_mm)
    left, right = ball_mask((9.0, 11.0, 7.0), 5.0), ball_mask((10.0, 12.0, 20.0), 6.0)
    found = at_voxels(geometry, *mask_rgba(geometry, [left, right], [RED, GREEN], [1.0, 1.0]))
    inside = found[..., 3] > SEEN
    assert 2.0 * (inside & (left | right)).sum() / (inside.sum() + (left | right).sum()) > 0.97
    assert (found[left & inside][:, 0] > found[left & inside][:, 1]).all()
    assert (found[right & inside][:, 1] > found[right & inside][:, 0]).all()


@pytest.mark.parametrize("spacing_mm", [(1.0, 1.0, 1.0), (0.8, 0.8, 4.0), (3.0, 3.0, 10.0)])
@pytest.mark.parametrize("line", [np.s_[10, 12, 9:27], np.s_[2:19, 12, 22], np.s_[10, 1:23, 22]])
def test_a_line_of_single_voxels_is_drawn_beside_a_ball(line: Any, spacing_mm: tuple[float, float, float]) -> None:
    geometry = grid(spacing_mm)
    mask = np.zeros(SHAPE, dtype=bool)
    mask[line] = True
    ball = ball_mask((10.0, 12.0, 8.0), 5.0)
    found = at_voxels(geometry, *mask_rgba(geometry, [mask | ball], [RED], [1.0]))
    shown = found[..., 3][mask & ~ball] > 0.5 * (SURFACE + SEEN)
    # It may end early, by a part of a voxel.
    assert shown.sum() >= len(shown) - 2


@pytest.mark.parametrize("opacity", [0.2, 0.5, 0.8, 1.0])
def test_a_ray_through_a_surface_gathers_the_opacity_of_the_segment(opacity: float) -> None:
    rgba, _ = mask_rgba(grid(), [ball_mask((9.5, 11.5, 13.5), 8.0)], [RED], [opacity])
    k, j, i = (n // 2 for n in rgba.shape[:3])
    assert gathered_opacity(rgba[k, j, :i, 3]) == pytest.approx(opacity, abs=0.09)


def test_what_the_border_cuts_is_closed_there() -> None:
    rgba, _ = mask_rgba(grid(), [ball_mask((0.0, 12.0, 14.0), 8.0)], [RED], [0.5])
    middle = rgba[:, rgba.shape[1] // 2, rgba.shape[2] // 2, 3]
    assert middle[0] < SURFACE
    assert gathered_opacity(middle[: len(middle) // 2]) == pytest.approx(0.5, abs=0.1)


def test_of_two_that_overlap_the_more_opaque_one_shows() -> None:
    geometry = grid()
    inner, outer = ball_mask((9.5, 11.5, 13.5), 4.0), ball_mask((9.5, 11.5, 13.5), 8.0)
    for masks, colors, opacities in (([inner, outer], [RED, GREEN], [1.0, 0.3]), ([outer, inner], [GREEN, RED], [0.3, 1.0])):
        found = at_voxels(geometry, *mask_rgba(geometry, masks, colors, opacities))
        # Its outermost voxels are a mixture.
        core = ball_mask((9.5, 11.5, 13.5), 3.0)
        assert (found[core][:, 0] > found[core][:, 1]).all()
        assert (found[core][:, 3] > 200).all()


def test_the_volume_of_colours_just_encloses_the_masks() -> None:
    geometry = grid()
    _, fine = mask_rgba(geometry, [ball_mask((9.5, 11.5, 13.5), 2.0)], [RED], [1.0])
    assert fine.extent_mm == pytest.approx([8.0, 8.0, 8.0])


@pytest.mark.parametrize("budget", [40, 400, 4000])
def test_a_single_voxel_is_drawn_also_where_voxels_are_too_many_to_draw_all(
    monkeypatch: pytest.MonkeyPatch, budget: int
) -> None:
    monkeypatch.setattr(mask_volume, "VOXEL_BUDGET", budget)
    voxel, ball = np.zeros(SHAPE, dtype=bool), ball_mask((10.0, 12.0, 8.0), 5.0)
    voxel[10, 13, 23] = True
    rgba, fine = mask_rgba(grid(), [voxel, ball], [RED, GREEN], [1.0, 1.0])
    assert np.prod(rgba.shape[:3]) < 1.5 * budget
    shown = np.argwhere((rgba[..., 3] > SURFACE) & (rgba[..., 0] > rgba[..., 1]))
    assert len(shown)
    centre = grid().ijk_to_ras_points(np.array([[23, 13, 10]]))
    distance_mm = np.linalg.norm(fine.ijk_to_ras_points(shown.mean(axis=0)[None, ::-1]) - centre)
    assert distance_mm < fine.spacing_mm.max()


def test_a_class_that_reaches_the_border_fits_into_any_number_of_voxels() -> None:
    similarity = np.ones((49, 4, 4), dtype=np.float32)
    for count in range(50, 120):
        ((_, membership),) = memberships([similarity], [0.5], [1.0], (count, 8, 8), [1.0])
        assert membership.values.shape == (count, 8, 8)
        assert membership.box[0] == slice(0, count)
