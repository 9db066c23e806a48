"""From a low-resolution map S_L to a full-resolution map S_H that follows the edges in the intensities (paper §III-C)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..core.classes.class_map import NEAR_SHARE_OF_ISO
from ..core.system.errors import InputError
from ..core.system.progress import Between, nothing_between
from ..core.volumes.bounding_box import bounding_box, covering_box, grown, whole_box, within
from ..core.volumes.geometry import Box
from ..core.volumes.intensity_window import IntensityWindow
from ..core.volumes.orientation import Orientation, canonical_orientation
from ..core.volumes.resampling import sample_at
from ..core.volumes.torch_arrays import array_of, tensor_of
from ..core.volumes.volume import Volume
from ..core.volumes.voxel_map import VoxelMap
from .intensity_likelihood import weigh_by_intensity
from .refinement_methods import REFINEMENT_METHODS as REFINEMENT_METHODS
from .refinement_methods import RefinementMethod as RefinementMethod
from .threshold_dynamics import STEPS

if TYPE_CHECKING:
    from .upsampling import Upsampling

SIGMA_SHARE_OF_CELL = 0.6
"""Spatial σ of the bilateral solver in feature cells: the errors of S_L are about as wide as a cell."""
SURROUNDINGS_CELLS = 2.0
"""Margin in feature cells around a structure's box; intensities there count as its surroundings (`settling`)."""

FILTER_BODY_MM = 96.0
"""In volumes whose longest edge is shorter, the guided filter's radius is smaller in proportion: it suits human bodies, and
exceeds the whole image of a microscope. With `body_scale` it would still be too large there."""


def refine(
    similarity: np.ndarray,
    volume: Volume,
    display: IntensityWindow,
    positive_ras: np.ndarray,
    iso: float,
    method: RefinementMethod,
    between: Between = nothing_between,
    lowest_iso: float | None = None,
) -> VoxelMap:
    """Upsample a class's map and sharpen it against the volume's intensities.

    First the map's value at every voxel near the structure is multiplied by the likelihood ratio of the voxel's intensity
    (`intensity_likelihood`), then it is smoothed together with the values of similar voxels.

    Args:
        similarity: S_L, (K', J', I') float32 in [0, 1], on cells that fill the volume's box.
        volume: the intensities.
        display: the window in which a person would look at them (`display_window`).
        positive_ras: (N, 3) RAS millimetres, points on the structure; their intensities choose the window (`class_window`).
        iso: threshold that will be applied to the map, so that its surface will be there.
        method: "bilateral": 3D bilateral solver; "guided": 3D guided filter; "none": trilinear upsampling alone.
        between: called between steps; may raise `Cancelled`.
        lowest_iso: the lowest threshold that will be applied to the map, if not `iso`: voxels near its surface are refined as
            well.

    Returns:
        S_H. Only the refined box, and a margin in which the surface may settle, are held in memory.

    Raises:
        InputError: there is no such method.
        Cancelled: by `between`.
    """
    from .upsampling import Upsampling

    if method not in REFINEMENT_METHODS:
        raise InputError(f"Unknown refinement '{method}'; expected one of {', '.join(REFINEMENT_METHODS)}.")
    similarity = np.ascontiguousarray(similarity, dtype=np.float32)
    upsampling = Upsampling(tensor_of(similarity), volume.shape)

    def interpolated(k: int, rows: slice) -> np.ndarray:
        plane: np.ndarray = array_of(upsampling.read((slice(k, k + 1), rows))[0])
        return plane

    near = _near(iso, lowest_iso)
    box = None if method == "none" else active_box(similarity > near, volume.shape)
    if box is None:
        nothing = (slice(0, 0), slice(0, 0), slice(0, 0))
        return VoxelMap(volume.shape, similarity, interpolated, nothing, np.empty((0, 0, 0), dtype=np.float32))
    held_box = _held_part(box, volume.shape, similarity.shape)
    held = _interpolated_part(upsampling, held_box, between)
    window = class_window(volume, display, positive_ras)
    _refine_part(held[within(box, held_box)], volume, box, window, iso, method, near, similarity, between)
    return VoxelMap(volume.shape, similarity, interpolated, held_box, held, refined=box)


