"""The systems of equations of kernel ridge regression."""

from __future__ import annotations

import numpy as np

from ViTTransferFunction.Logic.similarity.ridge_systems import solve_each

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


def test_what_is_no_kernel_is_fitted_all_the_same() -> None:
    """Two places are alike as one, and a third is like the one and hardly like the other."""
    kernel, wanted, ridge = np.array([[1.0, 1.0, 0.9], [1.0, 1.0, 0.3], [0.9, 0.3, 1.0]]), np.array([[1.0], [1.0], [0.0]]), 0.2
    assert np.linalg.eigvalsh(kernel)[0] < -ridge

    weights = solve_each(kernel, np.full(3, ridge), wanted, np.ones((3, 1), dtype=bool))

    assert np.abs(kernel @ weights - wanted).max() < 0.7
