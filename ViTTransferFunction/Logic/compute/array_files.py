"""Arrays go from one process to the other as files of a private folder; only what describes them goes through a pipe.

A pipe hands over a few thousand bytes at a time, and each time its reader needs Python's global lock, which the event loop of
Slicer holds for all but an instant every few hundredths of a second: a label map took 10 s that way. A file is written and read
in one call each, without the lock. It lives for the fraction of a second in between, most often in memory alone.
"""

from __future__ import annotations

import itertools
import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

_CALL_BYTES = 2**30
"""What is read or written in one call at most: systems refuse more than 2 GiB."""


class ArrayFiles:
    """One side's way to hand arrays over.

    Args:
        folder: private to the user, and known to both sides.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._numbers = itertools.count()

    def put(self, arrays: Sequence[np.ndarray]) -> dict[str, Any]:
        """Write arrays of numbers or booleans to a new file, one after the other, in C order.

        Returns:
            What `take` needs to know, as JSON can hold it.

        Raises:
            OSError: the disk is full, say. Nothing is left of the file.
        """
        path = self._folder / f"{os.getpid()}-{next(self._numbers)}"
        try:
            with path.open("xb", buffering=0) as file:
                for array in arrays:
                    _write(file, _bytes_of(np.ascontiguousarray(array)))
        except OSError:
            path.unlink(missing_ok=True)
            raise
        return {"file": path.name, "arrays": [{"dtype": array.dtype.str, "shape": array.shape} for array in arrays]}

    def take(self, description: dict[str, Any]) -> tuple[np.ndarray, ...]:
        """Read the arrays of a file, and delete it.

        Raises:
            OSError: the file is not there, or ends too early.
            ValueError: the description is none.
        """
        path = self._folder / Path(description["file"]).name
        with path.open("rb", buffering=0) as file:
            arrays = tuple(_read(file, np.dtype(array["dtype"]), array["shape"]) for array in description["arrays"])
        path.unlink()
        return arrays

    def remove_folder(self) -> None:
        """Delete the folder and what is left in it, as far as that can be done."""
        shutil.rmtree(self._folder, ignore_errors=True)


def _bytes_of(array: np.ndarray) -> memoryview:
    return array.reshape(-1).view(np.uint8).data


def _write(file: Any, values: memoryview) -> None:
    done = 0
    while done < len(values):
        done += file.write(values[done : done + _CALL_BYTES])


def _read(file: Any, dtype: np.dtype[Any], shape: Sequence[int]) -> np.ndarray:
    if dtype.hasobject:
        raise ValueError(f"arrays of type {dtype} are not exchanged")
    array = np.empty(shape, dtype=dtype)
    values, done = _bytes_of(array), 0
    while done < len(values):
        count = file.readinto(values[done : done + _CALL_BYTES])
        if not count:
            raise OSError(f"a file of arrays ends after {done} of {len(values)} bytes")
        done += count
    return array
