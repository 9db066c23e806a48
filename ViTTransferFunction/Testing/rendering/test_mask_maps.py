"""Maps of masks: they select the masks' voxels but for a surface's roughness, and are smooth in between."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.ndimage import binary_dilation, binary_erosion

from ViTTransferFunction.Logic.rendering.mask_maps import ISO, mask_map

ISOTROPIC, THICK = np.array([1.0, 1.0, 1.0]), np.array([0.8, 0.7, 5.0])


def selected(similarity: np.ndarray) -> np.ndarray:
    return similarity >= 255.0 * ISO


@settings(max_examples=60, deadline=None)
@given(
    mask=arrays(bool, array_shapes(min_dims=3, max_dims=3, min_side=1, max_side=9)),
    spacing_mm=st.tuples(*[st.floats(0.3, 12.0)] * 3).map(np.array),
)
def test_what_the_map_selects_of_any_mask_differs_from_it_by_no_more_than_a_voxel(
    mask: np.ndarray, spacing_mm: np.ndarray
) -> None:
    shown = selected(mask_map(mask, spacing_mm))
    cube = np.ones((3, 3, 3), dtype=bool)
    for side, shown_side in ((mask, shown), (~mask, ~shown)):
        assert not (side & ~shown_side & ~binary_dilation(side & shown_side, cube)).any()


def rough_ball(seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """A ball, and the same with voxels that stand out from it and others that are missing, (40, 40, 40) bool both."""
    rng = np.random.default_rng(seed)
    smooth = np.linalg.norm(np.moveaxis(np.indices((40, 40, 40)), 0, -1) - 19.5, axis=-1) < 14.0
    outer, inner = binary_dilation(smooth) & ~smooth, smooth & ~binary_erosion(smooth)
    chance = rng.random(smooth.shape) < 0.06
    return smooth, smooth ^ (chance & (outer | inner))


def test_single_voxels_that_roughen_a_surface_are_evened_out() -> None:
    smooth, rough = rough_ball()
    before = (rough ^ smooth).sum()
    after = selected(mask_map(rough, ISOTROPIC)) ^ smooth
    assert before > 150
    assert after.sum() < 0.35 * before
    for axis in range(3):
        silhouette, shown = rough.any(axis=axis), selected(mask_map(rough, ISOTROPIC)).any(axis=axis)
        assert 2.0 * (silhouette & shown).sum() / (silhouette.sum() + shown.sum()) >= 0.97


def test_what_stands_out_by_more_than_a_voxel_is_no_roughness() -> None:
    _, rough = rough_ball()
    branch, island = np.s_[33:39, 19, 19], np.s_[37, 37, 37]
    rough[branch] = rough[island] = True
    shown = selected(mask_map(rough, ISOTROPIC))
    assert shown[branch].all()
    assert shown[island]
    # A channel through the middle.
    rough[:, 10, 19] = False
    assert not selected(mask_map(rough, ISOTROPIC))[10:30, 10, 19].any()


def test_a_thick_slice_is_no_roughness() -> None:
    mask = np.zeros((9, 30, 30), dtype=bool)
    mask[2:6, 5:25, 5:25] = True
    mask[6, 14, 14] = True
    assert not selected(mask_map(mask, ISOTROPIC))[6].any()
    assert selected(mask_map(mask, THICK))[6, 14, 14]


THIN = {
    "a voxel": np.s_[8, 9, 7],
    "a line": np.s_[8, 9, 2:15],
    "a line across slices": np.s_[2:15, 9, 7],
    "a sheet": np.s_[8, 2:15, 2:15],
    "a line to the border": np.s_[8, 9, :5],
    "a corner": np.s_[0, 0, 0],
    "a face": np.s_[:, :, -1],
    "everything": np.s_[:],
    "nothing": np.s_[:0],
}


@pytest.mark.parametrize("spacing_mm", [ISOTROPIC, THICK], ids=["isotropic", "thick slices"])
@pytest.mark.parametrize("where", THIN.values(), ids=THIN.keys())
@pytest.mark.parametrize("inverse", [False, True], ids=["mask", "gap"])
def test_the_map_selects_exactly_thin_parts_and_thin_gaps(where: Any, spacing_mm: np.ndarray, inverse: bool) -> None:
    mask = np.zeros((17, 18, 19), dtype=bool)
    mask[where] = True
    mask ^= inverse
    assert np.array_equal(selected(mask_map(mask, spacing_mm)), mask)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_map_selects_exactly_the_mask_whatever_the_similarities_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mask = rng.random((6, 7, 8)) < 0.4
    similarity = rng.normal(size=mask.shape)
    assert np.array_equal(selected(mask_map(mask, THICK, similarity, iso=0.2)), mask)


@pytest.mark.parametrize("spacing_mm", [ISOTROPIC, np.array([1.0, 1.0, 4.0])], ids=["isotropic", "thick slices"])
def test_the_surface_of_a_ball_has_no_stairs(spacing_mm: np.ndarray) -> None:
    shape = np.ceil(36.0 / spacing_mm[::-1]).astype(int)
    way_mm = (np.moveaxis(np.indices(tuple(shape.tolist())), 0, -1) - (shape - 1) / 2) * spacing_mm[::-1]
    radii_mm = np.linalg.norm(way_mm, axis=-1)
    outwards, near = way_mm / radii_mm[..., None], abs(radii_mm - 14.0) < 0.5 * spacing_mm.max()

    def degrees_off(values: np.ndarray) -> float:
        """By which 90 % of the normals differ from those of the ball, at most."""
        gradient = np.stack(np.gradient(values.astype(float), *spacing_mm[::-1]), axis=-1)[near]
        cosine = -(gradient * outwards[near]).sum(axis=-1) / np.maximum(np.linalg.norm(gradient, axis=-1), 1e-9)
        return float(np.percentile(np.degrees(np.arccos(cosine.clip(-1.0, 1.0))), 90))

    mask = radii_mm < 14.0
    smooth = degrees_off(mask_map(mask, spacing_mm))
    assert smooth < (9.0 if spacing_mm is ISOTROPIC else 18.0)
    assert smooth < 0.35 * degrees_off(mask)


def test_the_surface_lies_half_way_between_voxels_of_a_flat_mask() -> None:
    mask = np.zeros((12, 12, 12), dtype=bool)
    mask[:, :, :6] = True
    row = mask_map(mask, ISOTROPIC)[6, 6].astype(float)
    assert np.interp(-127.5, -row, np.arange(12)) == pytest.approx(5.5, abs=0.05)


@pytest.mark.parametrize("iso", [-3.0, -2.8])
def test_similarities_place_the_surface_between_voxels(iso: float) -> None:
    distance = np.abs(np.arange(15) - 7.0) * np.ones((15, 15, 1))
    row = mask_map(-distance >= iso, ISOTROPIC, -distance, iso)[7, 7].astype(float)
    assert np.interp(-127.5, -row[7:], np.arange(8)) == pytest.approx(-iso, abs=0.12)


def test_a_part_of_the_similarities_outside_the_mask_is_left_out() -> None:
    similarity = np.ones((5, 5, 30))
    mask = np.zeros(similarity.shape, dtype=bool)
    mask[..., :10] = True
    shown = mask_map(mask, ISOTROPIC, similarity, 0.5)
    assert (shown[..., 14:] == 0).all()
