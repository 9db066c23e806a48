"""Sizes of a structure as iso values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.classes.iso_proposals import (
    LARGEST_ISO,
    LARGEST_SIZE,
    SMALLEST_ISO,
    SMALLEST_SIZE,
    IsoProposals,
    resized_iso,
)
from ViTTransferFunction.Logic.core.system.errors import InputError

PROPOSALS = IsoProposals(smaller=0.4, chosen=0.2, larger=0.05)
SIZES = st.floats(SMALLEST_SIZE, LARGEST_SIZE)


@pytest.mark.parametrize(("size", "iso"), [(-1.0, 0.4), (0.0, 0.2), (1.0, 0.05), (0.5, 0.1)])
def test_sizes_go_through_the_proposals_in_equal_factors(size: float, iso: float) -> None:
    assert PROPOSALS.at(size) == pytest.approx(iso)


@given(SIZES, SIZES)
def test_a_larger_size_never_has_a_higher_iso_value(one: float, other: float) -> None:
    assert PROPOSALS.at(max(one, other)) <= PROPOSALS.at(min(one, other))


def test_the_largest_size_is_not_everything_nor_the_smallest_nothing() -> None:
    assert PROPOSALS.at(LARGEST_SIZE) == SMALLEST_ISO
    assert PROPOSALS.at(SMALLEST_SIZE) == LARGEST_ISO


@given(st.floats(0.0, 1.0), st.floats(0.0, LARGEST_SIZE))
def test_a_fixed_iso_value_falls_where_the_structure_is_to_be_larger_and_rises_where_smaller(iso: float, steps: float) -> None:
    larger, smaller = resized_iso(iso, steps), resized_iso(iso, -steps)
    assert min(iso, SMALLEST_ISO) <= larger <= iso <= smaller <= max(iso, LARGEST_ISO)


@given(st.floats(0.03, 0.48), st.floats(-1.0, 1.0))
def test_a_step_of_a_fixed_iso_value_is_taken_back_by_the_step_the_other_way(iso: float, steps: float) -> None:
    assert resized_iso(resized_iso(iso, steps), -steps) == pytest.approx(iso)


@pytest.mark.parametrize("size", [3.5, float("nan"), True, "larger"])
def test_a_size_out_of_range_is_refused(size: object) -> None:
    with pytest.raises(InputError, match="from -3 to 3"):
        ClassRequest("a", np.zeros((1, 3)), size=size)  # type: ignore[arg-type]
