"""Lengths, places and volumes in figures."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ViTTransferFunction.Logic.core.volumes.measures import (
    decimals_of,
    millilitres_text,
    position_decimals,
    round_number,
    two_figures,
)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (64.2, "64"), (9.96, "10"), (9.94, "9.9"), (0.996, "1.0"), (0.031, "0.031"), (2e-5, "0.000020")],
)
def test_what_is_small_has_two_figures_as_well(value: float, text: str) -> None:
    assert two_figures(value) == text


@pytest.mark.parametrize(
    ("volume_ml", "text"),
    [
        (0.0, "0.0 ml"),
        (1512.31, "1512.3 ml"),
        (0.52, "0.52 ml"),
        (0.0142, "0.014 ml"),
        (0.0004, "0.40 mm³"),
        (1.2e-7, "0.00012 mm³"),
    ],
)
def test_volumes_of_small_specimens_are_told_in_cubic_millimetres(volume_ml: float, text: str) -> None:
    assert millilitres_text(volume_ml) == text


@pytest.mark.parametrize(
    ("spacing_mm", "decimals"), [(3.0, 0), (0.5, 0), (0.49, 1), (0.08, 1), (0.02, 2), (0.00499999988, 2), (0.001, 3)]
)
def test_positions_tell_voxels_apart(spacing_mm: float, decimals: int) -> None:
    assert position_decimals(spacing_mm) == decimals


@given(st.floats(1e-6, 1e6))
def test_a_round_number_is_the_largest_that_fits(most: float) -> None:
    found = round_number(most)
    assert found <= most * (1.0 + 1e-12) < 2.5 * found * (1.0 + 1e-9)
    assert f"{found:.0e}"[0] in "125"
    assert float(f"{found:.0e}") == pytest.approx(found)


@pytest.mark.parametrize(("value", "digits"), [(12.5, 3), (0.5, 4), (0.0004, 7), (0.0, 3)])
def test_numbers_in_reports_keep_four_figures(value: float, digits: int) -> None:
    assert decimals_of(value, 4, 3) == digits
