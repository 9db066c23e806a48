"""A scalar volume and where it lies in the patient: the form in which every part of the Logic passes intensities."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .errors import InputError
from .geometry import Geometry


@dataclass(frozen=True, eq=False)
class Volume:
    """Scalar intensities on a regular, possibly oblique and anisotropic, voxel grid.

    Attributes:
        array: intensities, (K, J, I), any real dtype; may hold NaN or infinities.
        geometry: where the voxels lie, in RAS millimetres.
        name: what users call it; the file's stem, say.

    Raises:
        InputError: the array is not three-dimensional and real, is a single slice, or holds no finite voxel or
            only one value: there is nothing to tell apart; or its values are beyond single precision.
    """

    array: np.ndarray
    geometry: Geometry
    name: str = "volume"

    def __post_init__(self) -> None:
        self._check_shape()
        self._check_values()

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of voxels along (K, J, I)."""
        return self.geometry.shape

    @cached_property
    def digest(self) -> bytes:
        """SHA-256 of the voxels and of where they lie, found once: the array must not be changed from then on."""
        digest = hashlib.sha256()
        digest.update(f"{self.array.shape} {self.array.dtype.str}".encode())
        # A file format may keep fewer digits, and turn 0 into -0.
        digest.update((np.round(self.geometry.ijk_to_ras, 4) + 0.0).astype("<f8").tobytes())
        digest.update(np.ascontiguousarray(self.array).data)
        return digest.digest()

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
        if max(abs(minimum), abs(maximum), spread) > float(np.finfo(np.float32).max) or np.float32(minimum) == np.float32(
            maximum
        ):
            raise InputError(
                f"'{self.name}' has intensities from {minimum:g} to {maximum:g}, which cannot be told apart or held in single "
                "precision. Save it with other units."
            )


def finite_range(array: np.ndarray) -> tuple[float, float]:
    """Smallest and largest finite value of `array`; (nan, nan) where no value is finite."""
    if np.issubdtype(array.dtype, np.floating):
        array = array[np.isfinite(array)]
        if array.size == 0:
            return float("nan"), float("nan")
    return float(array.min()), float(array.max())