def _interpolated_part(upsampling: Upsampling, box: Box, between: Between) -> np.ndarray:
    """S_L in a box of the volume's voxels, (K, J, I) float32."""
    import torch

    from .workers import Workers

    k, rows, columns = box
    part = tensor_of(np.empty([extent.stop - extent.start for extent in box], dtype=np.float32))

    def read(slices: Sequence[int]) -> None:
        for index in slices:
            workers.between()
            of_slice = slice(index, index + 1)
            upsampling.read((of_slice, rows), part[index - k.start][None], columns)

    with Workers(torch.device("cpu"), part.numel(), between) as workers:
        workers.share_out(range(k.start, k.stop), read)
    return array_of(part)


def held_voxels(
    similarity: np.ndarray, shape: tuple[int, int, int], iso: float, method: RefinementMethod, lowest_iso: float | None
) -> int:
    """The number of voxels that `refine` will hold in memory; for arguments, see there."""
    box = None if method == "none" else active_box(similarity > _near(iso, lowest_iso), shape)
    if box is None:
        return 0
    return math.prod(extent.stop - extent.start for extent in _held_part(box, shape, similarity.shape))


def _near(iso: float, lowest_iso: float | None) -> float:
    return NEAR_SHARE_OF_ISO * (iso if lowest_iso is None else min(iso, lowest_iso))


def _held_part(box: Box, shape: tuple[int, int, int], cells: Sequence[int]) -> Box:
    """The box that is held in memory if `box` is refined: larger by the margin in which the surface may settle."""
    return grown(box, surroundings(shape, cells), whole_box(shape))


def surroundings(shape: Sequence[int], cells: Sequence[int]) -> list[int]:
    """Margin around a structure's box in voxels, along (K, J, I): its surroundings, and the space into which it may grow.

    Args:
        shape: shape of the volume, (K, J, I).
        cells: shape of the grid of cells on the same box, (K', J', I').
    """
    return [max(round(SURROUNDINGS_CELLS * edge), STEPS) for edge in cell_voxels(shape, cells)]


def cell_voxels(shape: Sequence[int], cells: Sequence[int]) -> list[float]:
    """Edges of a feature cell in voxels, along (K, J, I), if a volume of `shape` is divided into this many `cells`."""
    return [n / count for n, count in zip(shape, cells, strict=True)]


def _refine_part(
    target: np.ndarray,
    volume: Volume,
    box: Box,
    window: IntensityWindow,
    iso: float,
    method: RefinementMethod,
    near: float,
    similarity: np.ndarray,
    between: Between,
) -> None:
    """Refine the map of a box, (K, J, I) float32, in place."""
    # A view, because the intensities are read piece by piece. PyTorch cannot read mirrored views.
    intensities = volume.array[box]
    if min(intensities.strides) < 0:
        intensities = np.ascontiguousarray(intensities)
    weigh_by_intensity(target, intensities, window, iso, near, between)
    spacing_mm = volume.geometry.spacing_mm[::-1]
    if method == "bilateral":
        cell_edge_mm = float((spacing_mm * volume.shape / similarity.shape).min())
        usual_box = active_box(similarity > _near(iso, None), volume.shape) or box
        border = _grid_border(usual_box, box, canonical_orientation(volume.geometry))
        _solve(target, intensities, window, spacing_mm, cell_edge_mm, near, border, between)
        # The solver finds deviations from a mean; adding the mean may give values slightly below 0 by rounding.
        np.clip(target, 0.0, 1.0, out=target)
    else:
        target[...] = _filtered(target, intensities, window, spacing_mm, volume.longest_edge_mm)


def _grid_border(usual_box: Box, box: Box, orientation: Orientation) -> tuple[int, int, int]:
    """Index in `box`, (K, J, I), at which cells of the bilateral grid begin: at an end of the box of the usual size.

    For a larger size, a larger box is refined. If the cells began at its ends, voxels would share cells with other voxels than
    in the usual size, and some of the structure's voxels would be lost.
    """
    ends = zip(usual_box, box, orientation.runs_along, strict=True)
    k, j, i = ((usual.stop if from_end else usual.start) - whole.start for usual, whole, from_end in ends)
    return k, j, i


