"""The systems of equations of kernel ridge regression, (K + Λ) α = Y, one for each set of places that a class sees."""

from __future__ import annotations

import numpy as np

LEAST_SHARE_OF_RIDGE = 0.5
"""Of the smallest entry of Λ: how far a system's eigenvalues have to be above 0. Of a kernel they are above all of it."""


def solve_each(kernel: np.ndarray, ridge: np.ndarray, wanted: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """(K + Λ)⁻¹ Y, for every class over the places that it sees.

    Args:
        kernel: K between N places, (N, N) float64, symmetric; about positive semidefinite, see `_definite`.
        ridge: the diagonal of Λ, (N,), above 0.
        wanted: Y, (N, classes); what is not seen may be anything.
        seen: (N, classes) bool.

    Returns:
        (N, classes); 0 at places that are not seen.
    """
    weights = np.zeros_like(wanted)
    classes_of_pattern: dict[bytes, list[int]] = {}
    for index, rows in enumerate(seen.T):
        classes_of_pattern.setdefault(rows.tobytes(), []).append(index)
    # Classes without negative points of their own all see the same places, and share one factorisation.
    for numbers in classes_of_pattern.values():
        classes = np.array(numbers)
        rows = seen[:, classes[0]]
        system = _definite(kernel[np.ix_(rows, rows)] + np.diag(ridge[rows]), float(ridge.min()))
        weights[np.ix_(rows, classes)] = np.linalg.solve(system, wanted[np.ix_(rows, classes)])
    return weights


def _definite(system: np.ndarray, ridge: float) -> np.ndarray:
    """A system (N, N), with more on its diagonal where it would be indefinite, or nearly so.

    Between annotated points connectedness counts by way of other points, between a point and a random cell by itself
    (`connected_points`): all together that is no kernel. Where a hundred points and more lie in one structure, an eigenvalue
    may fall below 0, and the map is nonsense, at the very points as well.
    """
    diagonal = np.eye(len(system))
    further = 0.0
    while not _is_positive_definite(system + (further - LEAST_SHARE_OF_RIDGE * ridge) * diagonal):
        further = max(2.0 * further, ridge)
    return system + further * diagonal if further else system


def _is_positive_definite(system: np.ndarray) -> bool:
    try:
        np.linalg.cholesky(system)
    except np.linalg.LinAlgError:
        return False
    return True
