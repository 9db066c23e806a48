"""What the bilateral solver is tested with: small inputs, and its energy as a dense system in float64."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import torch

from Benchmarks.solver.nearest_slice import nearest_slicing
from ViTTransferFunction.Logic.refinement.bilateral_energy import (
    BISTOCHASTISATION_STEPS,
    CONFIDENCE_FLOOR,
    MAX_SMOOTHNESS,
)
from ViTTransferFunction.Logic.refinement.bilateral_solver import (
    BilateralSolution,
    BilateralSolverSettings,
    refine_map,
    solve_bilateral,
)

UNIT_SPACING = (1.0, 1.0, 1.0)

solve_by_cell = nearest_slicing()(solve_bilateral)
"""`solve_bilateral`, but each voxel has the value of its own cell: what the energy is about, before cells are interpolated."""
refine_by_cell = nearest_slicing()(refine_map)
"""`refine_map` in the same way."""
with_either_slice = pytest.mark.parametrize("solve", [solve_by_cell, solve_bilateral], ids=["own cell", "multilinear"])
"""Gives a test the solver in both ways."""


def some_settings(**changes) -> BilateralSolverSettings:
    exact = {"sigma_spatial_mm": 3.0, "sigma_luma": 0.1, "smoothness": 8.0, "max_iterations": 2000, "tolerance": 1e-6}
    return BilateralSolverSettings(**{**exact, **changes})


def a_noisy_step(shape=(8, 9, 10), seed=0):
    """A target that is blurred and noisy, and a luma that steps where the target should."""
    generator = torch.Generator().manual_seed(seed)
    along = torch.arange(shape[2]).expand(shape)
    luma = torch.where(along < shape[2] // 2, 0.3, 0.7) + 0.05 * torch.randn(shape, generator=generator)
    target = torch.sigmoid(along - shape[2] / 2.0) + 0.1 * torch.randn(shape, generator=generator)
    return target.clamp(0, 1), luma.clamp(0, 1)


@dataclass(frozen=True, eq=False)
class DenseSystem:
    """The energy's minimum as one equation, matrix · y = right-hand side, in float64.

    Attributes:
        cells: (N, 4) where each occupied cell lies in the grid.
        of_voxel: (voxels,) index of each voxel's cell.
        matrix: (N, N).
        right_hand_side: (N,).
    """

    cells: np.ndarray
    of_voxel: np.ndarray
    matrix: np.ndarray
    right_hand_side: np.ndarray

    @property
    def values(self) -> np.ndarray:
        """(N,) the solution."""
        return np.linalg.solve(self.matrix, self.right_hand_side)


def dense_system(target, luma, confidence, cell_voxels, options) -> DenseSystem:
    """Set the system up from its definition."""
    target, luma, confidence = (np.asarray(a, np.float64) for a in (target, luma, confidence))
    cells = [np.indices(target.shape)[axis] // cell_voxels[axis] for axis in range(3)]
    cells.append(np.floor(np.clip(luma, 0, 1) / options.sigma_luma + 0.5).astype(int))
    occupied, of_voxel = np.unique(np.stack([c.ravel() for c in cells], 1), axis=0, return_inverse=True)
    of_voxel = of_voxel.ravel()
    count = len(occupied)
    distance = np.abs(occupied[:, None] - occupied[None]).sum(2)
    blur = 8.0 * (distance == 0) + (distance == 1)
    mass = np.bincount(of_voxel, minlength=count).astype(float)
    n = np.sqrt(mass / 16)
    for _ in range(BISTOCHASTISATION_STEPS):
        n = np.sqrt(n * mass / (blur @ n))
    laplacian = np.diag(n * (blur @ n)) - n[:, None] * blur * n
    c = np.bincount(of_voxel, confidence.ravel(), count)
    mean = (confidence * target).sum() / confidence.sum()
    floored = np.maximum(c, CONFIDENCE_FLOOR * (c / mass).max() * mass)
    ct = np.bincount(of_voxel, (confidence * target).ravel(), count) + (floored - c) * mean
    smoothness = min(options.smoothness, MAX_SMOOTHNESS * (c / mass).max())
    return DenseSystem(occupied, of_voxel, smoothness * laplacian + np.diag(floored), ct)


def dense_map(target, luma, confidence, solution: BilateralSolution, options):
    """The map that minimises the energy."""
    system = dense_system(target, luma, confidence, solution.cell_voxels, options)
    return system.values[system.of_voxel].reshape(target.shape)


def dense_residual(target, luma, confidence, solution: BilateralSolution, options) -> float:
    """What a map leaves of the red cells' equation, relative to its right-hand side (*Reduction* of `bilateral_energy`)."""
    system = dense_system(target, luma, confidence, solution.cell_voxels, options)
    mean = float((confidence * target).sum() / confidence.sum())
    scale = np.sqrt(np.diag(system.matrix))
    scaled = system.matrix / scale[:, None] / scale
    f = (system.right_hand_side - system.matrix @ np.full(len(scale), mean)) / scale
    values = np.empty(len(scale))
    values[system.of_voxel] = solution.map.numpy().ravel()
    z = scale * (values - mean)
    red = system.cells.sum(axis=1) % 2 == 0
    across = -scaled[red][:, ~red]
    right_hand_side = f[red] + across @ f[~red]
    left = right_hand_side - (z[red] - across @ (across.T @ z[red]))
    return float(np.linalg.norm(left) / np.linalg.norm(right_hand_side))
