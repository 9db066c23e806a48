"""Iso-surfaces of maps as colours and codes, and how classes share one volume."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.rendering.composition import VOXEL_BUDGET, shape_within_budget
from ViTTransferFunction.Logic.rendering.iso_surfaces import similarity_rgba
from ViTTransferFunction.Logic.rendering.optical_properties import SURFACE, optical_density
from ViTTransferFunction.Testing.support.views import ball

RED, GREEN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
SHAPE = (24, 24, 24)
CENTRE = (11.5, 11.5, 11.5)


def opaque(rgba: np.ndarray) -> np.ndarray:
    return rgba[..., 3] > SURFACE


def gathered_opacity(codes: np.ndarray) -> float:
    """Of a ray along voxels with these codes."""
    steps = np.arange(0.0, len(codes) - 1, 0.05)
    density = np.interp(np.interp(steps, np.arange(len(codes)), codes), np.arange(256), optical_density())
    return 1.0 - np.exp(-0.05 * density.sum())


@pytest.mark.parametrize("dtype", [np.float32, np.uint8])
def test_the_surface_lies_where_the_map_crosses_its_iso_value(dtype: type) -> None:
    similarity = ball((40, 40, 40), (19.5, 19.5, 19.5), 12.0, width=6.0)
    similarity = similarity if dtype is np.float32 else np.rint(255 * similarity).astype(np.uint8)
    rgba = similarity_rgba([similarity], [0.5], [RED], [1.0])
    per_cell = rgba.shape[0] / 40
    middle = rgba.shape[0] // 2
    codes = rgba[middle, middle, middle:, 3].astype(float)
    crossing = np.interp(-SURFACE, -codes, np.arange(middle, rgba.shape[0]))
    assert (crossing + 0.5) / per_cell - 20.0 == pytest.approx(12.0, abs=0.3)


def test_colours_reach_beyond_the_surface_so_that_interpolation_does_not_darken_it() -> None:
    rgba = similarity_rgba([ball(SHAPE, CENTRE, 7.0)], [0.5], [RED], [1.0])
    inside = opaque(rgba)
    around = np.zeros_like(inside)
    for axis in range(3):
        for shift in (-1, 1):
            around |= np.roll(inside, shift, axis)
    assert (rgba[around, 0] > 100).all()
    assert (rgba[around, 1:3] == 0).all()


@pytest.mark.parametrize("opacity", [0.2, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("coarse", [True, False])
def test_a_ray_through_a_surface_gathers_the_opacity_of_the_class(opacity: float, coarse: bool) -> None:
    shape = (30, 30, 30) if coarse else (120, 120, 120)
    similarity = ball(shape, ((shape[0] - 1) / 2,) * 3, 0.3 * shape[0])
    rgba = similarity_rgba([similarity if coarse else np.rint(255 * similarity).astype(np.uint8)], [0.5], [RED], [opacity])
    half = rgba.shape[0] // 2
    assert gathered_opacity(rgba[half, half, :half, 3]) == pytest.approx(opacity, abs=0.09)


def test_normals_of_a_coarse_map_do_not_show_its_cells() -> None:
    rgba = similarity_rgba([ball(SHAPE, CENTRE, 7.0)], [0.5], [RED], [1.0])
    gradient = np.stack(np.gradient(rgba[..., 3].astype(float)), axis=-1)
    kji = np.argwhere(abs(rgba[..., 3].astype(int) - (SURFACE + 40)) < 20)
    normals = -gradient[tuple(kji.T)]
    outwards = kji - (np.array(rgba.shape[:3]) - 1) / 2
    cosine = (normals * outwards).sum(axis=1) / np.linalg.norm(normals, axis=1) / np.linalg.norm(outwards, axis=1)
    assert np.degrees(np.arccos(cosine.min())) < 8.0


def test_twelve_classes_show_in_their_own_colours() -> None:
    colors = [(0.2 + 0.07 * n, 0.9 - 0.06 * n, n % 2) for n in range(12)]
    maps = [ball((20, 30, 40), (4.5 + 10 * (n // 6), 8.0 + 14 * (n // 3 % 2), 7.0 + 13 * (n % 3)), 3.5) for n in range(12)]
    rgba = similarity_rgba(maps, [0.5] * 12, colors, [1.0] * 12)
    per_cell = rgba.shape[0] // 20
    for n, color in enumerate(colors):
        centre = np.array([4.5 + 10 * (n // 6), 8.0 + 14 * (n // 3 % 2), 7.0 + 13 * (n % 3)])
        shown = rgba[tuple(((centre + 0.5) * per_cell).astype(int))]
        assert shown[3] > SURFACE
        assert shown[:3] / shown[:3].max() == pytest.approx(np.array(color) / max(color), abs=0.03)


def test_classes_that_overlap_meet_where_their_ratios_to_the_iso_values_are_equal() -> None:
    falling = np.broadcast_to(np.linspace(1.0, 0.0, 60, dtype=np.float32), (60, 60, 60))
    rgba = similarity_rgba([falling, falling[..., ::-1]], [0.4, 0.2], [RED, GREEN], [1.0, 1.0])
    row = rgba[rgba.shape[0] // 2, rgba.shape[1] // 2]
    # 1-x over 0.4 equals x over 0.2 at a third of the way.
    meeting = np.flatnonzero(row[:, 1] > row[:, 0])[0] / len(row)
    assert meeting == pytest.approx(1 / 3, abs=0.03)


def test_a_class_of_opacity_zero_is_not_seen_but_keeps_its_place() -> None:
    inner, outer = ball(SHAPE, CENTRE, 4.0), 0.6 * ball(SHAPE, CENTRE, 9.0)
    both = similarity_rgba([inner, outer], [0.5, 0.4], [RED, GREEN], [0.0, 1.0])
    alone = similarity_rgba([outer], [0.4], [GREEN], [1.0])
    middle = tuple(n // 2 for n in both.shape[:3])
    assert (both[..., 0] == 0).all()
    assert both[middle][3] < SURFACE < alone[middle][3]


def test_a_class_that_the_border_cuts_is_closed_there() -> None:
    rgba = similarity_rgba([ball((60, 60, 60), (0.0, 30.0, 30.0), 20.0)], [0.5], [RED], [0.5])
    middle = rgba.shape[1] // 2
    assert gathered_opacity(rgba[: rgba.shape[0] // 6, middle, middle, 3]) > 0.25


def test_maps_of_different_resolution_make_one_picture() -> None:
    left = np.rint(255 * ball((96, 96, 96), (47.5, 47.5, 24.0), 18.0)).astype(np.uint8)
    right = ball(SHAPE, (11.5, 11.5, 17.5), 4.0)
    rgba = similarity_rgba([left, right], [0.5, 0.5], [RED, GREEN], [1.0, 1.0])
    scale = rgba.shape[0] / 96
    at = lambda k, j, i: rgba[tuple((scale * (np.array([k, j, i]) + 0.5)).astype(int))]  # noqa: E731
    assert at(48, 48, 24)[0] > 100
    assert at(48, 48, 71)[1] > 100
    assert at(48, 48, 48)[3] < SURFACE


def test_a_map_below_its_iso_value_or_without_numbers_shows_nothing() -> None:
    low, empty = np.full(SHAPE, 0.3, dtype=np.float32), np.full(SHAPE, np.nan, dtype=np.float32)
    rgba = similarity_rgba([low, empty], [0.5, 0.5], [RED, GREEN], [1.0, 1.0])
    assert not opaque(rgba).any()


def test_large_volumes_are_shortened_along_their_longest_axes_alone() -> None:
    assert shape_within_budget((100, 512, 512)) == (100, 412, 412)
    assert np.prod(shape_within_budget((900, 700, 500))) <= VOXEL_BUDGET
    assert shape_within_budget((256, 256, 256)) == (256, 256, 256)


def test_a_volume_over_budget_still_places_its_classes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ViTTransferFunction.Logic.rendering.composition.VOXEL_BUDGET", 40**3)
    similarity = np.rint(255 * ball((64, 64, 64), (31.5, 31.5, 16.0), 10.0)).astype(np.uint8)
    monkeypatch.setattr("ViTTransferFunction.Logic.rendering.iso_surfaces.VOXELS_FROM_CELLS", 0)
    rgba = similarity_rgba([similarity], [0.5], [RED], [1.0])
    assert rgba.shape == (40, 40, 40, 4)
    assert np.argwhere(opaque(rgba)).mean(axis=0) == pytest.approx([19.5, 19.5, 16.5 * 40 / 64 - 0.5], abs=0.5)
