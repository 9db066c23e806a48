"""Resamples scans to a straight grid if their slices were taken by a tilted gantry or at uneven distances.

With a tilted gantry, slices are at a slant to the movement of the table, so that each one is shifted within its plane against
the one before. Distances are uneven if, for example, the base of the skull was scanned more finely than the rest of the head,
or if slices are missing. On the straight grid, every slice lies where it was taken. Between two slices, the image is
interpolated along the lines from each pixel of one to the same pixel of the other, which is the direction of the table and so
of the patient. 3D Slicer shows such scans in the same way, by a transform.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..core.system.available_memory import require_memory
from ..core.system.errors import InputError
from ..core.volumes.geometry import Geometry
from ..core.volumes.volume import finite_range

LARGEST_DEVIATION = 0.25
"""How far a slice may lie from where it was taken, as a share of a voxel's shortest edge. Nobody sees a quarter of a voxel,
while interpolation blurs the image; rounding of positions causes smaller deviations."""

SHARE_OF_SHORTER_DISTANCES = 0.1
"""Share of distances between slices that may be shorter than that of the straight grid. A part that was scanned more finely
must not lose detail, but a single short distance, such as where two parts meet, must not make the whole grid as fine."""

MOST_GROWTH = 10.0
"""Largest ratio of the straight grid's voxels to the measured ones: beyond it, the slices do not form one stack."""

RIGHT_ANGLE = 1e-3
"""Largest cosine of an angle that counts as a right angle, since headers round axes."""

GAP = 1.5
"""Slices seem to be missing where a distance exceeds those beside it by this factor."""


def straightened(
    path: Path, array: np.ndarray, geometry: Geometry, positions_ras: np.ndarray, on_warning: Callable[[str], None]
) -> tuple[np.ndarray, Geometry]:
    """A scan with each slice where it was taken.

    Args:
        path: path of the scan, for messages.
        array: the slices, (K, J, I), any real dtype.
        geometry: where the reader has put them; only the axes within the slices' plane are used.
        positions_ras: position of the first pixel of each slice, (K, 3) RAS millimetres, ordered along the slices' normal.
        on_warning: called with a message that says what was done.

    Returns:
        Array and geometry unchanged if the slices lie where they were taken, or if pixels are not rectangular, which no scanner
        produces. Otherwise a straight grid that contains all slices, of the same dtype and pixel size, with the lowest value
        where nothing was measured. Its first and last slices are those of the scan; if distances are even, all of its slices
        are, only shifted within their planes.

    Raises:
        InputError: most of the grid would be empty or made up, or it does not fit into memory.
    """
    if len(array) < 2 or not _has_rectangular_pixels(geometry):
        return array, geometry
    stack = _stack(geometry, positions_ras)
    if not (stack.is_uneven or stack.is_shifted):
        return array, geometry
    growth = _growth(array.shape, stack)
    if growth > MOST_GROWTH:
        raise InputError(
            f"{path} is no one stack of slices: they {stack.description}. A straight grid that holds all of them would have "
            f"{growth:.3g} times as many voxels. Name one stack alone."
        )
    needed = int(growth * array.nbytes)
    require_memory(needed, f"Straightening the slices of {path}", "Close other programs, or name fewer slices.")
    places = _places(stack)
    grid = _grid(array.shape, geometry, positions_ras[0], stack, places)
    spacing = " × ".join(f"{mm:.3g}" for mm in grid.spacing_mm)
    on_warning(
        f"{path}: the slices {stack.description}. They were put on a straight grid of {spacing} mm, each where it was taken; "
        "segmentations lie on that grid."
    )
    return _resampled(array, places, grid.shape), grid


