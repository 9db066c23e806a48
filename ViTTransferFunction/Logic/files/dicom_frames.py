"""Where the frames of a DICOM file lie that has several: ITK takes them for a stack, whatever they are.

Enhanced images say it of each frame, in functional groups (DICOM PS3.3, C.7.6.16.2.3 and C.7.6.16.2.4), which ITK does not
show. Two phases, one after the other, frames in any order, and planes in several directions are all read as one volume; where
the distances differ, all spacings become 1 mm.
"""

from __future__ import annotations

import mmap
import re
from collections.abc import Callable
from itertools import islice
from pathlib import Path

import numpy as np
import SimpleITK as sitk  # noqa: N813

from ..core.errors import InputError

LARGEST_DEVIATION = 0.1
"""How far a frame may lie from its place in the stack, as a share of the distance between two."""

LARGEST_TURN = 0.01
"""By which entries of the frames' directions may differ: that of rounding."""


def check_frames(path: Path, image: sitk.Image, on_warning: Callable[[str], None]) -> None:
    """Raise InputError where a file's frames do not lie where ITK has put them; warn where they do not say where they lie.

    Args:
        path: a DICOM file.
        image: as ITK read it.
        on_warning: is told that the distance between the frames is a guess.
    """
    frames = image.GetSize()[2] if image.GetDimension() > 2 else 1
    if frames < 2:
        return
    positions = _numbers(path, _POSITION, 3, frames + 1)
    if not len(positions):
        spacing = " × ".join(f"{mm:g}" for mm in image.GetSpacing()[:3])
        on_warning(
            f"{path}: its {frames} frames do not say where they lie; they are taken for slices of one stack, with a spacing of "
            f"{spacing} mm."
        )
        return
    directions = _numbers(path, _ORIENTATION, 6, frames + 1)
    turned = len(directions) > 1 and np.abs(directions - directions[0]).max() > LARGEST_TURN
    if turned or len(positions) != frames or _deviation(positions, image) > LARGEST_DEVIATION:
        raise InputError(
            f"The {frames} frames of {path} are no stack of slices at equal distances, one after the other: several phases, "
            "echoes or directions, perhaps, or some are missing. Open it in 3D Slicer, and save the volume to use as .nrrd."
        )


def _deviation(positions: np.ndarray, image: sitk.Image) -> float:
    """How far frames lie from where ITK has put them, at most, as a share of the distance between two."""
    axes = image.GetDimension()
    normal = np.array(image.GetDirection()).reshape(axes, axes)[:3, 2]
    distance_mm = image.GetSpacing()[2]
    placed = np.array(image.GetOrigin()[:3]) + distance_mm * np.arange(len(positions))[:, None] * normal
    return float(np.linalg.norm(positions - placed, axis=1).max() / distance_mm)


def _in_sequence(sequence: bytes, element: bytes) -> re.Pattern[bytes]:
    """An element that is the first of the one item in a sequence, in little-endian files, with types written or without."""
    return re.compile(
        re.escape(sequence)
        + rb"(?:SQ\0\0)?.{4}\xfe\xff\x00\xe0.{4}"
        + re.escape(element)
        + rb"(?:DS(?P<a>.)\0|(?P<b>.)\0\0\0)",
        re.DOTALL,
    )


_POSITION = _in_sequence(b"\x20\x00\x13\x91", b"\x20\x00\x32\x00")
_ORIENTATION = _in_sequence(b"\x20\x00\x16\x91", b"\x20\x00\x37\x00")


def _numbers(path: Path, element: re.Pattern[bytes], count: int, most: int) -> np.ndarray:
    """The values of an element wherever it occurs, (N, `count`), N at most `most`; (0, `count`) where one is no such value."""
    values = []
    try:
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            for match in islice(element.finditer(content), most):
                length = ord(match["a"] or match["b"])
                values.append([float(number) for number in content[match.end() : match.end() + length].split(b"\\")])
        return np.array(values, dtype=float).reshape(-1, count)
    except OSError as error:
        raise InputError(f"Cannot read {path}: {error.strerror or error}.") from error
    except ValueError:
        return np.empty((0, count))
