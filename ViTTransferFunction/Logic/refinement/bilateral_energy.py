"""The energy of the bilateral solver, as a linear system over the cells of a grid, and its minimum.

The solution is the map x over the voxels of a volume that minimises

    λ/2 · Σ_ij W_ij (x_i − x_j)²  +  Σ_i c_i (x_i − t_i)²,

where t is the target (the map to be refined), c ≥ 0 its confidence, and W the bistochastised bilateral affinity, which is large
between voxels near each other in space and in intensity, and whose rows sum to 1 (Barron & Poole 2016, Eq. 1–3).

**Grid.** W is approximated by Sᵀ Dm⁻¹ Dn B Dn Dm⁻¹ S: S sums voxels over the cells of a bilateral grid, Dm holds the voxels m
of each cell, and B blurs the grid with [1 2 1] along each axis, summed over axes (Barron et al. 2015). All voxels of a
cell share one value y, so that the minimum solves (λ (Dm − Dn B Dn) + diag(S c)) y = S (c t), with one unknown for each
occupied cell. Slicing gives each voxel the multilinear mean of the cells around it, since with the value of its own cell
alone the cells would be visible as blocks.

**Bistochastisation.** Dn should satisfy n · B n = m, which n ← √(n m / B n) iterates to. One step brings n close; then m is
*set* to n · B n. This makes Dm − Dn B Dn the Laplacian of a graph whatever the number of steps, so that constant maps have no
smoothness cost.

**Reduction.** B = 8 I + N, where N sums a cell's 8 neighbours. The 8 I cancels between Dm and Dn B Dn (analytically, without
rounding errors), which leaves (D − λ Dn N Dn) y = S (c t) with the diagonal D = λ n · N n + S c. Scaled symmetrically by D^-½
(Jacobi), with z = D^½ y and f = D^-½ S (c t), it is (1 − E) z = f, where E = Dg N Dg and g = n √(λ / D). Neighbours have
different colours, as on a chessboard, so that E maps red cells to black ones and vice versa. Eliminating the black ones leaves
(1 − E_rb E_br) z_r = f_r + E_rb f_b for the red ones. This system is symmetric and positive definite, and conjugate gradients
solve it in half of the iterations, each on half of the cells. Their residual is added to z_r at the end: since the eigenvalues
lie in (0, 1], this reduces the remaining error.

References:
    Barron, Adams, Shih, Hernández: Fast bilateral-space stereo for synthetic defocus. CVPR 2015.
    Barron, Poole: The fast bilateral solver. ECCV 2016.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .bilateral_grid import DIMENSIONS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import torch
    from torch import Tensor

    from .bilateral_cells import OccupiedCells
    from .workers import Workers

BISTOCHASTISATION_STEPS = 1
"""Each costs as much as an iteration. After one, the benchmark's map is within an RMS of 5e-5 of that of complete
bistochastisation."""
CONFIDENCE_FLOOR = 1e-3
"""As a share of the largest mean confidence of a cell. A cell with less gets the rest as confidence in the mean of all targets,
so that its value is determined."""
MAX_SMOOTHNESS = 1e4
"""As a multiple of the largest mean confidence. Beyond, connected cells are equal to 4 digits, and rounding errors as large."""
MAX_FLOAT32_RATIO = 300.0
"""Largest ratio of λ m to c in a cell for float32. Beyond, it no longer gives 4 digits, and the system is solved in float64."""
CHUNK_CELLS = 2**16
"""Number of cells whose neighbours are summed at a time, so that the values that are read stay in the processor's cache."""


@dataclass(frozen=True, eq=False)
class CellSolution:
    """The value of every cell, and how it was computed.

    Attributes:
        values: (cells,) float32.
        iterations: number of iterations of conjugate gradients.
        residual: norm of the residual of conjugate gradients, relative to the right-hand side.
        smoothness: λ that was used, which is limited by `MAX_SMOOTHNESS`.
    """

    values: Tensor
    iterations: int
    residual: float
    smoothness: float


