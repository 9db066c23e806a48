"""Thumbnails: the same scan is known by them, whatever became of its file, and another one is not taken for it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, zoom

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.thumbnail import Thumbnail

SHAPE = (40, 60, 50)
GEOMETRY = Geometry(SHAPE, np.array([[0.6, -0.96, 0.0, 11.0], [0.48, 0.36, -2.4, -7.0], [0.64, 0.48, 1.8, 40.0], [0, 0, 0, 1]]))
"""Oblique."""


def patient(seed: int) -> np.ndarray:
    """A body of organs of different brightness that lie elsewhere in each, in air, as int16."""
    organs = gaussian_filter(np.random.default_rng(seed).normal(size=SHAPE), 5.0)
    k, j, i = (np.linspace(-1.0, 1.0, count) for count in SHAPE)
    inside = k[:, None, None] ** 2 + j[:, None] ** 2 + i**2 < 0.9
    values: np.ndarray = np.where(inside, 300.0 * organs / organs.std(), -400.0).astype(np.int16)
    return values


A, B = patient(1), patient(2)


def is_known(array: np.ndarray, geometry: Geometry = GEOMETRY) -> bool:
    """Whether a scan is taken for A, by a thumbnail that was text meanwhile."""
    thumbnail = Thumbnail.from_text(Thumbnail.of(A, GEOMETRY).to_text())
    assert thumbnail is not None
    return thumbnail.may_be_of(array, geometry)


def test_another_patients_scan_on_the_same_grid_is_not_taken_for_it() -> None:
    assert is_known(A)
    assert not is_known(B)
    assert not is_known(np.flip(A, 2))


def test_a_scan_that_lies_elsewhere_is_not_taken_for_it() -> None:
    moved = GEOMETRY.ijk_to_ras.copy()
    moved[:3, 3] += 12.0
    assert not is_known(A, Geometry(SHAPE, moved))


@pytest.mark.parametrize(
    "stored",
    [
        lambda array: array.astype(np.float64),
        lambda array: array.astype(">i2"),
        lambda array: (array + 1024).astype(np.uint16),
        lambda array: (0.001 * array).astype(np.float32),
    ],
)
def test_other_numbers_for_the_same_intensities_change_nothing(stored: Callable[[np.ndarray], np.ndarray]) -> None:
    assert is_known(stored(A))


def test_the_order_of_the_voxels_changes_nothing() -> None:
    turned = GEOMETRY.ijk_to_ras.copy()
    turned[:, 3] += turned[:, 2] * (SHAPE[0] - 1)
    turned[:, 2] *= -1.0
    assert is_known(A[::-1], Geometry(SHAPE, turned))
    exchanged = GEOMETRY.ijk_to_ras[:, [1, 0, 2, 3]]
    assert is_known(A.transpose(0, 2, 1), Geometry((40, 50, 60), exchanged))


def test_filters_change_nothing() -> None:
    assert is_known(gaussian_filter(A, 1.0))
    assert is_known(A + np.random.default_rng(0).normal(0.0, 150.0, SHAPE))
    assert is_known(np.clip(A, -500, 500))


def test_what_was_cropped_or_resampled_is_known_by_what_is_left_and_not_taken_for_a_part_of_another() -> None:
    half = slice(8, 36), slice(10, 50), slice(5, 45)
    assert is_known(A[half], GEOMETRY.part(half))
    assert not is_known(B[half], GEOMETRY.part(half))
    finer = zoom(A.astype(np.float32), 1.5, order=1)
    assert is_known(finer, GEOMETRY.resized(finer.shape))


def test_where_scans_have_too_little_in_common_nothing_is_said() -> None:
    corner = slice(0, 10), slice(0, 12), slice(0, 12)
    assert is_known(B[corner], GEOMETRY.part(corner))
    assert is_known(np.zeros(SHAPE))
    assert Thumbnail.of(np.zeros(SHAPE), GEOMETRY).may_be_of(A, GEOMETRY)


def test_a_place_that_no_scan_has_does_no_harm() -> None:
    thumbnail = Thumbnail.of(A, GEOMETRY)
    for scale in (1e-15, 1e8):
        grid = thumbnail.geometry.ijk_to_ras @ np.diag([scale, scale, scale, 1.0])
        odd = Thumbnail.from_text(Thumbnail(thumbnail.cells, Geometry(thumbnail.cells.shape, grid)).to_text())
        small = Geometry(SHAPE, np.diag([1e-12, 1e-12, 1e-12, 1.0]))
        with np.errstate(all="raise"):
            assert odd is not None
            assert odd.may_be_of(A, small)


def test_what_has_no_intensity_is_left_out() -> None:
    masked = A.astype(np.float64)
    masked[20:30], masked[:3, :5], masked[30, :4] = np.nan, np.inf, 1e200
    assert is_known(masked)
    assert Thumbnail.of(masked, GEOMETRY).may_be_of(A, GEOMETRY)
    assert not Thumbnail.of(masked, GEOMETRY).may_be_of(B, GEOMETRY)
    nothing = np.full(SHAPE, np.nan)
    assert is_known(nothing)
    assert not Thumbnail.of(nothing, GEOMETRY).cells.any()


def test_a_scan_of_few_slices_has_one() -> None:
    thin = slice(0, 3), slice(0, 60), slice(0, 50)
    thumbnail = Thumbnail.of(A[20:23], GEOMETRY.part(thin))
    assert thumbnail.may_be_of(A[20:23], GEOMETRY.part(thin))
    assert not thumbnail.may_be_of(B[20:23], GEOMETRY.part(thin))


def test_other_texts_are_no_thumbnails() -> None:
    text = Thumbnail.of(A, GEOMETRY).to_text()
    place, cells = text.split(" ")
    flat = ",".join(["0"] * 12)
    far = ",".join(["1e300", *place.split(",")[1:]])
    unusable = ["", "x", place, cells, f"{place} {cells[4:]}", f"{flat} {cells}", f"nan{place} {cells}", f"{place} ü{cells}"]
    for wrong in [*unusable, f"{far} {cells}", f"{place} {cells} "]:
        assert Thumbnail.from_text(wrong) is None
