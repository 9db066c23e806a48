"""A scalar volume and its position in the patient, as all rooms of the Logic pass intensities to each other."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..system.errors import InputError
from ..system.given_numbers import FARTHEST
from .geometry import Box, Geometry

SMALLEST_SPREAD = 1e-30
"""Smallest difference of the lowest and highest intensity: windows must not be too narrow for single precision."""

FARTHEST_VOXELS = 2e6
"""Largest distance of a volume from the origin, in units of its shortest voxel edge: surfaces are drawn in single precision,
which resolves an eighth of a voxel there. A hundred times as far, distances between points would be wrong as well."""


@dataclass(frozen=True, eq=False)
class Volume:
    """Scalar intensities on a regular, possibly oblique and anisotropic, voxel grid.

    Attributes:
        array: intensities, (K, J, I), any real dtype; may contain NaN or infinities. Half and extended precision and other byte
            orders are converted, since SciPy and PyTorch do not accept them everywhere.
        geometry: position of the voxels, in RAS millimetres.
        name: name for users, such as the file's stem.
        part_of: the volume of which it is a part, whose windows and scale of distances apply to it; None: it is a whole volume.

    Raises:
        InputError: the array is not three-dimensional and real, is a single slice, has no finite voxel or only a single value,
            or its values or its distance from the origin are too large for single precision.
        ValueError: the array's shape is not that of the geometry.
    """

    array: np.ndarray
    geometry: Geometry
    name: str = "volume"
    part_of: Volume | None = None

    def __post_init__(self) -> None:
        self._check_shape()
        self._check_near()
        computable = _computable(self.array.dtype)
        # On Windows, NumPy takes extended precision for the same as double, and would keep it.
        object.__setattr__(self, "array", self.array.astype(computable, copy=self.array.dtype.char != computable.char))
        self._check_values()

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of voxels along (K, J, I)."""
        return self.geometry.shape

    @property
    def whole(self) -> Volume:
        """The volume of which it is a part, or itself: windows and the scale of distances are those of the whole."""
        return self.part_of or self

    @property
    def longest_edge_mm(self) -> float:
        """Longest edge of the whole volume: the scale of distances, also in its parts."""
        return float(self.whole.geometry.extent_mm.max())

    def part(self, box: Box) -> Volume:
        """The voxels in a box, copied unless they lie in one piece.

        Raises:
            InputError: they are constant or none is finite, or one of the extents is a single voxel.
        """
        return Volume(np.ascontiguousarray(self.array[box]), self.geometry.part(box), self.name, self.whole)

    @cached_property
    def digest(self) -> bytes:
        """SHA-256 of the voxels, and of those of the volume that they are part of. Cached: the array must not change."""
        return digest_of_voxels(self.array, self.part_of.digest if self.part_of is not None else b"")

    def _check_shape(self) -> None:
        if self.array.ndim != 3:
            raise InputError(
                f"'{self.name}' has {self.array.ndim} array dimensions {self.array.shape}; expected a scalar 3D volume. "
                "Choose one time point, channel or series and try again."
            )
        if not (np.issubdtype(self.array.dtype, np.floating) or np.issubdtype(self.array.dtype, np.integer)):
            raise InputError(f"'{self.name}' holds {self.array.dtype} values; expected real numbers.")
        if min(self.array.shape) < 2:
            raise InputError(
                f"'{self.name}' is {self.array.shape[2]}×{self.array.shape[1]}×{self.array.shape[0]} voxels; expected at least "
                "2 along every axis. A single slice is not a volume: load the whole series."
            )
        if self.array.shape != self.geometry.shape:
            raise ValueError(f"array shape {self.array.shape} and geometry shape {self.geometry.shape} differ")

    def _check_near(self) -> None:
        far_mm = float(np.abs(self.geometry.ijk_to_ras[:3, 3]).max())
        farthest_mm = min(FARTHEST_VOXELS * float(self.geometry.spacing_mm.min()), FARTHEST)
        if far_mm > farthest_mm:
            raise InputError(
                f"'{self.name}' lies {far_mm:g} mm from the middle of the coordinates; expected {farthest_mm:g} mm at most: so "
                "far away, voxels of its size cannot be told apart. Unless its header is damaged, bring it near: in Slicer's "
                "module Volumes, press Center Volume, harden the transform that this makes, and save it."
            )

    def _check_values(self) -> None:
        minimum, maximum = finite_range(self.array)
        if not np.isfinite(minimum):
            raise InputError(f"'{self.name}' holds no finite voxel (all NaN or infinite). Check the file.")
        if minimum == maximum:
            raise InputError(
                f"'{self.name}' is constant: every finite voxel is {minimum:g}. Expected structures that differ in intensity; "
                "check that the right volume was loaded."
            )
        # All that follows computes in single precision.
        spread = maximum - minimum
        largest = max(abs(minimum), abs(maximum), spread)
        held = largest <= float(np.finfo(np.float32).max) and spread >= SMALLEST_SPREAD
        if not held or np.float32(minimum) == np.float32(maximum):
            raise InputError(
                f"'{self.name}' has intensities from {minimum:g} to {maximum:g}, which cannot be told apart or held in single "
                "precision. Save it with other units."
            )


def _computable(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """The dtype itself, or the nearest one that all libraries compute with."""
    # On Windows, extended precision has no more bytes than double.
    if dtype.kind == "f" and dtype.char not in "fd":
        return np.dtype(np.float32 if dtype.itemsize < 4 else np.float64)
    native: np.dtype[Any] = dtype.newbyteorder("=")
    return native


def digest_of_voxels(array: np.ndarray, further: bytes = b"") -> bytes:
    """SHA-256 of voxels (K, J, I), also of those that make no `Volume`, of their type and number, and of further bytes."""
    digest = hashlib.sha256()
    digest.update(f"{array.shape} {array.dtype.str}".encode())
    digest.update(np.ascontiguousarray(array).data)
    digest.update(further)
    return digest.digest()


def finite_range(array: np.ndarray) -> tuple[float, float]:
    """Smallest and largest finite value of `array` (K, J, I); (nan, nan) where no value is finite."""
    if not np.issubdtype(array.dtype, np.floating):
        return float(array.min()), float(array.max())
    low, high = float("inf"), float("-inf")
    # Slice by slice, so that no copy of a volume is made.
    for part in array:
        finite = part[np.isfinite(part)]
        if finite.size:
            low, high = min(low, float(finite.min())), max(high, float(finite.max()))
    return (low, high) if low <= high else (float("nan"), float("nan"))