def warn_of_gaps(path: Path, heights_mm: np.ndarray, names: Sequence[str], on_warning: Callable[[str], None]) -> None:
    """Warn if slices seem to be missing.

    The gap is interpolated. All other slices keep their places, and structures that cross the gap about their size, but what
    lay only in the gap is lost, and nothing in the volume shows that.

    Args:
        path: path of the scan.
        heights_mm: positions of its slices along their normal, (K,), ascending or descending.
        names: names of the slices.
        on_warning: called with the warning.
    """
    distances = np.abs(np.diff(heights_mm))
    beside = np.maximum(np.append(0.0, distances[:-1]), np.append(distances[1:], 0.0))
    gaps = np.flatnonzero((distances > GAP * beside) & (beside > 0.0))
    if len(gaps):
        widest = gaps[distances[gaps].argmax()]
        places = "" if len(gaps) == 1 else f" in {len(gaps)} places, the widest"
        on_warning(
            f"{path}: slices seem to be missing{places} between {names[widest]} and {names[widest + 1]}, which are "
            f"{distances[widest]:.3g} mm apart; what lies between them is interpolated."
        )


@dataclass(frozen=True, eq=False)
class _Stack:
    """Positions of slices relative to the first one.

    Attributes:
        heights_mm: distances along the slices' normal, (K,), ascending from 0.
        shifts: shift of each slice within its plane, (K, 2), in pixels along I and J.
        pixel_mm: size of a pixel along I and J, (2,).
        normal_ras: unit normal of the slices, (3,).
    """

    heights_mm: np.ndarray
    shifts: np.ndarray
    pixel_mm: np.ndarray
    normal_ras: np.ndarray

    @property
    def distances_mm(self) -> np.ndarray:
        """Distance from each slice to the next, (K - 1,)."""
        distances: np.ndarray = np.diff(self.heights_mm)
        return distances

    @property
    def tolerance_mm(self) -> float:
        """By how much a slice may deviate from the straight stack."""
        return LARGEST_DEVIATION * float(min(self.pixel_mm.min(), np.median(self.distances_mm)))

    @property
    def is_uneven(self) -> bool:
        """Whether distances between slices are unequal."""
        even = np.linspace(0.0, self.heights_mm[-1], len(self.heights_mm))
        return bool(np.abs(self.heights_mm - even).max() > self.tolerance_mm)

    @property
    def is_shifted(self) -> bool:
        """Whether slices do not lie straight above the first one."""
        return self.largest_shift_mm > self.tolerance_mm

    @property
    def largest_shift_mm(self) -> float:
        """Diagonal of the smallest rectangle that contains all shifts."""
        shifts_mm = self.shifts * self.pixel_mm
        return float(np.linalg.norm(np.ptp(shifts_mm, axis=0)))

    @property
    def straight_count(self) -> float:
        """The number of slices that the straight grid needs, a whole number (a float, as damaged headers give huge ones)."""
        if not self.is_uneven:
            return float(len(self.heights_mm))
        usual_mm = np.quantile(self.distances_mm, SHARE_OF_SHORTER_DISTANCES, method="lower")
        return float(np.rint(self.heights_mm[-1] / usual_mm) + 1.0)

    @property
    def description(self) -> str:
        """What is irregular, as the end of a sentence about the slices."""
        shortest, longest = self.distances_mm.min(), self.distances_mm.max()
        uneven = f"lie {shortest:.3g} to {longest:.3g} mm apart" if self.is_uneven else ""
        shifted = f"are shifted against each other by up to {self.largest_shift_mm:.3g} mm, as with a tilted gantry"
        return " and ".join(filter(None, (uneven, shifted if self.is_shifted else "")))


@dataclass(frozen=True, eq=False)
class _Places:
    """The M slices of a straight grid, as places in the stack.

    Attributes:
        indices: indices of slices of the stack, (M,), ascending; fractions lie between two slices.
        shifts: interpolated shifts of the stack, (M, 2).
        distance_mm: distance between two slices of the grid.
    """

    indices: np.ndarray
    shifts: np.ndarray
    distance_mm: float

    @property
    def first_pixels(self) -> np.ndarray:
        """The pixel of the grid, (M, 2) along I and J from the first slice's, whose middle is in each slice's first pixel."""
        return np.ceil(self.shifts - 0.5).astype(int)


def _has_rectangular_pixels(geometry: Geometry) -> bool:
    along_i, along_j = geometry.ijk_to_ras[:3, :2].T / geometry.spacing_mm[:2, None]
    return abs(float(along_i @ along_j)) <= RIGHT_ANGLE


