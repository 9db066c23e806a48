"""The bilateral solver in 3D: smooths a map of similarity within structures, but not across their edges in the image.

The map becomes the target of an energy (`bilateral_energy`, with all equations), which is minimised over the cells of a
bilateral grid (`bilateral_grid`). Voxels that are near each other in space and in intensity share a cell. They are summed into
cells (splat, `bilateral_cells`), and the solution is interpolated from the cells back to voxels (slice, `bilateral_slice`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..core.system.errors import InputError
from ..core.system.progress import Between, nothing_between
from ..core.volumes.bounding_box import bounding_box
from ..core.volumes.torch_arrays import array_of
from . import large_arrays
from .bilateral_cells import Target, splat
from .bilateral_energy import MAX_SMOOTHNESS, solve_cells
from .bilateral_grid import GridLayout, VoxelCells
from .bilateral_slice import slice_multilinear
from .upsampling import Upsampling, upsampled
from .workers import Workers

if TYPE_CHECKING:
    from collections.abc import Sequence

    from torch import Tensor

    from ..core.volumes.geometry import Box


@dataclass(frozen=True)
class BilateralSolverSettings:
    """The extent and weight of smoothing, and when iterations stop.

    Attributes:
        sigma_spatial_mm: scale of distances between voxels, millimetres; rounded to whole voxels along each axis.
        sigma_luma: scale of differences in intensity, as a fraction of the intensity window.
        smoothness: λ, the weight of smoothness against agreement with the target.
        max_iterations: largest number of iterations of conjugate gradients, at least 1.
        tolerance: residual, relative to the right-hand side, at which the iteration stops.

    Raises:
        InputError: a value is out of its range.
    """

    sigma_spatial_mm: float = 6.0
    sigma_luma: float = 10.0 / 255.0
    smoothness: float = 32.0
    max_iterations: int = 50
    tolerance: float = 2e-3

    def __post_init__(self) -> None:
        for name in ("sigma_spatial_mm", "sigma_luma", "smoothness", "tolerance"):
            value = getattr(self, name)
            if not value > 0.0 or math.isinf(value):
                raise InputError(f"Bilateral solver: {name} is {value}; expected a finite number above 0.")
        if self.max_iterations < 1:
            raise InputError(f"Bilateral solver: max_iterations is {self.max_iterations}; expected at least 1.")


@dataclass(frozen=True, eq=False)
class BilateralSolution:
    """A refined map, and how it was computed.

    Attributes:
        map: (K, J, I) float32, within the range of the target.
        converged: whether the residual is at most the tolerance; also true if there was nothing to solve.
        iterations: number of iterations of conjugate gradients.
        residual: norm of the residual of conjugate gradients, relative to the right-hand side, in the Jacobi scaling. The
            map is a little more accurate, since this residual is added to the solution.
        cells: number of occupied cells, the unknowns; 0 if there was nothing to solve.
        smoothness: λ that was used, which is limited by `MAX_SMOOTHNESS`.
        cell_voxels: edges of the grid's cells along (K, J, I) in voxels, from rounding `sigma_spatial_mm`.
    """

    map: Tensor
    converged: bool
    iterations: int
    residual: float
    cells: int
    smoothness: float
    cell_voxels: tuple[int, int, int]


def refine_map(
    low_resolution_map: Tensor,
    intensities: Tensor,
    window: tuple[float, float],
    spacing_mm: Sequence[float],
    settings: BilateralSolverSettings | None = None,
    threshold: float | None = None,
    between: Between = nothing_between,
    in_place: bool = False,
    border: tuple[int, int, int] = (0, 0, 0),
) -> BilateralSolution:
    """Refine a coarse map to the resolution and the edges of the volume that it describes.

    Args:
        low_resolution_map: (K', J', I'), of the same box as the volume; values that are not finite are unknown.
        intensities: (K, J, I), any real dtype; voxels that are not finite keep the interpolated map.
        window: lowest and highest intensity; differences beyond these have no effect.
        spacing_mm: of the volume, along (K, J, I).
        settings: None for the default values.
        threshold: solve only near voxels at which the map exceeds this; elsewhere it is interpolated. None solves everywhere.
        between: called between short steps; may raise `Cancelled`.
        in_place: write the solution into the map, which must be finite and have the volume's resolution.
        border: index (K, J, I) of a voxel with which a cell of the grid begins along each axis.

    Raises:
        InputError: a shape, the spacing or the window is invalid, or no voxel of the map is finite.
        Cancelled: by `between`.
    """
    _check_volume("low-resolution map", low_resolution_map)
    _check_volume("volume", intensities)
    settings = settings or BilateralSolverSettings()
    layout = _layout(intensities, spacing_mm, settings, border)
    active = None if threshold is None else _active_cells(low_resolution_map, threshold, layout, between)
    with Workers(intensities.device, intensities.numel(), between) as workers:
        if in_place:
            target = Target(low_resolution_map.__getitem__, _largest(low_resolution_map))
            return _refine(target, None, intensities, window, active, layout, settings, workers, low_resolution_map)
        if large_arrays.all_finite(low_resolution_map):
            target = Target(Upsampling(low_resolution_map, intensities.shape).read, _largest(low_resolution_map))
            return _refine(target, None, intensities, window, active, layout, settings, workers)
        target, confidence = _without_unknown_voxels(upsampled(low_resolution_map, intensities.shape), None)
        return _refine(target, confidence, intensities, window, active, layout, settings, workers)


def solve_bilateral(
    target: Tensor,
    luma: Tensor,
    confidence: Tensor | None,
    spacing_mm: Sequence[float],
    settings: BilateralSolverSettings | None = None,
    threshold: float | None = None,
) -> BilateralSolution:
    """Minimise the energy for a target that has the volume's resolution.

    Only tests and benchmarks use this, to examine the solver by itself; the product refines low-resolution maps (`refine_map`).

    Args:
        target: (K, J, I); values that are not finite get confidence 0.
        luma: (K, J, I), intensity in units of its window, clamped to [0, 1]; voxels that are not finite keep the target.
        confidence: (K, J, I), finite and not negative; None for 1 everywhere.
        spacing_mm: along (K, J, I).
        settings: None for the default values.
        threshold: solve only near voxels at which the target exceeds this, and keep it elsewhere. None solves everywhere.

    Raises:
        InputError: shapes differ, a value is out of its range, or no voxel of the target is finite.
    """
    import torch

    _check_volume("target", target)
    for name, other in (("luma", luma), ("confidence", confidence)):
        if other is not None and other.shape != target.shape:
            raise InputError(f"Bilateral solver: {name} has shape {tuple(other.shape)}; expected {tuple(target.shape)}.")
    if confidence is not None and not bool((confidence >= 0).all() & torch.isfinite(confidence).all()):
        raise InputError("Bilateral solver: confidence has values that are negative or not finite; expected finite ones ≥ 0.")
    settings = settings or BilateralSolverSettings()
    layout = _layout(luma, spacing_mm, settings)
    active = None if threshold is None else _active_cells(target, threshold, layout)
    # Dividing the energy by a factor does not change its minimum. Without it, squares of tiny confidences and sums of huge ones
    # would exceed the range of single precision.
    unit = (0.0 if confidence is None else float(confidence.max())) or 1.0
    confidence = None if confidence is None else confidence / unit
    settings = replace(settings, smoothness=min(settings.smoothness / unit, MAX_SMOOTHNESS))
    with Workers(luma.device, luma.numel()) as workers:
        known_target, confidence = _without_unknown_voxels(target, confidence)
        solution = _refine(known_target, confidence, luma, (0.0, 1.0), active, layout, settings, workers)
    return replace(solution, smoothness=solution.smoothness * unit)


def _check_volume(name: str, volume: Tensor) -> None:
    if volume.ndim != 3 or volume.numel() == 0:
        raise InputError(
            f"Bilateral solver: {name} has shape {tuple(volume.shape)}; expected three axes (K, J, I), none empty."
        )


def _layout(
    volume: Tensor,
    spacing_mm: Sequence[float],
    settings: BilateralSolverSettings,
    border: tuple[int, int, int] = (0, 0, 0),
) -> GridLayout:
    spacing_k, spacing_j, spacing_i = (float(s) for s in spacing_mm)
    if not all(s > 0.0 and math.isfinite(s) for s in spacing_mm):
        raise InputError(f"Bilateral solver: spacing_mm is {tuple(spacing_mm)}; expected three finite numbers above 0.")
    k, j, i = volume.shape
    spacing = spacing_k, spacing_j, spacing_i
    return GridLayout.of_sigmas((k, j, i), spacing, settings.sigma_spatial_mm, settings.sigma_luma, border)


def _active_cells(where: Tensor, threshold: float, layout: GridLayout, between: Between = nothing_between) -> Tensor:
    """For each spatial cell, (K, J, I) bool: whether a map of any resolution exceeds the threshold in the cell or beside it."""
    import torch

    first, last = _reach(where.shape[0], layout.cells[0])
    above = torch.zeros((layout.cells[0], *where.shape[1:]), dtype=torch.bool, device=where.device)
    # Plane by plane, since comparing all at once would take another quarter of the memory of a map as large as the volume.
    for k, plane in enumerate(where):
        between()
        of_plane = plane > threshold
        for cell in np.flatnonzero((first <= k) & (k <= last)):
            above[cell] |= of_plane
    for axis in (1, 2):
        between()
        first, last = _reach(where.shape[axis], layout.cells[axis])
        steps = range(int((last - first).max()) + 1)
        elements = [torch.as_tensor(np.minimum(first + step, last), device=where.device) for step in steps]
        near = above.index_select(axis, elements[0])
        for others in elements[1:]:
            near |= above.index_select(axis, others)
        above = near
    return above


def _reach(elements: int, cells: int) -> tuple[np.ndarray, np.ndarray]:
    """For each cell along an axis, (cells,): the first and the last of a map's elements in it or in the cells beside it."""
    cell = np.arange(cells)
    return np.maximum(cell - 1, 0) * elements // cells, -(-np.minimum(cell + 2, cells) * elements // cells) - 1


def _without_unknown_voxels(target: Tensor, confidence: Tensor | None) -> tuple[Target, Tensor | None]:
    """Replace voxels that are not finite by the lowest finite value, and give them confidence 0."""
    import torch

    if not large_arrays.all_finite(target):
        finite = torch.isfinite(target)
        if not bool(finite.any()):
            raise InputError("Bilateral solver: no voxel of the map is finite. Compute the map again.")
        confidence = finite.to(torch.float32) if confidence is None else torch.where(finite, confidence, 0.0)
        target = torch.where(finite, target, target[finite].min())
    return Target(target.__getitem__, _largest(target)), confidence


def _largest(target: Tensor) -> float:
    """The largest magnitude."""
    return max(abs(float(extreme)) for extreme in large_arrays.extremes(target))


def _refine(
    target: Target,
    confidence: Tensor | None,
    intensities: Tensor,
    window: tuple[float, float],
    active: Tensor | None,
    layout: GridLayout,
    settings: BilateralSolverSettings,
    workers: Workers,
    out: Tensor | None = None,
) -> BilateralSolution:
    """Solve for the active cells of a volume; all other voxels keep the target, which may be `out` itself."""
    import torch

    if not (math.isfinite(window[0]) and math.isfinite(window[1]) and window[0] <= window[1]):
        raise InputError(f"Bilateral solver: window is {window}; expected two finite intensities in ascending order.")
    refined = large_arrays.empty(intensities.shape, torch.float32, intensities.device) if out is None else out
    unsolved = BilateralSolution(refined, True, 0, 0.0, 0, settings.smoothness, layout.cell_voxels)
    region = refined
    if active is not None:
        # Voxels that are not near the structure keep the target.
        if out is None:
            _read_all(target, refined, layout, workers)
        cropped = _cropped(layout, active)
        if cropped is None:
            return unsolved
        box, layout, active = cropped
        region, intensities = refined[box], intensities[box]
        confidence = None if confidence is None else confidence[box]
        target = Target(region.__getitem__, target.largest)
    voxel_cells = VoxelCells(layout, intensities, window, settings.sigma_luma, active)
    cells, places = splat(voxel_cells, target, confidence, workers)
    if not bool(cells.confidence.any()):
        if out is None:
            _read_all(target, region, layout, workers)
        return unsolved
    solution = solve_cells(cells, settings.smoothness, settings.max_iterations, settings.tolerance, workers)
    # Frees memory for the map, which is written now.
    del cells
    slice_multilinear(voxel_cells, places, solution.values, target, region, workers)
    return replace(
        unsolved,
        converged=solution.residual <= settings.tolerance,
        iterations=solution.iterations,
        residual=solution.residual,
        cells=len(solution.values),
        smoothness=solution.smoothness,
    )


def _read_all(target: Target, out: Tensor, layout: GridLayout, workers: Workers) -> None:
    rows = slice(0, layout.voxels[1])

    def read(layers: Sequence[tuple[int, slice]]) -> None:
        for k in range(layers[0][1].start, layers[-1][1].stop):
            out[k : k + 1] = target.read((slice(k, k + 1), rows))

    workers.share_out(layout.layers(), read)


def _cropped(layout: GridLayout, active: Tensor) -> tuple[Box, GridLayout, Tensor] | None:
    """The smallest box of voxels that holds all active cells, its layout, and its active cells; None if no cell is active."""
    cells = bounding_box(array_of(active.cpu()))
    if cells is None:
        return None
    return layout.extents(cells), layout.part(cells), active[cells]