def solve_cells(
    cells: OccupiedCells, smoothness: float, max_iterations: int, tolerance: float, workers: Workers
) -> CellSolution:
    """Minimise the energy over cells, at least one of which has confidence."""
    import torch

    lowest, highest = (float(c) for c in torch.aminmax(cells.confidence / cells.mass))
    smoothness = min(smoothness, MAX_SMOOTHNESS * highest)
    floor = CONFIDENCE_FLOOR * highest
    dtype = torch.float32
    if smoothness > MAX_FLOAT32_RATIO * max(lowest, floor):
        dtype = _float64_if_any(cells.mass.device)
    mean = cells.weighted_target.sum(dtype=dtype) / cells.confidence.sum(dtype=dtype)
    mass, confidence = cells.mass.to(dtype), cells.confidence.to(dtype)
    # Solved for the deviation from the mean, to which rounding errors are then relative.
    weighted_target = cells.weighted_target - mean * confidence
    if lowest < floor:
        confidence = torch.maximum(confidence, floor * mass)
    lowest_target, highest_target = (float(t) for t in torch.aminmax(weighted_target / confidence))

    graph = _Graph(cells, workers)
    n = _bistochastised(graph, mass)
    scale, coupling, right_hand_side = (torch.empty_like(mass) for _ in range(3))

    def set_up(chunk: slice, neighbour_sum: Tensor) -> None:
        diagonal = torch.addcmul(confidence[chunk], n[chunk], neighbour_sum, value=smoothness)
        torch.sqrt(diagonal, out=scale[chunk])
        torch.div(n[chunk] * smoothness**0.5, scale[chunk], out=coupling[chunk])
        torch.div(weighted_target[chunk], scale[chunk], out=right_hand_side[chunk])

    graph.each_sum(n, graph.all, set_up)
    solution, iterations, residual = _solve_by_colour(graph, coupling, right_hand_side, max_iterations, tolerance)
    # The exact solution stays within the range of the target; an inexact one is clamped to it.
    deviations = solution.div_(scale).clamp_(lowest_target, highest_target)
    return CellSolution(deviations.add_(mean).to(torch.float32), iterations, residual, smoothness)


def _float64_if_any(device: torch.device) -> torch.dtype:
    import torch

    # Apple's GPUs have no float64.
    return torch.float32 if device.type == "mps" else torch.float64


class _Graph:
    """The occupied cells, with sums over their neighbours that are divided among workers."""

    def __init__(self, cells: OccupiedCells, workers: Workers) -> None:
        self._cells = cells
        self._workers = workers
        self.all = slice(0, len(cells.mass))
        self.red = slice(0, cells.red_cells)
        self.black = slice(cells.red_cells, len(cells.mass))

    def each_sum(self, values: Tensor, of: slice, write: Callable[[slice, Tensor], None]) -> None:
        """Call `write` with each chunk of the cells `of` and the sums of `values` over their neighbours."""

        def run(chunks: Sequence[slice]) -> None:
            for chunk in chunks:
                write(chunk, self._cells.neighbour_sum(values, chunk))

        self._workers.share_out(_chunks(of, self._workers.shares), run)


