"""The bilateral solver as published (Barron & Poole 2016), in 3D, with sparse matrices in float64: the baseline.

Written from the paper for comparison, with none of the ways in which `refinement.bilateral_solver` departs from
it: cells are found by sorting, the system is assembled and solved for all cells at once by conjugate gradients with a Jacobi
preconditioner, and voxels read their own cell. It shares nothing with that file but the rule that assigns voxels to cells, so
that both answer the same question.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

SMALLEST_DIAGONAL = 1e-5


class PublishedSolution(NamedTuple):
    """The map, (K, J, I) float64; the iterations done; the cells."""

    map: np.ndarray
    iterations: int
    cells: int


def solve_as_published(
    target: np.ndarray,
    luma: np.ndarray,
    cell_voxels: tuple[int, int, int],
    sigma_luma: float,
    smoothness: float,
    iterations: int = 25,
    tolerance: float = 0.0,
    bistochastisation_steps: int = 10,
) -> PublishedSolution:
    """Minimise the bilateral solver's energy with confidence 1; target and luma (K, J, I), luma in [0, 1]."""
    cells, cell_of_voxel = _cells(luma, cell_voxels, sigma_luma)
    voxels = np.arange(luma.size)
    splat = sp.csr_matrix((np.ones(luma.size), (cell_of_voxel, voxels)), shape=(len(cells), luma.size))
    blur = _blur(cells)
    mass = np.asarray(splat.sum(axis=1)).ravel()
    n = np.ones(len(cells))
    for _ in range(bistochastisation_steps):
        n = np.sqrt(n * mass / (blur @ n))
    laplacian = sp.diags(n * (blur @ n)) - sp.diags(n) @ blur @ sp.diags(n)
    matrix = (smoothness * laplacian + sp.diags(mass)).tocsr()
    right_hand_side = splat @ target.ravel().astype(np.float64)
    values, done = _conjugate_gradients(matrix, right_hand_side, right_hand_side / mass, iterations, tolerance)
    return PublishedSolution((splat.T @ values).reshape(target.shape), done, len(cells))


def _cells(luma: np.ndarray, cell_voxels: tuple[int, int, int], sigma_luma: float) -> tuple[np.ndarray, np.ndarray]:
    """Occupied cells as (n, 4) integers, ascending, and the index of each voxel's cell."""
    shape = [-(-n // edge) for n, edge in zip(luma.shape, cell_voxels, strict=True)] + [int(1.0 / sigma_luma + 0.5) + 1]
    k, j, i = np.ogrid[tuple(slice(n) for n in luma.shape)]
    level = np.floor(luma / sigma_luma + 0.5).astype(np.int64)
    places = (k // cell_voxels[0], j // cell_voxels[1], i // cell_voxels[2], level)
    key = ((places[0] * shape[1] + places[1]) * shape[2] + places[2]) * shape[3] + places[3]
    keys, cell_of_voxel = np.unique(key.ravel(), return_inverse=True)
    return np.stack(np.unravel_index(keys, shape), axis=1), cell_of_voxel


def _blur(cells: np.ndarray) -> sp.csr_matrix:
    """[1 2 1] along each axis, summed over axes."""
    extent = cells.max(axis=0) + 2
    strides = np.append(np.cumprod(extent[::-1])[-2::-1], 1)
    keys = cells @ strides
    blur = sp.diags(np.full(len(cells), 2.0 * cells.shape[1])).tocsr()
    for stride in strides:
        place = np.searchsorted(keys, keys + stride)
        found = np.flatnonzero(keys[np.minimum(place, len(keys) - 1)] == keys + stride)
        after = sp.csr_matrix((np.ones(len(found)), (found, place[found])), shape=blur.shape)
        blur = blur + after + after.T
    return blur


def _conjugate_gradients(
    matrix: sp.csr_matrix, right_hand_side: np.ndarray, start: np.ndarray, iterations: int, tolerance: float
) -> tuple[np.ndarray, int]:
    inverse_diagonal = 1.0 / np.maximum(matrix.diagonal(), SMALLEST_DIAGONAL)
    values = start.copy()
    remainder = right_hand_side - matrix @ values
    direction = scaled = inverse_diagonal * remainder
    energy = remainder @ scaled
    goal = tolerance**2 * (right_hand_side @ (inverse_diagonal * right_hand_side))
    for done in range(iterations):
        if energy <= goal:
            return values, done
        applied = matrix @ direction
        step = energy / (direction @ applied)
        values += step * direction
        remainder -= step * applied
        scaled = inverse_diagonal * remainder
        previous, energy = energy, remainder @ scaled
        direction = scaled + energy / previous * direction
    return values, iterations
