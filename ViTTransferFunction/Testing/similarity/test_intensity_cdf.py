"""What share of a volume's voxels is darker, around cells and around points."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.orientation import Orientation
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.similarity.intensity_cdf import IntensityCdf
from ViTTransferFunction.Testing.support.volumes import stored_as, volume_of

OBLIQUE = np.array([[0.9, -0.3, 0.1, 4.0], [0.2, 1.1, 0.0, -7.0], [0.0, 0.4, 2.5, 30.0], [0.0, 0.0, 0.0, 1.0]])

MIRRORED = Orientation((0, 1, 2), (True, False, True))


@pytest.mark.parametrize("cells", [(4, 5, 4), (21, 16, 13), (1, 1, 1), (30, 20, 14)], ids=str)
@pytest.mark.parametrize("holes", [False, True])
def test_around_all_cells_of_a_grid_is_around_each_of_their_centres(cells: tuple[int, int, int], holes: bool) -> None:
    array = np.random.default_rng(0).normal(0.0, 100.0, (21, 16, 13)).astype(np.float32)
    if holes:
        array[3:6, 2:9, 4], array[20, 15, 12] = np.nan, np.inf
    volume = Volume(array, Geometry(array.shape, OBLIQUE))
    cdf, grid = IntensityCdf(volume), volume.geometry.resized(cells)
    np.testing.assert_allclose(cdf.around_cells(grid), cdf.around(grid.voxel_centres_ras(), grid), atol=1e-6)


def test_a_value_that_fills_half_of_the_volume_takes_no_more_room_than_others() -> None:
    array = np.random.default_rng(0).uniform(0.0, 100.0, (20, 16, 12))
    array[:10] = -1000.0
    array[15, 8, 6] = 50.0
    geometry = Geometry(array.shape, OBLIQUE)
    cdf = IntensityCdf(Volume(array, geometry))
    at_air, at_half = cdf.at(geometry.ijk_to_ras_points(np.array([[6.0, 8.0, 2.0], [6.0, 8.0, 15.0]])))
    assert at_air == 0.0
    assert at_half == pytest.approx(0.5, abs=0.05)


def test_where_the_scan_was_masked_nothing_is_darker() -> None:
    array = np.random.default_rng(0).uniform(0.0, 100.0, (8, 8, 8))
    array[2, 3, 4] = np.nan
    geometry = Geometry(array.shape, OBLIQUE)
    masked = geometry.ijk_to_ras_points(np.array([[4.0, 3.0, 2.0]]))
    assert IntensityCdf(Volume(array, geometry)).at(masked).tolist() == [0.0]


@pytest.mark.parametrize("not_measured", [np.nan, np.inf, -np.inf])
def test_beside_a_mask_voxels_count_alike_however_a_scan_is_stored(not_measured: float) -> None:
    """At their centres, where people click: the next voxel would count for nothing, if it were finite."""
    array = np.random.default_rng(0).uniform(0.0, 100.0, (9, 9, 9))
    array[:, :, 5:] = array[:3] = not_measured
    volume = volume_of(array)
    points = volume.geometry.ijk_to_ras_points(np.array([[4.0, 4, 4], [4, 4, 3], [5, 4, 4], [4.3, 4, 4], [2, 4, 3]]))
    cdf, of_mirrored = (IntensityCdf(scan) for scan in (volume, stored_as(volume, MIRRORED)))
    assert cdf.at(points)[0] > 0.0
    np.testing.assert_allclose(of_mirrored.at(points), cdf.at(points), atol=1e-6)
    cells = volume.geometry.resized((4, 4, 4))
    np.testing.assert_allclose(of_mirrored.around(points, cells), cdf.around(points, cells), atol=1e-6)


@pytest.mark.parametrize(("cells", "expected"), [((9, 8, 8), -187.0), ((3, 3, 3), -560.0)], ids=["thin cells", "thick cells"])
def test_a_structure_as_thick_as_a_slice_is_not_averaged_with_the_slices_beside_it(
    cells: tuple[int, int, int], expected: float
) -> None:
    """A nodule in a lung, in one slice of 5 mm: averaged over three of these, it would be as dark as a vessel's rim.

    Only where cells are as thick as three slices is it averaged so, since they hold no more than that of it.
    """
    array = np.random.default_rng(0).uniform(-840.0, 1000.0, (9, 60, 60))
    array[3:6, 24:36, 24:36] = -840.0
    array[4, 24:36, 24:36] = 0.0
    volume = volume_of(array, (0.6, 0.6, 5.0))
    point = volume.geometry.ijk_to_ras_points(np.array([[30.0, 30.0, 4.0]]))
    around = IntensityCdf(volume).around(point, volume.geometry.resized(cells))
    assert around[0] == pytest.approx((expected + 840.0) / 1840.0, abs=0.01)
