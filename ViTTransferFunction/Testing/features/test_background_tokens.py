"""Air that a few patches stand for."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import ndimage

from ViTTransferFunction.Logic.core.volumes.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.features.background_tokens import BACKGROUND_LEVEL, background_cells, select_tokens

WINDOW = IntensityWindow(0.0, 1.0)


@given(hnp.arrays(bool, st.tuples(st.integers(1, 20), st.integers(1, 20))))
def test_every_patch_is_stood_for_by_one_of_its_kind_and_all_are_counted(air: np.ndarray) -> None:
    chosen = select_tokens(air)
    assert chosen.multiplicity.sum() == air.size
    assert (chosen.multiplicity >= 1).all()
    assert (air.ravel()[chosen.places[chosen.representative]] == air.ravel()).all()


@given(hnp.arrays(bool, st.tuples(st.integers(1, 20), st.integers(1, 20))))
def test_a_patch_that_is_not_air_stands_for_itself_alone(air: np.ndarray) -> None:
    chosen = select_tokens(air)
    body = np.flatnonzero(~air)
    np.testing.assert_array_equal(chosen.places[chosen.representative[body]], body)
    np.testing.assert_array_equal(chosen.multiplicity[chosen.representative[body]], 1)


def test_one_patch_in_sixteen_stands_for_air() -> None:
    assert len(select_tokens(np.ones((16, 32), dtype=bool)).places) == 16 * 32 // 16


def test_without_air_every_patch_is_run() -> None:
    chosen = select_tokens(np.zeros((5, 6), dtype=bool))
    np.testing.assert_array_equal(chosen.places, np.arange(30))


def body_in_air() -> np.ndarray:
    """A bright block with a dark hole, in the dark."""
    array = np.full((16, 16, 16), 0.05, dtype=np.float32)
    array[4:12, 4:12, 4:12] = 0.8
    array[6:10, 6:10, 6:10] = 0.05
    return array


def test_air_surrounds_the_body_and_is_not_inside_it() -> None:
    air = background_cells(body_in_air(), WINDOW, (8, 8, 8))
    expected = np.ones((8, 8, 8), dtype=bool)
    expected[2:6, 2:6, 2:6] = False
    np.testing.assert_array_equal(air, expected)


def test_a_cell_that_holds_one_bright_voxel_is_not_air() -> None:
    array = body_in_air()
    array[0, 0, 1] = 0.5
    assert not background_cells(array, WINDOW, (8, 8, 8))[0, 0, 0]


def test_what_is_dark_depends_on_the_window() -> None:
    array = np.full((8, 8, 8), 0.3, dtype=np.float32)
    assert background_cells(array, IntensityWindow(0.25, 1.0), (4, 4, 4)).all()
    assert not background_cells(array, WINDOW, (4, 4, 4)).any()


def test_bright_surroundings_hold_no_air() -> None:
    assert not background_cells(1.0 - body_in_air(), WINDOW, (8, 8, 8)).any()


def test_voxels_that_are_not_finite_count_as_dark() -> None:
    array = body_in_air()
    array[0, 0, 0] = np.nan
    assert background_cells(array, WINDOW, (8, 8, 8))[0, 0, 0]


@given(hnp.arrays(np.float32, (5, 6, 7), elements=st.sampled_from([-1e30, -1.0, 0.0, 0.1, 0.16, 3.0, np.nan, np.inf, -np.inf])))
def test_background_is_where_no_voxel_is_bright_also_beside_voxels_that_are_no_numbers(
    array: np.ndarray,
) -> None:
    bright = WINDOW.apply(array) > BACKGROUND_LEVEL
    # One cell a voxel; of the dark ones, those that reach the border.
    components, _ = ndimage.label(~bright)
    inner = components.copy()
    inner[1:-1, 1:-1, 1:-1] = 0
    expected = np.isin(components, np.setdiff1d(inner, [0]))
    np.testing.assert_array_equal(background_cells(array, WINDOW, array.shape), expected)
    # And of two, one of which is none.
    beside_nan = np.stack([array, np.full_like(array, np.nan)], axis=1).reshape(10, 6, 7)
    np.testing.assert_array_equal(background_cells(beside_nan, WINDOW, array.shape), expected)
