"""The kernel against its formula in double precision, and that with all cells of a grid against that of any places."""

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.features.whitening import unit_vectors
from ViTTransferFunction.Logic.similarity import place_kernel as kernels
from ViTTransferFunction.Logic.similarity.place_kernel import CellKernel, Places, alike, nearness, place_kernel

SHAPE = (5, 4, 6)
SIGMA_MM = 7.0
ROTATION, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
AXES = {
    "along the patient's axes": np.diag([2.0, 3.0, 4.0]),
    "flipped and in another order": np.array([[0.0, 0.0, -4.0], [2.0, 0.0, 0.0], [0.0, -3.0, 0.0]]),
    "oblique": ROTATION @ np.diag([2.0, 3.0, 4.0]),
    "sheared": np.array([[2.0, 0.5, 0.0], [0.0, 3.0, -1.0], [0.0, 0.0, 4.0]]),
}


def random_places(count: int, positions_mm: np.ndarray, seed: int) -> Places:
    rng = np.random.default_rng(seed)
    features = unit_vectors(rng.normal(size=(count, 8))).astype(np.float32)
    return Places(features, (positions_mm / SIGMA_MM).astype(np.float32), rng.random(count, dtype=np.float32))


def formula(a: Places, b: Places) -> np.ndarray:
    cosine = a.features.astype(float) @ b.features.astype(float).T
    cdf = (a.cdf[:, None].astype(float) - b.cdf) / kernels.INTENSITY_SIGMA
    distance = np.linalg.norm(a.positions[:, None].astype(float) - b.positions, axis=2)
    near = 1.0 - kernels.POSITION_WEIGHT + kernels.POSITION_WEIGHT * np.exp(-0.5 * distance**2)
    return np.exp(kernels.FEATURE_SHARPNESS * (cosine - 1.0)) * np.exp(-0.5 * cdf**2) * near


def centred_cells(axes: np.ndarray) -> tuple[Places, Geometry]:
    ijk_to_ras = np.eye(4)
    ijk_to_ras[:3, :3], ijk_to_ras[:3, 3] = axes, (500.0, -3000.0, 20.0)
    geometry = Geometry(SHAPE, ijk_to_ras)
    centres = geometry.voxel_centres_ras()
    return random_places(len(centres), centres - centres.mean(axis=0), 0), geometry


def kernel_with_cells(of_cells: CellKernel, places: Places, cells: int) -> np.ndarray:
    """In rows that lie apart, of which nothing else is written."""
    rows = np.full((len(places.cdf), cells + 2), np.nan, dtype=np.float32)
    of_cells.write(places, rows[:, 1:-1])
    assert np.isnan(rows[:, [0, -1]]).all()
    return rows[:, 1:-1]


def test_it_is_what_its_formula_says():
    a, b = (random_places(count, np.random.default_rng(count).normal(0.0, 10.0, (count, 3)), count) for count in (7, 30))

    np.testing.assert_allclose(place_kernel(a, b), formula(a, b), rtol=1e-5, atol=1e-7)


def test_its_parts_are_what_their_formulas_say():
    a, b = (random_places(count, np.random.default_rng(count).normal(0.0, 10.0, (count, 3)), count) for count in (7, 30))
    sigma = np.linspace(0.1, 3.0, 7)
    apart = np.linalg.norm(a.positions[:, None].astype(float) - b.positions, axis=2)
    together = Places(b.features, np.repeat(a.positions[:1], 30, axis=0), b.cdf)

    np.testing.assert_allclose(nearness(a, b, sigma), np.exp(-0.5 * (apart / sigma[:, None]) ** 2), rtol=1e-4, atol=1e-7)
    np.testing.assert_allclose(alike(a, b)[0], formula(a, together)[0], rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("axes", AXES.values(), ids=AXES)
def test_cells_of_a_grid_are_places_like_any(axes):
    cells, geometry = centred_cells(axes)
    # One of them far outside of the grid.
    places = random_places(3, np.array([[1.0, 2.0, 3.0], [-5.0, 0.0, 4.0], [4000.0, 0.0, 0.0]]), 1)

    found = kernel_with_cells(CellKernel(cells, geometry, SIGMA_MM), places, len(cells.cdf))

    np.testing.assert_allclose(found, formula(places, cells), rtol=1e-5, atol=1e-7)
    near = CellKernel(cells, geometry, SIGMA_MM).nearness(places, 0.4)
    np.testing.assert_allclose(near, nearness(places, cells, np.full(3, 0.4)), rtol=1e-4, atol=1e-7)


def test_axes_at_right_angles_are_known_as_such_however_they_lie():
    at_right_angles = {name: CellKernel(*centred_cells(axes), SIGMA_MM).at_right_angles for name, axes in AXES.items()}

    assert at_right_angles == {name: name != "sheared" for name in AXES}


@pytest.mark.parametrize("pairs_at_once", [1, 13, 60])
def test_parts_make_up_the_whole(monkeypatch, pairs_at_once):
    cells, geometry = centred_cells(AXES["oblique"])
    of_cells, places = CellKernel(cells, geometry, SIGMA_MM), cells.subset(np.array([3, 50]))
    whole = kernel_with_cells(of_cells, places, len(cells.cdf))
    monkeypatch.setattr(kernels, "PAIRS_AT_ONCE", pairs_at_once)

    found = kernel_with_cells(of_cells, places, len(cells.cdf))

    np.testing.assert_allclose(found, whole, rtol=1e-6)


def test_a_place_is_as_like_itself_as_can_be():
    places, _ = centred_cells(AXES["oblique"])

    np.testing.assert_allclose(np.diag(place_kernel(places, places)), 1.0, rtol=1e-6)