def active_box(active: np.ndarray, shape: tuple[int, ...]) -> Box | None:
    """The smallest box of a volume's voxels, `shape`, that holds all active cells and one cell around them; None for none."""
    cells = bounding_box(active, margin=1)
    return None if cells is None else covering_box(cells, active.shape, shape)


def _solve(
    target: np.ndarray,
    intensities: np.ndarray,
    window: IntensityWindow,
    spacing_mm: np.ndarray,
    cell_edge_mm: float,
    threshold: float,
    border: tuple[int, int, int],
    between: Between,
) -> None:
    """Replace the target by the bilateral solver's solution.

    σ is most of a feature cell and at least two voxels; it is larger if the grid of a large structure would be too fine.
    """
    from .bilateral_grid import GridLayout
    from .bilateral_solver import BilateralSolverSettings, refine_map

    (k, j, i), (mm_k, mm_j, mm_i) = target.shape, spacing_mm.tolist()
    sigma_mm = max(SIGMA_SHARE_OF_CELL * cell_edge_mm, 2.0 * float(spacing_mm.min()))
    sigma_mm = GridLayout.sigma_that_fits_mm((k, j, i), (mm_k, mm_j, mm_i), sigma_mm, BilateralSolverSettings.sigma_luma)
    bounds = (window.low, window.high)
    settings = BilateralSolverSettings(sigma_spatial_mm=sigma_mm)
    tensors = tensor_of(target), tensor_of(intensities)
    refine_map(*tensors, bounds, spacing_mm.tolist(), settings, threshold, between, in_place=True, border=border)


def _filtered(
    target: np.ndarray, intensities: np.ndarray, window: IntensityWindow, spacing_mm: np.ndarray, longest_edge_mm: float
) -> np.ndarray:
    from .guided_filter import GuidedFilterSettings, guided_filter

    # Slice by slice, so that only the result has the size of the box.
    luma = tensor_of(np.empty(intensities.shape, dtype=np.float32))
    for plane, of_volume in zip(array_of(luma), intensities, strict=True):
        plane[...] = window.apply(of_volume)
    settings = GuidedFilterSettings(GuidedFilterSettings.radius_mm * min(longest_edge_mm / FILTER_BODY_MM, 1.0))
    return array_of(guided_filter(tensor_of(target), luma, tuple(spacing_mm.tolist()), settings))


def class_window(volume: Volume, display: IntensityWindow, positive_ras: np.ndarray) -> IntensityWindow:
    """The window in which a structure's edges show: as wide as the display's, around most of the annotated intensities.

    This separates lung from the chest wall and from outside air, although a soft-tissue window shows it as plain black. If a
    structure has parts of very different brightness, such as gas and food in a stomach, the part with most points is used,
    because a window in the middle would show neither.
    """
    annotated = _intensities_at(volume, positive_ras)
    if not annotated.size:
        return display
    together = np.abs(annotated[:, None] - annotated) <= 0.5 * display.width
    display_centre = 0.5 * (display.low + display.high)
    # Among parts with equally many points, the one nearest to the display window, independent of the order of clicks.
    best = np.lexsort((np.abs(annotated - display_centre), -together.sum(axis=1)))[0]
    centre = float(np.median(annotated[together[best]]))
    return IntensityWindow(centre - 0.5 * display.width, centre + 0.5 * display.width)


def _intensities_at(volume: Volume, points_ras: np.ndarray) -> np.ndarray:
    """Finite interpolated intensities at world points, (≤ N,); next to non-finite voxels, that of the point's own voxel."""
    with np.errstate(invalid="ignore"):  # Zero times infinity, for example, is not a number.
        samples = sample_at(volume.array[..., None], volume.geometry, points_ras)[:, 0]
    k, j, i = volume.geometry.nearest_voxels(points_ras).T
    samples = np.where(np.isfinite(samples), samples, volume.array[k, j, i].astype(np.float32))
    finite: np.ndarray = samples[np.isfinite(samples)]
    return finite