def _stack(geometry: Geometry, positions_ras: np.ndarray) -> _Stack:
    pixel_mm = geometry.spacing_mm[:2]
    in_plane = geometry.ijk_to_ras[:3, :2] / pixel_mm
    steps = positions_ras - positions_ras[0]
    normal = np.cross(*in_plane.T)
    normal *= np.copysign(1.0, steps[-1] @ normal)
    return _Stack(steps @ normal, steps @ in_plane / pixel_mm, pixel_mm, normal)


def _growth(shape: Sequence[int], stack: _Stack) -> float:
    """Ratio of the straight grid's voxels to the measured ones; damaged headers give huge grids, which must not be made."""
    slices, rows, columns = shape
    more_columns, more_rows = np.ptp(stack.shifts, axis=0)
    return float(stack.straight_count / slices * (1.0 + more_rows / rows) * (1.0 + more_columns / columns))


def _places(stack: _Stack) -> _Places:
    count, last_mm = len(stack.heights_mm), float(stack.heights_mm[-1])
    indices = np.arange(count, dtype=np.float64)
    if stack.is_uneven:
        heights_mm = np.linspace(0.0, last_mm, int(stack.straight_count))
        indices = np.interp(heights_mm, stack.heights_mm, indices)
        # Measured slices are used as they are, not blurred with the next one.
        nearest = np.rint(indices).astype(int)
        measured = np.abs(heights_mm - stack.heights_mm[nearest]) <= stack.tolerance_mm
        indices = np.where(measured, nearest, indices)
    shifts = np.zeros((len(indices), 2))
    if stack.is_shifted:
        shifts = np.stack([np.interp(indices, np.arange(count), along) for along in stack.shifts.T], axis=1)
    return _Places(indices, shifts, last_mm / (len(indices) - 1))


def _grid(shape: Sequence[int], geometry: Geometry, position_ras: np.ndarray, stack: _Stack, places: _Places) -> Geometry:
    """The straight grid that contains the slices at `places`; `position_ras` is that of the stack's first slice."""
    _, rows, columns = shape
    lowest, highest = places.first_pixels.min(axis=0), places.first_pixels.max(axis=0)
    more_columns, more_rows = highest - lowest
    matrix = geometry.ijk_to_ras.copy()
    matrix[:3, 2] = places.distance_mm * stack.normal_ras
    matrix[:3, 3] = position_ras + matrix[:3, :2] @ lowest
    return Geometry((len(places.indices), rows + int(more_rows), columns + int(more_columns)), matrix)


def _resampled(array: np.ndarray, places: _Places, shape: tuple[int, int, int]) -> np.ndarray:
    """The slices at `places`, resampled to a grid of `shape`; one at a time, so that no large copy is made."""
    lowest, _ = finite_range(array)
    straight = np.full(shape, lowest, array.dtype)
    _, rows, columns = array.shape
    starts = places.first_pixels - places.first_pixels.min(axis=0)
    within = places.first_pixels - places.shifts
    for target, index, (column, row), (along_i, along_j) in zip(straight, places.indices, starts, within, strict=True):
        pixels = _moved(_moved(_between(array, float(index)), along_i, axis=1), along_j, axis=0)
        whole = array.dtype.kind in "iu"
        target[row : row + rows, column : column + columns] = np.rint(pixels) if whole else pixels
    return straight


def _between(array: np.ndarray, index: float) -> np.ndarray:
    """The slice at an index with a fraction, (J, I), in a floating-point type that holds it."""
    lower = int(index)
    share = index - lower
    below = array[lower].astype(np.result_type(array.dtype, np.float32))
    return below + share * (array[lower + 1] - below) if share else below


def _moved(pixels: np.ndarray, step: float, axis: int) -> np.ndarray:
    """The values (J, I) at a step of -½ to ½ pixels along an axis; beyond the border, those of the border's pixels."""
    count = pixels.shape[axis]
    neighbours = np.clip(np.arange(count) + int(np.sign(step)), 0, count - 1)
    return pixels + abs(step) * (pixels.take(neighbours, axis) - pixels) if step else pixels
