"""Maps of cells and maps of voxels on one box."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ViTTransferFunction.Logic.compute import shown_maps
from ViTTransferFunction.Logic.compute.shown_maps import Shown, on_one_box
from ViTTransferFunction.Logic.core.classes.class_map import ClassMap
from ViTTransferFunction.Logic.core.volumes.bounding_box import whole_box
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.resampling import cell_positions, interpolated
from ViTTransferFunction.Logic.core.volumes.voxel_map import VoxelMap
from ViTTransferFunction.Logic.rendering.class_membership import Map, PartialMap
from ViTTransferFunction.Logic.session.map_crop import MapCrop, crop_map

WHOLE = (20, 16, 24)
ISO = 0.5


def cone(k: int) -> np.ndarray:
    """A map on voxels that falls off around voxel (k, 8, 12)."""
    at_k, at_j, at_i = np.indices(WHOLE)
    distance = np.sqrt((at_k - k) ** 2 + (at_j - 8) ** 2 + (at_i - 12) ** 2)
    return np.clip(1.0 - distance / 9.0, 0.0, 1.0).astype(np.float32)


def on_cells(similarity: np.ndarray) -> ClassMap:
    """S_L, on cells of two voxels along each axis."""
    array = similarity.reshape(10, 2, 8, 2, 12, 2).mean(axis=(1, 3, 5))
    return ClassMap(array, Geometry((10, 8, 12), np.diag([2.0, 2.0, 2.0, 1.0])), ISO)


def on_voxels(similarity: np.ndarray) -> MapCrop:
    """S_H."""
    return crop_map(VoxelMap.whole(similarity), ISO)


def whole(similarity: Map) -> np.ndarray:
    return similarity.on(whole_box(similarity.shape)) if isinstance(similarity, PartialMap) else similarity


def test_cells_and_voxels_meet_on_the_box_that_matters_to_both() -> None:
    fine, coarse = cone(6), cone(12)
    maps: list[Shown] = [on_voxels(fine), on_cells(coarse)]
    shown, box, shape = on_one_box(maps, WHOLE)
    of_fine, of_coarse = map(whole, shown)
    assert shape is None
    assert fine[box].size < fine.size
    assert of_fine.shape == of_coarse.shape == fine[box].shape
    near = fine[box] >= 0.5 * ISO
    np.testing.assert_allclose(of_fine[near] / 255.0, fine[box][near], atol=0.5 / 255.0)
    surface = abs(coarse[box] - ISO) < 0.1
    assert surface.sum() == (abs(coarse - ISO) < 0.1).sum()
    np.testing.assert_allclose(of_coarse[surface] / 255.0, coarse[box][surface], atol=0.04)


def test_voxels_alone_meet_on_the_box_that_holds_them_all() -> None:
    similarities = [cone(6), cone(12)]
    shown, box, shape = on_one_box([on_voxels(similarity) for similarity in similarities], WHOLE)
    assert shape is None
    for each, similarity in zip(map(whole, shown), similarities, strict=True):
        near = similarity[box] >= 0.5 * ISO
        np.testing.assert_allclose(each[near] / 255.0, similarity[box][near], atol=0.5 / 255.0)
        assert near.sum() == (similarity >= 0.5 * ISO).sum()


def test_cells_are_put_on_voxels_as_if_all_of_them_were_there() -> None:
    low = on_cells(cone(12))
    (_, of_coarse), box, _ = on_one_box([on_voxels(cone(6)), low], WHOLE)
    positions = [cell_positions(cells, size, extent) for cells, size, extent in zip(low.array.shape, WHOLE, box, strict=True)]
    expected = 255.0 * interpolated(low.array, positions, cubic=True)
    near = expected >= 0.5 * ISO * 255.0
    np.testing.assert_allclose(whole(of_coarse)[near], expected[near], atol=0.51)


def test_what_somebody_waits_for_is_rendered_in_fewer_voxels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shown_maps, "VOXELS_FROM_CELLS", 500)
    maps: list[Shown] = [on_voxels(cone(6)), on_cells(cone(12))]
    shown, box, shape = on_one_box(maps, WHOLE)
    of_fine, of_coarse = map(whole, shown)
    assert shape is not None
    assert 250 < math.prod(shape) <= 500
    assert of_coarse.shape == shape
    assert of_fine.shape == tuple(extent.stop - extent.start for extent in box)
    share = (of_coarse >= ISO * 255.0).mean()
    assert share == pytest.approx((cone(12)[box] >= ISO).mean(), rel=0.2)
    assert on_one_box(maps[:1], WHOLE)[2] is None


def test_cells_alone_stay_as_they_are() -> None:
    low = on_cells(cone(12))
    (array,), box, shape = on_one_box([low], WHOLE)
    assert array is low.array
    assert (box, shape) == ((slice(0, 20), slice(0, 16), slice(0, 24)), None)


def test_cells_alone_are_rendered_within_the_budget_where_the_surroundings_are() -> None:
    (array,), box, shape = on_one_box([on_cells(cone(12))], WHOLE, surroundings=True)
    assert array.shape == (10, 8, 12)
    assert (box, shape) == (whole_box(WHOLE), WHOLE)


def test_a_map_that_is_certain_has_no_holes() -> None:
    """The filter that smooths it exceeds 1 beside an edge."""
    certain = np.zeros(WHOLE, dtype=np.float32)
    certain[6:14, 4:12, 8:18] = 1.0
    (_, of_cells), box, _ = on_one_box([on_voxels(cone(6)), on_cells(certain)], WHOLE)
    assert whole(of_cells)[certain[box] > 0.0].min() > 0.4 * 255


def test_a_map_that_reaches_its_iso_value_nowhere_shows_nothing() -> None:
    maps: list[Shown] = [on_voxels(cone(6)), on_cells(np.zeros(WHOLE, dtype=np.float32))]
    (_, nothing), *_ = on_one_box(maps, WHOLE)
    assert whole(nothing).max() == 0


def test_with_surroundings_all_fill_the_volume() -> None:
    fine, low = cone(6), on_cells(cone(12))
    maps: list[Shown] = [on_voxels(fine), low]
    shown, box, shape = on_one_box(maps, WHOLE, surroundings=True)
    of_fine, of_coarse = map(whole, shown)
    assert shape == WHOLE == fine[box].shape
    inside = of_coarse >= ISO * 255.0
    assert inside.mean() == pytest.approx((low.array >= ISO).mean(), rel=0.2)
    np.testing.assert_array_equal(of_fine >= ISO * 255.0, fine >= ISO)