def _chunks(cells: slice, shares: int) -> list[slice]:
    """Chunks of at most `CHUNK_CELLS`; if more than one is needed, their number is a multiple of the number of shares."""
    count = cells.stop - cells.start
    chunks = max(1, -(-count // CHUNK_CELLS))
    if chunks > 1:
        chunks = -(-chunks // shares) * shares
    ends = [cells.start + count * chunk // chunks for chunk in range(chunks + 1)]
    return [slice(*of_chunk) for of_chunk in itertools.pairwise(ends)]


def _bistochastised(graph: _Graph, mass: Tensor) -> Tensor:
    """n, (cells + 1,), such that n · B n is nearly the mass; the last value is 0, for neighbours that do not exist."""
    from torch.nn.functional import pad

    # Exact if a cell and its neighbours hold the same number of voxels.
    n = pad((mass / (4 * DIMENSIONS)).sqrt_(), (0, 1))
    for _ in range(BISTOCHASTISATION_STEPS):
        n = _balanced(graph, mass, n)
    return n


def _balanced(graph: _Graph, mass: Tensor, n: Tensor) -> Tensor:
    """√(n m / B n), followed by a 0."""
    import torch

    balanced = torch.zeros_like(n)

    def balance(chunk: slice, neighbour_sum: Tensor) -> None:
        blurred = neighbour_sum.add_(n[chunk], alpha=2 * DIMENSIONS)
        torch.sqrt((n[chunk] * mass[chunk]).div_(blurred), out=balanced[chunk])

    graph.each_sum(n, graph.all, balance)
    return balanced


def _solve_by_colour(
    graph: _Graph, coupling: Tensor, right_hand_side: Tensor, max_iterations: int, tolerance: float
) -> tuple[Tensor, int, float]:
    """Solve (1 − E) z = f, E = Dg N Dg, by conjugate gradients for the red cells, from which the black ones follow."""
    import torch

    red, black = graph.red, graph.black
    work = torch.zeros(len(coupling) + 1, dtype=coupling.dtype, device=coupling.device)
    z = torch.empty_like(right_hand_side)
    applied = torch.empty_like(z[red])

    def add_neighbours_to_right_hand_side(chunk: slice, neighbour_sum: Tensor) -> None:
        torch.addcmul(right_hand_side[chunk], coupling[chunk], neighbour_sum, out=z[chunk])

    def pass_through_black(chunk: slice, neighbour_sum: Tensor) -> None:
        torch.mul(neighbour_sum.mul_(coupling[chunk]), coupling[chunk], out=work[chunk])

    def without_detour(z_red: Tensor) -> Tensor:
        """(1 − E_rb E_br) z."""

        def leave_what_comes_back(chunk: slice, neighbour_sum: Tensor) -> None:
            torch.sub(z_red[chunk], neighbour_sum.mul_(coupling[chunk]), out=applied[chunk])

        torch.mul(coupling[red], z_red, out=work[red])
        graph.each_sum(work, black, pass_through_black)
        graph.each_sum(work, red, leave_what_comes_back)
        return applied

    torch.mul(coupling[black], right_hand_side[black], out=work[black])
    graph.each_sum(work, red, add_neighbours_to_right_hand_side)
    z[red], iterations, residual = _conjugate_gradients(without_detour, z[red], max_iterations, tolerance)
    torch.mul(coupling[red], z[red], out=work[red])
    graph.each_sum(work, black, add_neighbours_to_right_hand_side)
    return z, iterations, residual


def _conjugate_gradients(
    apply: Callable[[Tensor], Tensor], right_hand_side: Tensor, max_iterations: int, tolerance: float
) -> tuple[Tensor, int, float]:
    """Solve a symmetric system with eigenvalues in (0, 1]; return the solution, the iterations and the relative residual.

    At the end, the residual is added to the solution, which is a step of Richardson's iteration: it reduces every component of
    the error, and costs nothing, since the residual after it is not needed. The returned residual is that before the step.
    """
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
        # Positive by construction; rounding errors can change this only when the solution cannot be improved any more.
        if not curvature > 0.0:
            break
        step = squared / curvature
        solution.add_(direction, alpha=step)
        remainder.sub_(applied, alpha=step)
        previous, squared = squared, _dot(remainder, remainder)
        torch.add(remainder, direction, alpha=squared / previous, out=direction)
        iterations += 1
    else:
        solution.add_(remainder)
    return solution, iterations, (squared * tolerance**2 / goal) ** 0.5 if goal > 0.0 else 0.0


def _dot(a: Tensor, b: Tensor) -> float:
    return float(a @ b)
