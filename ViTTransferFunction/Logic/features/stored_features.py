"""Features that stay in the file that they are kept in: all that is needed of them is a few patches around each point."""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import IO, Any

import numpy as np

from ..core.errors import InputError
from ..core.geometry import Geometry
from .feature_volume import FeatureVolume


@dataclass(frozen=True)
class ArrayInFile:
    """Where a file holds an array, in C order.

    Attributes:
        start: offset of its first byte.
        shape: of the array.
        dtype: of its values.
    """

    start: int
    shape: tuple[int, ...]
    dtype: np.dtype[Any]


class StoredFeatures:
    """A feature volume in a file. What was looked at once is kept in memory.

    It is read and not mapped: a mapping of what a network drive has lost ends the process.

    Args:
        file: open for reading; it is closed when nobody has these features any more. Meanwhile the file may lose its name.
        place: of the features in it, (K', J', I', C).
        geometry: see `FeatureVolume`.
        key: see `FeatureVolume`.
        cells: see `FeatureVolume`.
    """

    def __init__(self, file: IO[bytes], place: ArrayInFile, geometry: Geometry, key: str, cells: Geometry) -> None:
        if len(place.shape) != 4 or place.shape[:3] != geometry.shape:
            raise ValueError(f"features of shape {place.shape} do not fit a grid of shape {geometry.shape}")
        self.geometry = geometry
        self.key = key
        self.cells = cells
        self._file = file
        self._place = place
        self._reading = Lock()
        self._known: dict[int, np.ndarray] = {}
        weakref.finalize(self, file.close)

    def vectors_at(self, kji: np.ndarray) -> np.ndarray:
        """The features (N, C) of patches (N, 3), along K', J', I'.

        Raises:
            InputError: they can no longer be read.
        """
        patches = np.ravel_multi_index(tuple(kji.T), self.geometry.shape).tolist()
        with self._reading:
            for patch in patches:
                if patch not in self._known:
                    self._known[patch] = self._read(patch, 1)[0]
            return np.stack([self._known[patch] for patch in patches])

    def whole(self) -> FeatureVolume:
        """These features, all in memory. Raises InputError where they can no longer be read."""
        patches = int(np.prod(self.geometry.shape))
        with self._reading:
            return FeatureVolume(self._read(0, patches).reshape(self._place.shape), self.geometry, self.key, self.cells)

    def _read(self, first: int, count: int) -> np.ndarray:
        """The features of so many patches from the first on, (count, C)."""
        array = np.empty((count, self._place.shape[3]), self._place.dtype)
        values = array.reshape(-1).view(np.uint8).data
        try:
            self._file.seek(self._place.start + first * array[:1].nbytes)
            while len(values):
                read = self._file.readinto(values)  # type: ignore[attr-defined]
                if not read:
                    raise OSError("the file has become shorter")
                values = values[read:]
        except OSError as error:
            raise InputError(
                f"The features that were kept in {Path(self._file.name)} can no longer be read ({error.strerror or error}). "
                "Choose the volume again to have them loaded or computed anew."
            ) from error
        return array
