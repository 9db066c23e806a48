"""The systems of equations of kernel ridge regression."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.system.errors import Cancelled
from ViTTransferFunction.Logic.similarity import ridge_systems
from ViTTransferFunction.Logic.similarity.ridge_systems import solve_each
from ViTTransferFunction.Testing.support.cancelling import cancel_at_call

RIDGE = 0.05


def test_classes_that_see_different_places_are_solved_each_by_itself() -> None:
    positions = np.random.default_rng(0).normal(size=(9, 2))
    kernel = np.exp(-((positions[:, None] - positions) ** 2).sum(axis=2))
    wanted = np.random.default_rng(1).normal(size=(9, 3))
    seen = np.ones((9, 3), dtype=bool)
    seen[[2, 5], 1] = False

    weights = solve_each(kernel, np.full(9, RIDGE), wanted, seen)

    for index in range(3):
        rows = seen[:, index]
        expected = np.linalg.solve(kernel[np.ix_(rows, rows)] + RIDGE * np.eye(rows.sum()), wanted[rows, index])
        np.testing.assert_allclose(weights[rows, index], expected)
        assert not weights[~rows, index].any()


def many_systems() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Of 30 classes with negative points of their own, two of which share a positive one, and cells that were dropped."""
    rng = np.random.default_rng(0)
    positions = rng.normal(size=(100, 3))
    kernel = np.exp(-((positions[:, None] - positions) ** 2).sum(axis=2))
    seen = np.ones((100, 30), dtype=bool)
    for index in range(30):
        seen[[index, 30 + index]] = np.arange(30) == index
    seen[70, [3, 4]] = False
    seen[90:] = False
    wanted = np.where(seen, rng.normal(size=(100, 30)), np.nan)
    return kernel, rng.uniform(RIDGE, 2.0, 100), wanted, seen


def test_many_systems_together_have_the_solutions_of_each_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel, ridge, wanted, seen = many_systems()
    # Together with the places that all see, this one's own are no kernel.
    kernel[[0, 30], [30, 0]] = kernel[[1, 31], [31, 1]] = 4.0
    together = solve_each(kernel, ridge, wanted, seen)
    monkeypatch.setattr(ridge_systems, "_eliminate", lambda *arguments: arguments[4])
    each = solve_each(kernel, ridge, wanted, seen)
    np.testing.assert_allclose(together, each, rtol=1e-9, atol=1e-12)
    assert not together[~seen].any()
    # What all see is no kernel, either.
    monkeypatch.undo()
    kernel[[80, 81], [81, 80]] = 4.0
    together = solve_each(kernel, ridge, wanted, seen)
    monkeypatch.setattr(ridge_systems, "_eliminate", lambda *arguments: arguments[4])
    np.testing.assert_array_equal(together, solve_each(kernel, ridge, wanted, seen))


@pytest.mark.parametrize("alone", [20, 100])
def test_many_systems_can_be_given_up_in_between(monkeypatch: pytest.MonkeyPatch, alone: int) -> None:
    monkeypatch.setattr(ridge_systems, "SYSTEMS_ALONE", alone)
    with pytest.raises(Cancelled):
        solve_each(*many_systems(), cancel_at_call(10))


def test_few_systems_are_solved_each_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the last bit, as before there were more."""
    monkeypatch.setattr(ridge_systems, "_eliminate", lambda *_: pytest.fail("they are few"))
    kernel, ridge, wanted, seen = many_systems()
    solve_each(kernel, ridge, wanted[:, :20], seen[:, :20])


def test_what_is_no_kernel_is_fitted_all_the_same() -> None:
    """Two places are alike as one, and a third is like the one and hardly like the other."""
    kernel, wanted, ridge = np.array([[1.0, 1.0, 0.9], [1.0, 1.0, 0.3], [0.9, 0.3, 1.0]]), np.array([[1.0], [1.0], [0.0]]), 0.2
    assert np.linalg.eigvalsh(kernel)[0] < -ridge

    weights = solve_each(kernel, np.full(3, ridge), wanted, np.ones((3, 1), dtype=bool))

    assert np.abs(kernel @ weights - wanted).max() < 0.7
