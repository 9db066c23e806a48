"""Arrays go from one process to the other as files of a private folder; only what describes them goes through a pipe.

A pipe hands over a few thousand bytes at a time, and each time its reader needs Python's global lock, which the event loop of
Slicer holds for all but an instant every few hundredths of a second: 80 MB took 11 s that way. A file is written
in one call without the lock, and mapped into memory. Its name lives for the fraction of a second in between.
"""

from __future__ import annotations

import itertools
import math
import mmap
import os
import shutil
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

_CALL_BYTES = 2**30
"""What is written in one call at most: systems refuse more than 2 GiB."""
_ALIGNED_BYTES = 64
"""Arrays begin at multiples of this, as those that numpy makes."""


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
        described = []
        try:
            with path.open("xb", buffering=0) as file:
                for array in arrays:
                    start = file.seek(-file.tell() % _ALIGNED_BYTES, os.SEEK_CUR)
                    _write(file, _bytes_of(np.ascontiguousarray(array)))
                    described.append({"dtype": array.dtype.str, "shape": array.shape, "start": start})
        except BaseException:
            path.unlink(missing_ok=True)
            raise
        return {"file": path.name, "arrays": described}

    def take(self, description: dict[str, Any]) -> tuple[np.ndarray, ...]:
        """The arrays of a file, which is deleted; they may be changed.

        Raises:
            OSError: the file is not there, or ends too early.
            ValueError: the description is none.
        """
        try:
            path = self._folder / Path(description["file"]).name
            content = _content(path)
            # On Windows, while a virus scanner looks at it: then it goes with the folder.
            with suppress(PermissionError):
                path.unlink()
            return tuple(
                _array(content, np.dtype(each["dtype"]), each["shape"], each["start"]) for each in description["arrays"]
            )
        except (LookupError, TypeError, AttributeError, OverflowError) as error:
            raise ValueError(f"not a description of arrays: {str(description)[:100]}") from error

    def remove_folder(self) -> None:
        """Delete the folder and what is left in it, as far as that can be done."""
        shutil.rmtree(self._folder, ignore_errors=True)


def _bytes_of(array: np.ndarray) -> memoryview:
    return array.reshape(-1).view(np.uint8).data


def _write(file: Any, values: memoryview) -> None:
    done = 0
    while done < len(values):
        done += file.write(values[done : done + _CALL_BYTES])


def _content(path: Path) -> memoryview:
    """What is in a file, private to this process."""
    with path.open("rb", buffering=0) as file:
        if os.name == "posix" and path.stat().st_size:
            # Nothing is copied, and the name can go while the content is in use.
            return memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY))
        content = memoryview(np.empty(path.stat().st_size, np.uint8).data).cast("B")
        done = 0
        while done < len(content) and (count := file.readinto(content[done : done + _CALL_BYTES])):
            done += count
        return content[:done]


def _array(content: memoryview, dtype: np.dtype[Any], shape: Sequence[int], start: int) -> np.ndarray:
    if dtype.hasobject:
        raise ValueError(f"arrays of type {dtype} are not exchanged")
    size = math.prod(shape) * dtype.itemsize
    if min(start, *shape, 0) < 0:
        raise ValueError(f"there are no arrays of shape {shape}, nor any that begin at {start}")
    if not size:
        return np.empty(shape, dtype)
    if start + size > len(content):
        raise OSError(f"a file of arrays ends after {len(content)} of {start + size} bytes")
    return np.frombuffer(content[start : start + size], dtype=dtype).reshape(shape)
