"""Positions and intensity scales of the frames of multi-frame DICOM files, which ITK always reads as one regular stack.

Enhanced images give both for each frame in functional groups (DICOM PS3.3, C.7.6.16.2), to which ITK gives no access. It reads
two consecutive phases, frames in any order, and planes in several directions as one volume. If distances differ, even by
rounding, it sets all spacings to 1 mm, also within the plane, and reads descending frames as ascending ones. If frames have
different scales, it applies that of the first to all. Of some kinds of images, such as tomographies of the eye (OCT), it reads
no positions and directions.
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
"""Distances between frames are equal if they differ by at most this share. Frames closer than this share of the median distance
lie at the same place."""

LARGEST_TURN = 0.01
"""Largest difference between entries of the frames' directions, which allows for rounding."""

POSITION, ORIENTATION, PIXEL_SIZE = "0020|0032", "0020|0037", "0028|0030"
"""Tags of the position of a slice's first pixel, the directions of its rows and columns, and the spacing of its pixels."""


def frame_positions(path: Path, image: sitk.Image, on_warning: Callable[[str], None]) -> np.ndarray | None:
    """Read the positions of a file's frames; also restores the image's spacing, origin and directions if ITK has lost them.

    Args:
        path: path of the DICOM file.
        image: the image as ITK read it; its spacing, origin and directions may be changed.
        on_warning: called with a message if the distance between the frames is a guess, or if some seem to be missing.

    Returns:
        Position of the first pixel of each frame, (K, 3) LPS millimetres; None for a single frame, or if the file has no
        positions.

    Raises:
        InputError: the file cannot be read, or the frames are not a single stack of consecutive slices.
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
    if len(directions):
        _restore_place(image, directions[0].reshape(2, 3), positions)
    heights = _heights(positions, image)
    if turned or len(positions) != frames or not _in_order(heights) or not _has_pixel_size(path, image, heights):
        raise InputError(
            f"The {frames} frames of {path} are no stack of slices, one after the other: several phases, echoes or directions, "
            "perhaps. Open it in 3D Slicer, and save the volume to use as .nrrd."
        )
    warn_of_gaps(path, heights, [f"frame {number}" for number in range(1, frames + 1)], on_warning)
    return positions


def says_of_frames(path: Path, tag: str) -> bool:
    """Whether a DICOM file has `POSITION`, `ORIENTATION` or `PIXEL_SIZE` in functional groups, where ITK finds it.

    Such a file may have a single frame, and be one slice of a series.

    Raises:
        InputError: the file cannot be read.
    """
    return len(_numbers(path, *_IN_GROUPS[tag], most=1)) > 0


def with_frame_scales(path: Path, image: sitk.Image) -> sitk.Image:
    """Apply to each frame of a DICOM file its own scale.

    Args:
        path: path of the file.
        image: the image as ITK read it, with the scale of the first frame for all.

    Returns:
        The rescaled image, in float32; the same image if all frames have one scale.

    Raises:
        InputError: the file cannot be read, or scales differ and some frames have none.
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
    """Positions of the frames along their normal, (K,), millimetres."""
    axes = image.GetDimension()
    heights: np.ndarray = positions @ np.array(image.GetDirection()).reshape(axes, axes)[:3, 2]
    return heights


def _restore_place(image: sitk.Image, in_plane: np.ndarray, positions: np.ndarray) -> None:
    """Give the image the first frame's origin, and its directions (2, 3) of rows and columns if ITK has others."""
    axes = image.GetDimension()
    image.SetOrigin((*positions[0].tolist(), *image.GetOrigin()[3:]))
    directions = np.array(image.GetDirection()).reshape(axes, axes)
    normal = np.cross(*in_plane)
    is_valid = abs(np.linalg.norm(normal) - 1.0) <= LARGEST_TURN
    if is_valid and np.abs(directions[:3, :2].T - in_plane).max() > LARGEST_TURN:
        normal *= np.copysign(1.0, normal @ (positions[-1] - positions[0]))
        directions[:3, :3] = np.stack([*in_plane, normal], axis=1)
        image.SetDirection(directions.ravel().tolist())


def _in_order(heights: np.ndarray) -> bool:
    """Whether each frame lies beyond the one before."""
    steps = np.diff(heights) * np.sign(heights[-1] - heights[0])
    return bool((steps > SAME_DISTANCE * np.median(np.abs(steps))).all())


def _has_pixel_size(path: Path, image: sitk.Image, heights: np.ndarray) -> bool:
    """Whether the image's pixel size is known and the same in all frames; if ITK has lost it, it is restored.

    With it, ITK loses the distance between frames and their direction, which are restored as well.
    """
    across_mm, down_mm, distance_mm, *further = image.GetSpacing()
    distances = np.abs(np.diff(heights))
    fits = bool(np.abs(distances - distance_mm).max() <= SAME_DISTANCE * distance_mm)
    sizes = _numbers(path, _PIXEL_SPACING, 2, len(heights) + 1)
    if not (sizes == sizes[:1]).all():
        return False
    # 1 mm along all axes may be the spacing of the file, or the value by which ITK has replaced another one.
    if not len(sizes) or (fits and (across_mm, down_mm, distance_mm) != (1.0, 1.0, 1.0)):
        return fits
    if not (sizes[0] > 0.0).all():
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
    """Patterns that find an element in files of either byte order; the group that matches is the length of the value."""

    little_endian: re.Pattern[bytes]
    big_endian: re.Pattern[bytes]


def _in_sequence(sequence: bytes, element: bytes, behind: int = 0) -> _Element:
    """Patterns for an element in the only item of a sequence, with explicit or implicit types.

    Args:
        sequence: tag of the sequence, as in little-endian files.
        element: tag of the element, likewise.
        behind: largest number of bytes of other elements before it.
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
    """A tag, which is two numbers of two bytes each, in the other byte order."""
    return bytes((tag[1], tag[0], tag[3], tag[2]))


_POSITION = _in_sequence(b"\x20\x00\x13\x91", b"\x20\x00\x32\x00")
_ORIENTATION = _in_sequence(b"\x20\x00\x16\x91", b"\x20\x00\x37\x00")
# The elements before it are slice thickness and spacing between slices, two numbers as text.
_PIXEL_SPACING = _in_sequence(b"\x28\x00\x10\x91", b"\x28\x00\x30\x00", behind=64)
_IN_GROUPS = {POSITION: (_POSITION, 3), ORIENTATION: (_ORIENTATION, 6), PIXEL_SIZE: (_PIXEL_SPACING, 2)}
"""For each tag, the element in functional groups, and how many numbers it has."""
_INTERCEPT = _in_sequence(b"\x28\x00\x45\x91", b"\x28\x00\x52\x10")
# The element before it is the intercept.
_SLOPE = _in_sequence(b"\x28\x00\x45\x91", b"\x28\x00\x53\x10", behind=32)


def _numbers(path: Path, element: _Element, count: int, most: int) -> np.ndarray:
    """The values of all occurrences of an element, (N, `count`) with N ≤ `most`; (0, `count`) if one cannot be parsed."""
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
