"""The linear system of the bilateral solver: set up over the cells of a grid, and solved.

`bilateral_solver` states the equations, in the same names.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from .bilateral_grid import DIMENSIONS, OccupiedCells

if TYPE_CHECKING:
    from collections.abc import Callable

    import torch
    from torch import Tensor

BISTOCHASTISATION_STEPS = 2
CONFIDENCE_FLOOR = 1e-3
"""Of the largest mean confidence of a cell: a cell with less believes the target's mean this much, so that it has an answer."""
MAX_SMOOTHNESS = 1e4
"""Times the largest mean confidence. Beyond, connected cells are equal to 4 digits, and rounding errors no smaller."""
MAX_FLOAT32_RATIO = 300.0
"""Of λ m to c in any cell. Where more, float32 no longer gives 4 digits, and the system is solved in float64."""


@dataclass(frozen=True, eq=False)
class CellSolution:
    """The value of every cell, and how it was reached.

    Attributes:
        values: (cells,) float32.
        iterations: of conjugate gradients.
        residual: norm of what the equation leaves unsolved, relative to its right-hand side.
        smoothness: λ, at most `MAX_SMOOTHNESS`.
    """

    values: Tensor
    iterations: int
    residual: float
    smoothness: float


def solve_cells(cells: OccupiedCells, smoothness: float, max_iterations: int, tolerance: float) -> CellSolution:
    """Minimise the energy over cells, one of which at least has confidence."""
    import torch

    precise = _accumulation_dtype(cells.mass.device)
    largest_confidence = float((cells.confidence / cells.mass).max())
    smoothness = min(smoothness, MAX_SMOOTHNESS * largest_confidence)
    confidence = torch.maximum(cells.confidence, CONFIDENCE_FLOOR * largest_confidence * cells.mass)
    mean = cells.weighted_target.sum(dtype=precise) / cells.confidence.sum(dtype=precise)
    hard = bool((smoothness * cells.mass > MAX_FLOAT32_RATIO * confidence).any())
    dtype = precise if hard else torch.float32
    mass, confidence = cells.mass.to(dtype), confidence.to(dtype)
    # Solved for the deviation from the mean: rounding errors are relative to what is left.
    weighted_target = (cells.weighted_target - mean * cells.confidence).to(dtype)

    target_range = torch.aminmax(weighted_target / confidence)

    n, neighbour_mass = _bistochastised(cells, mass)
    scale = neighbour_mass.mul_(smoothness).add_(confidence).sqrt_()
    coupling = n.mul_(smoothness**0.5).div_(scale)
    solution, iterations, residual = _solve_by_colour(cells, coupling, weighted_target.div_(scale), max_iterations, tolerance)
    # The exact solution keeps to the range of its target; an inexact one is made to.
    deviations = solution.div_(scale).clamp_(*target_range)
    return CellSolution(deviations.add_(mean).to(torch.float32), iterations, residual, smoothness)


def _accumulation_dtype(device: torch.device) -> torch.dtype:
    import torch

    # Apple's GPUs have no float64.
    return torch.float32 if device.type == "mps" else torch.float64


def _bistochastised(cells: OccupiedCells, mass: Tensor) -> tuple[Tensor, Tensor]:
    """n, such that n · B n is nearly the mass; and n · N n, what the neighbours have of it."""
    import torch

    n = torch.zeros(len(mass) + 1, dtype=mass.dtype, device=mass.device)
    # Exact where a cell and its neighbours hold equally many voxels.
    n[:-1] = (mass / (4 * DIMENSIONS)).sqrt_()
    for _ in range(BISTOCHASTISATION_STEPS):
        blurred = cells.neighbour_sum(n).add_(n[:-1], alpha=2 * DIMENSIONS)
        n[:-1].mul_(mass).div_(blurred).sqrt_()
    return n[:-1], n[:-1] * cells.neighbour_sum(n)


def _solve_by_colour(
    cells: OccupiedCells, coupling: Tensor, right_hand_side: Tensor, max_iterations: int, tolerance: float
) -> tuple[Tensor, int, float]:
    """Solve (1 − E) z = f, E = Dg N Dg: conjugate gradients for the red cells, from which the black ones follow."""
    import torch

    red, black = slice(0, cells.red_cells), slice(cells.red_cells, len(coupling))
    work = torch.zeros(len(coupling) + 1, dtype=coupling.dtype, device=coupling.device)
    black_coupling_squared = coupling[black] ** 2

    def without_detour(z: Tensor) -> Tensor:
        """(1 − E_rb E_br) z."""
        torch.mul(coupling[red], z, out=work[red])
        torch.mul(black_coupling_squared, cells.neighbour_sum(work, black), out=work[black])
        return z - coupling[red] * cells.neighbour_sum(work, red)

    work[black] = coupling[black] * right_hand_side[black]
    reduced = right_hand_side[red] + coupling[red] * cells.neighbour_sum(work, red)
    z_red, iterations, residual = _conjugate_gradients(without_detour, reduced, max_iterations, tolerance)
    work[red] = coupling[red] * z_red
    z_black = right_hand_side[black] + coupling[black] * cells.neighbour_sum(work, black)
    return torch.cat([z_red, z_black]), iterations, residual


def _conjugate_gradients(
    apply: Callable[[Tensor], Tensor], right_hand_side: Tensor, max_iterations: int, tolerance: float
) -> tuple[Tensor, int, float]:
    """Solve a symmetric positive definite system; return the solution, the iterations done and the relative residual."""
    import torch

    solution = torch.zeros_like(right_hand_side)
    remainder = right_hand_side.clone()
    direction = right_hand_side.clone()
    squared = _dot(remainder, remainder)
    goal = tolerance**2 * squared
    iterations = 0
    while squared > goal and iterations < max_iterations:
        applied = apply(direction)
        curvature = _dot(direction, applied)
        # Positive by construction; rounding can end that only where nothing is left to gain.
        if not curvature > 0.0:
            break
        step = squared / curvature
        solution.add_(direction, alpha=step)
        remainder.sub_(applied, alpha=step)
        previous, squared = squared, _dot(remainder, remainder)
        direction.mul_(squared / previous).add_(remainder)
        iterations += 1
    return solution, iterations, (squared * tolerance**2 / goal) ** 0.5 if goal > 0.0 else 0.0


def _dot(a: Tensor, b: Tensor) -> float:
    return float((a * b).sum(dtype=_accumulation_dtype(a.device)))
