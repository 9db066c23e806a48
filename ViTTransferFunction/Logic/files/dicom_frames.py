"""Where the frames of a DICOM file lie that has several, and in which scale: ITK takes them for one stack, whatever they are.

Enhanced images say it of each frame, in functional groups (DICOM PS3.3, C.7.6.16.2), which ITK does not show. Two phases, one
after the other, frames in any order, and planes in several directions are all read as one volume; where the distances differ,
be it by rounding, all spacings become 1 mm, within the plane too, and frames that descend ascend. Where each frame is scaled in
a way of its own, all get the scale of the first.
"""

from __future__ import annotations

import mmap
import re
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import SimpleITK as sitk  # noqa: N813

from ..core.system.errors import InputError
from ..core.system.regular_file import cannot_read
from .dicom_encoding import BIG_ENDIAN, DEFLATED, data_set
from .straightening import warn_of_gaps

SAME_DISTANCE = 0.01
"""Distances between frames that differ by no more than this share are equal, and one as small is none."""

LARGEST_TURN = 0.01
"""By which entries of the frames' directions may differ: that of rounding."""

POSITION, ORIENTATION, PIXEL_SIZE = "0020|0032", "0020|0037", "0028|0030"
"""Tags of where the first pixel of a slice lies, of how its rows and columns run, and of how far apart its pixels are."""


def frame_positions(path: Path, image: sitk.Image, on_warning: Callable[[str], None]) -> np.ndarray | None:
    """Where the frames of a file lie; the image is given the size of their pixels, and their order, where ITK has lost it.

    Args:
        path: a DICOM file.
        image: as ITK read it.
        on_warning: is told that the distance between the frames is a guess, or where some seem to be missing.

    Returns:
        Of the first pixel of each frame, (K, 3) LPS millimetres; None of a single frame, or where the file does not say.

    Raises:
        InputError: they are no stack of slices, one after the other.
    """
    frames = _frame_count(image)
    if frames < 2:
        return None
    positions = _numbers(path, _POSITION, 3, frames + 1)
    if not len(positions):
        spacing = " × ".join(f"{mm:g}" for mm in image.GetSpacing()[:3])
        on_warning(
            f"{path}: its {frames} frames do not say where they lie; they are taken for slices of one stack, with a spacing of "
            f"{spacing} mm."
        )
        return None
    directions = _numbers(path, _ORIENTATION, 6, frames + 1)
    turned = len(directions) > 1 and np.abs(directions - directions[0]).max() > LARGEST_TURN
    heights = _heights(positions, image)
    if turned or len(positions) != frames or not _in_order(heights) or not _has_pixel_size(path, image, heights):
        raise InputError(
            f"The {frames} frames of {path} are no stack of slices, one after the other: several phases, echoes or directions, "
            "perhaps. Open it in 3D Slicer, and save the volume to use as .nrrd."
        )
    warn_of_gaps(path, heights, [f"frame {number}" for number in range(1, frames + 1)], on_warning)
    return positions


def says_of_frames(path: Path, tag: str) -> bool:
    """Whether a DICOM file says `POSITION`, `ORIENTATION` or `PIXEL_SIZE` in functional groups, from where ITK takes it.

    An enhanced image may have a single frame, and be one of the slices of a series.

    Raises:
        InputError: it cannot be read.
    """
    return len(_numbers(path, *_IN_GROUPS[tag], most=1)) > 0


def with_frame_scales(path: Path, image: sitk.Image) -> sitk.Image:
    """The image of a DICOM file, each of its frames in its own scale.

    Args:
        path: of the file.
        image: as ITK read it, all frames in the scale of the first.

    Returns:
        The image itself where that is the scale of all.

    Raises:
        InputError: not every frame has a scale, though they differ.
    """
    frames = _frame_count(image)
    slopes, intercepts = (_numbers(path, element, 1, frames + 1) for element in (_SLOPE, _INTERCEPT))
    if (slopes == slopes[:1]).all() and (intercepts == intercepts[:1]).all():
        return image
    if len(slopes) != frames or len(intercepts) != frames:
        raise InputError(
            f"{path} does not say of each of its {frames} frames how it is scaled, and not all are scaled alike. Open it in 3D "
            "Slicer, look whether it is right there, and save it as .nrrd."
        )
    factors = slopes / slopes[0]
    offsets = intercepts - factors * intercepts[0]
    array = sitk.GetArrayFromImage(image).astype(np.float32)
    array *= factors[..., None].astype(np.float32)
    array += offsets[..., None].astype(np.float32)
    scaled = sitk.GetImageFromArray(array, isVector=False)
    scaled.CopyInformation(image)
    return scaled


def _frame_count(image: sitk.Image) -> int:
    return int(image.GetSize()[2]) if image.GetDimension() > 2 else 1


