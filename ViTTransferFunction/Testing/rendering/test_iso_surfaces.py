"""Iso-surfaces of maps, and how classes share one volume."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.rendering.composition import (
    DEPTH,
    LIGHT,
    NUMBER,
    SURFACE,
    VOXEL_BUDGET,
    shape_within_budget,
)
from ViTTransferFunction.Logic.rendering.iso_surfaces import similarity_shape, similarity_volume
from ViTTransferFunction.Testing.support.views import ball

SHAPE = (24, 24, 24)
CENTRE = (11.5, 11.5, 11.5)


def volume(maps: list[np.ndarray], isos: list[float] | None = None) -> np.ndarray:
    return similarity_volume(maps, isos or [0.5] * len(maps)).voxels()


def inside(voxels: np.ndarray) -> np.ndarray:
    return voxels[..., DEPTH] > SURFACE


@pytest.mark.parametrize("dtype", [np.float32, np.uint8])
def test_the_surface_lies_where_the_map_crosses_its_iso_value(dtype: type) -> None:
    similarity = ball((40, 40, 40), (19.5, 19.5, 19.5), 12.0, width=6.0)
    similarity = similarity if dtype is np.float32 else np.rint(255 * similarity).astype(np.uint8)
    voxels = volume([similarity])
    per_cell = voxels.shape[0] / 40
    middle = voxels.shape[0] // 2
    depths = voxels[middle, middle, middle:, DEPTH].astype(float)
    crossing = np.interp(-SURFACE, -depths, np.arange(middle, voxels.shape[0]))
    assert (crossing + 0.5) / per_cell - 20.0 == pytest.approx(12.0, abs=0.3)


def test_voxels_around_a_structure_have_its_number_so_that_its_surface_is_interpolated() -> None:
    voxels = volume([ball(SHAPE, CENTRE, 7.0)])
    core = inside(voxels)
    around = np.zeros_like(core)
    for axis in range(3):
        for shift in (-1, 1):
            around |= np.roll(core, shift, axis)
    assert (voxels[around, NUMBER] == 1).all()


def test_normals_of_a_coarse_map_do_not_show_its_cells() -> None:
    voxels = volume([ball(SHAPE, CENTRE, 7.0)])
    gradient = np.stack(np.gradient(voxels[..., DEPTH].astype(float)), axis=-1)
    kji = np.argwhere(abs(voxels[..., DEPTH].astype(int) - (SURFACE + 40)) < 20)
    normals = -gradient[tuple(kji.T)]
    outwards = kji - (np.array(voxels.shape[:3]) - 1) / 2
    cosine = (normals * outwards).sum(axis=1) / np.linalg.norm(normals, axis=1) / np.linalg.norm(outwards, axis=1)
    assert np.degrees(np.arccos(cosine.min())) < 8.0


def test_twelve_classes_have_their_own_numbers() -> None:
    centres = [(4.5 + 10 * (n // 6), 8.0 + 14 * (n // 3 % 2), 7.0 + 13 * (n % 3)) for n in range(12)]
    voxels = volume([ball((20, 30, 40), centre, 3.5) for centre in centres])
    per_cell = voxels.shape[0] // 20
    for n, centre in enumerate(centres):
        shown = voxels[tuple(((np.array(centre) + 0.5) * per_cell).astype(int))]
        assert shown[DEPTH] > SURFACE
        assert shown[NUMBER] == n + 1


def test_more_structures_than_graphics_cards_have_room_for_are_refused() -> None:
    with pytest.raises(InputError, match="up to 207 structures, and there are 208"):
        similarity_volume([np.zeros((2, 2, 2), dtype=np.float32)] * 208, [0.5] * 208)


def test_classes_that_overlap_meet_where_their_ratios_to_the_iso_values_are_equal() -> None:
    falling = np.broadcast_to(np.linspace(1.0, 0.0, 60, dtype=np.float32), (60, 60, 60))
    voxels = volume([falling, falling[..., ::-1]], [0.4, 0.2])
    row = voxels[voxels.shape[0] // 2, voxels.shape[1] // 2]
    # 1-x over 0.4 equals x over 0.2 at a third of the way.
    meeting = np.flatnonzero(row[:, NUMBER] == 2)[0]
    assert meeting / len(row) == pytest.approx(1 / 3, abs=0.03)
    # Both have their surface there, should the other be hidden.
    assert row[meeting - 2 : meeting + 2, DEPTH].min() < row[:, DEPTH].max() - 50


def test_a_class_within_another_has_a_surface_of_its_own() -> None:
    voxels = volume([ball(SHAPE, CENTRE, 4.0), 0.6 * ball(SHAPE, CENTRE, 9.0)], [0.5, 0.4])
    row = voxels[voxels.shape[0] // 2, voxels.shape[1] // 2]
    changes = np.flatnonzero(np.diff(np.where(row[:, DEPTH] > SURFACE, row[:, NUMBER], 0).astype(int)))
    assert [int(row[at + 1, NUMBER]) for at in changes[:2]] == [2, 1]
    assert row[changes[1] - 1 : changes[1] + 3, DEPTH].min() < 190


def test_what_casts_no_shadow_leaves_the_others_in_the_light() -> None:
    maps = [ball((60, 60, 60), (29.5, 29.5, 15.0), 12.0), ball((60, 60, 60), (29.5, 29.5, 40.0), 12.0)]
    composition = similarity_volume(maps, [0.5, 0.5])
    facing = tuple(int(share * size) for share, size in zip((0.5, 0.5, 0.44), composition.shape, strict=True))
    both, alone = (int(composition.voxels(None, casting)[facing][LIGHT]) for casting in ([True, True], [True, False]))
    assert both < alone - 10


def test_maps_of_different_resolution_make_one_volume() -> None:
    left = np.rint(255 * ball((96, 96, 96), (47.5, 47.5, 24.0), 18.0)).astype(np.uint8)
    right = ball(SHAPE, (11.5, 11.5, 17.5), 4.0)
    voxels = volume([left, right])
    scale = voxels.shape[0] / 96
    at = lambda k, j, i: voxels[tuple((scale * (np.array([k, j, i]) + 0.5)).astype(int))]  # noqa: E731
    assert at(48, 48, 24)[NUMBER] == 1
    assert at(48, 48, 71)[NUMBER] == 2
    assert at(48, 48, 48)[DEPTH] < SURFACE


def test_a_map_below_its_iso_value_or_without_numbers_shows_nothing() -> None:
    low, empty = np.full(SHAPE, 0.3, dtype=np.float32), np.full(SHAPE, np.nan, dtype=np.float32)
    assert not inside(volume([low, empty])).any()


def test_large_volumes_are_shortened_along_their_longest_axes_alone() -> None:
    assert shape_within_budget((100, 512, 512)) == (100, 412, 412)
    assert np.prod(shape_within_budget((900, 700, 500))) <= VOXEL_BUDGET
    assert shape_within_budget((256, 256, 256)) == (256, 256, 256)


@pytest.mark.parametrize("shape", [(1, 2600, 2100), (8, 12, 1500), (3, 3, 9000)])
def test_no_axis_has_more_voxels_than_every_graphics_card_takes(shape: tuple[int, int, int]) -> None:
    similarity = np.zeros(shape, dtype=np.float32)
    assert max(similarity_shape([similarity])) <= 2047
    assert max(shape_within_budget(shape)) <= 2047


def test_a_volume_over_budget_still_places_its_classes(monkeypatch: pytest.MonkeyPatch) -> None:
    within = partial(shape_within_budget, budget=40**3)
    monkeypatch.setattr("ViTTransferFunction.Logic.rendering.iso_surfaces.shape_within_budget", within)
    similarity = np.rint(255 * ball((64, 64, 64), (31.5, 31.5, 16.0), 10.0)).astype(np.uint8)
    monkeypatch.setattr("ViTTransferFunction.Logic.rendering.iso_surfaces.VOXELS_FROM_CELLS", 0)
    voxels = volume([similarity])
    assert voxels.shape == (40, 40, 40, 4)
    assert np.argwhere(inside(voxels)).mean(axis=0) == pytest.approx([19.5, 19.5, 16.5 * 40 / 64 - 0.5], abs=0.5)
