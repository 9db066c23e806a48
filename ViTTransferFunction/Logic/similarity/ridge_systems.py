"""The systems of equations of kernel ridge regression, (K + Λ) α = Y, one for each set of places that a class sees."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular

from ..core.system.progress import Between, nothing_between

LEAST_SHARE_OF_RIDGE = 0.5
"""Of the smallest entry of Λ: how far a system's eigenvalues have to be above 0. Of a kernel they are above all of it."""
SYSTEMS_ALONE = 20
"""Up to so many are solved each by itself. Those of a hundred classes, of 5 positive and 3 negative points each, take 1.7 s
of processor time so, several times at each click, and 0.07 s together."""


def solve_each(
    kernel: np.ndarray, ridge: np.ndarray, wanted: np.ndarray, seen: np.ndarray, between: Between = nothing_between
) -> np.ndarray:
    """(K + Λ)⁻¹ Y, for every class over the places that it sees.

    Args:
        kernel: K between N places, (N, N) float64, symmetric; about positive semidefinite, see `_definite`.
        ridge: the diagonal of Λ, (N,), above 0.
        wanted: Y, (N, classes); what is not seen may be anything.
        seen: (N, classes) bool.
        between: called before each system.

    Returns:
        (N, classes); 0 at places that are not seen.
    """
    weights = np.zeros_like(wanted)
    classes_of_pattern: dict[bytes, list[int]] = {}
    for index, rows in enumerate(seen.T):
        classes_of_pattern.setdefault(rows.tobytes(), []).append(index)
    # Classes without negative points of their own all see the same places, and share one factorisation.
    systems = [np.array(numbers) for numbers in classes_of_pattern.values()]
    if len(systems) > SYSTEMS_ALONE and seen.all(axis=1).any():
        systems = _eliminate(kernel, ridge, wanted, seen, systems, weights, between)
    for classes in systems:
        between()
        rows = seen[:, classes[0]]
        system = _definite(kernel[np.ix_(rows, rows)] + np.diag(ridge[rows]), float(ridge.min()))
        weights[np.ix_(rows, classes)] = np.linalg.solve(system, wanted[np.ix_(rows, classes)])
    return weights


def _eliminate(
    kernel: np.ndarray,
    ridge: np.ndarray,
    wanted: np.ndarray,
    seen: np.ndarray,
    systems: list[np.ndarray],
    weights: np.ndarray,
    between: Between,
) -> list[np.ndarray]:
    """Solve systems by block elimination: what all classes see is eliminated once, so that their own places alone are left.

    The solutions of `systems`, which has the classes of each, are written to `weights`. Returns those that are left to solve,
    since `_definite` would change them. For the other arguments see `solve_each`.
    """
    shared = seen.all(axis=1)
    others = ~shared
    system = kernel + np.diag(ridge)
    of_shared, across, of_others = (system[np.ix_(*part)] for part in ((shared, shared), (shared, others), (others, others)))
    least = LEAST_SHARE_OF_RIDGE * float(ridge.min())
    try:
        lower_of_least = np.linalg.cholesky(of_shared - least * np.eye(len(of_shared)))
    except np.linalg.LinAlgError:
        return systems
    between()
    lower = np.linalg.cholesky(of_shared)
    half_of_least, half = (solve_triangular(each, across, lower=True) for each in (lower_of_least, lower))
    left_of_least = of_others - least * np.eye(len(of_others)) - half_of_least.T @ half_of_least
    left = of_others - half.T @ half
    half_wanted = solve_triangular(lower, wanted[shared], lower=True)
    left_wanted = wanted[others] - half.T @ half_wanted
    not_solved = []
    for classes in systems:
        between()
        own = seen[others, classes[0]]
        if not _is_positive_definite(left_of_least[np.ix_(own, own)]):
            not_solved.append(classes)
            continue
        of_own = np.linalg.solve(left[np.ix_(own, own)], left_wanted[np.ix_(own, classes)])
        half_wanted[:, classes] -= half[:, own] @ of_own
        rows = np.flatnonzero(others)[own]
        weights[np.ix_(rows, classes)] = of_own
        weights[np.ix_(shared, classes)] = solve_triangular(lower.T, half_wanted[:, classes])
    return not_solved


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