def _heights(positions: np.ndarray, image: sitk.Image) -> np.ndarray:
    """Where frames lie along their normal, (K,), millimetres."""
    axes = image.GetDimension()
    heights: np.ndarray = positions @ np.array(image.GetDirection()).reshape(axes, axes)[:3, 2]
    return heights


def _in_order(heights: np.ndarray) -> bool:
    """Whether each lies beyond the one before."""
    steps = np.diff(heights) * np.sign(heights[-1] - heights[0])
    return bool((steps > SAME_DISTANCE * np.median(np.abs(steps))).all())


def _has_pixel_size(path: Path, image: sitk.Image, heights: np.ndarray) -> bool:
    """Whether the image has the size of its pixels; it is given that where ITK has lost it together with the distances.

    What it has lost as well is which way the frames follow each other.
    """
    across_mm, down_mm, distance_mm, *further = image.GetSpacing()
    distances = np.abs(np.diff(heights))
    fits = bool(np.abs(distances - distance_mm).max() <= SAME_DISTANCE * distance_mm)
    # A millimetre along all axes may be the spacing of a file, and may be what ITK has put in the place of another one.
    if fits and (across_mm, down_mm, distance_mm) != (1.0, 1.0, 1.0):
        return True
    sizes = _numbers(path, _PIXEL_SPACING, 2, len(heights) + 1)
    if not len(sizes):
        return fits
    if not (sizes == sizes[0]).all() or not (sizes[0] > 0.0).all():
        return False
    down_mm, across_mm = sizes[0].tolist()
    image.SetSpacing((across_mm, down_mm, float(distances.mean()), *further))
    if heights[-1] < heights[0]:
        directions = np.array(image.GetDirection()).reshape(image.GetDimension(), -1)
        directions[:, 2] *= -1.0
        image.SetDirection(directions.ravel().tolist())
    return True


@dataclass(frozen=True)
class _Element:
    """How an element is found in files of either order of bytes; its group that matches is how long the value is."""

    little_endian: re.Pattern[bytes]
    big_endian: re.Pattern[bytes]


def _in_sequence(sequence: bytes, element: bytes, behind: int = 0) -> _Element:
    """An element in the one item of a sequence, with types written or without.

    Args:
        sequence: its tag, as written in little-endian files.
        element: likewise.
        behind: how many bytes other elements before it may take.
    """
    before = rb".{0,%d}?" % behind
    item = b"\xfe\xff\x00\xe0"
    little = re.escape(sequence) + rb"(?:SQ\0\0)?.{4}" + re.escape(item) + rb".{4}" + before + re.escape(element)
    sequence, element, item = (_pairs_swapped(tag) for tag in (sequence, element, item))
    big = re.escape(sequence) + rb"SQ\0\0.{4}" + re.escape(item) + rb".{4}" + before + re.escape(element)
    return _Element(
        re.compile(little + rb"(?:DS(.)\0|(.)\0\0\0)", re.DOTALL),
        re.compile(big + rb"DS\0(.)", re.DOTALL),
    )


def _pairs_swapped(tag: bytes) -> bytes:
    """A tag, two numbers of two bytes each, in the other order of bytes."""
    return bytes((tag[1], tag[0], tag[3], tag[2]))


_POSITION = _in_sequence(b"\x20\x00\x13\x91", b"\x20\x00\x32\x00")
_ORIENTATION = _in_sequence(b"\x20\x00\x16\x91", b"\x20\x00\x37\x00")
# Before it are how thick a slice is and how far it is to the next, two numbers as text.
_PIXEL_SPACING = _in_sequence(b"\x28\x00\x10\x91", b"\x28\x00\x30\x00", behind=64)
_IN_GROUPS = {POSITION: (_POSITION, 3), ORIENTATION: (_ORIENTATION, 6), PIXEL_SIZE: (_PIXEL_SPACING, 2)}
"""Where each is in functional groups, and how many numbers it has."""
_INTERCEPT = _in_sequence(b"\x28\x00\x45\x91", b"\x28\x00\x52\x10")
# Before it is the intercept.
_SLOPE = _in_sequence(b"\x28\x00\x45\x91", b"\x28\x00\x53\x10", behind=32)


def _numbers(path: Path, element: _Element, count: int, most: int) -> np.ndarray:
    """The values of an element wherever it occurs, (N, `count`), N at most `most`; (0, `count`) where one is no such value."""
    values = []
    try:
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as written:
            start, syntax = data_set(written)
            content = zlib.decompressobj(-zlib.MAX_WBITS).decompress(written[start:]) if syntax == DEFLATED else written
            pattern = element.big_endian if syntax == BIG_ENDIAN else element.little_endian
            for match in islice(pattern.finditer(content), most):
                length = ord(match[match.lastindex or 0])
                values.append([float(number) for number in content[match.end() : match.end() + length].split(b"\\")])
        return np.array(values, dtype=float).reshape(-1, count)
    except OSError as error:
        raise cannot_read(path, error) from error
    except (ValueError, zlib.error):
        return np.empty((0, count))
