"""Files that the browser sends: kept in a private folder while the app runs, and never taken at their word."""

from __future__ import annotations

import shutil
import unicodedata
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath
from typing import BinaryIO

from aiohttp import BodyPartReader, web
from aiohttp.http_exceptions import HttpProcessingError

from ..Logic.core.system.errors import InputError, shown
from ..Logic.core.system.file_names import LONGEST_NAME_BYTES, kept_name
from ..Logic.files.dicom_folder import is_of_system
from ..Logic.files.file_start import DICOM_START_BYTES, is_dicom_start
from ..Logic.files.image_formats import check_no_archive, image_ending, locate_voxels, named_voxels
from .points_file import POINTS_ENDING, are_points

LARGEST_UPLOAD = 4 << 30
"""Bytes of all files that are sent together: a CT of 1024×1024×2048 voxels."""

MOST_FILES = 10_000
"""Sent together. Each is a slice."""

DISK_TO_SPARE = 1 << 30
"""Bytes that an upload leaves free: other programs need the disk as well."""

_CHUNK = 1 << 20
_BESIDE_HEADERS = (".raw", ".raw.gz", ".zraw")
_SCENES = (".mrb",)


async def receive_files(request: web.Request, folder: Path) -> list[Path]:
    """Write the files of a multipart request to `folder`, piece by piece as they come.

    Args:
        request: as a form or `FormData` is sent; fields without a file name are passed over.
        folder: where to: one that only the user can enter (`tempfile`). Nothing in it is overwritten.

    Returns:
        The files, in the order in which they were sent. Names are kept as far as they are harmless. What systems write where a
        folder is looked at, as `.DS_Store`, is passed over; so are points, which are sent by themselves, and what lies beside
        slices of DICOM, as viewers and notes do.

    Raises:
        InputError: not a multipart request, too large, too many, a file that is no image where there are no slices, or a header
            that names voxels outside of the folder; or they cannot be kept. None of the request's files is left then.
    """
    received: list[Path] = []
    try:
        _check_size(request.content_length or 0, folder)
        if not request.content_type.startswith("multipart/"):
            raise InputError(f"Files were sent as {shown(request.content_type)}; expected multipart/form-data.")
        await _receive(request, folder, received)
    except BaseException as error:
        for path in received:
            _remove(path)
        if isinstance(error, OSError):
            raise InputError(f"The files cannot be kept: {error.strerror or error}. Make room, and send them again.") from error
        raise
    return received


async def _receive(request: web.Request, folder: Path, received: list[Path]) -> None:
    """Write the files to `folder`, and append those that can be opened to `received`; see `receive_files`."""
    foreign, has_slices = await _written(request, folder, received)
    named = _named_as_voxels(received, folder)
    foreign = [path for path in foreign if path not in named]
    if not are_points(received):
        foreign += [path for path in received if are_points([path])]
    for path in foreign:
        _remove(path)
    # All at once: a folder may have thousands of files that are no slices.
    left_out = set(foreign)
    received[:] = [path for path in received if path not in left_out]
    for path in received:
        _check_voxels_are_inside(path, folder)
    if foreign and not has_slices:
        check_no_archive(foreign[0].name)
        raise InputError(
            f"{shown(foreign[0].name)} is of no known format; expected DICOM, NIfTI (.nii, .nii.gz), NRRD (.nrrd), "
            "MetaImage (.mha), a saved session (.mrb), or points by themselves (.annotations.json)."
        )
    if not received:
        raise InputError("No file was sent.")


async def _written(request: web.Request, folder: Path, received: list[Path]) -> tuple[list[Path], bool]:
    """Write the files to `folder`, and append all of them to `received`.

    Returns:
        Those of no known kind, and whether there are slices of DICOM.

    Raises:
        InputError: the files are too large or too many, or do not arrive whole.
    """
    total, has_slices = 0, False
    foreign: list[Path] = []
    try:
        reader = await request.multipart()
        while (part := await reader.next()) is not None:
            if not isinstance(part, BodyPartReader) or not part.filename or is_of_system(_last_part(part.filename)):
                continue
            if len(received) - len(foreign) == MOST_FILES:
                raise InputError(f"More than {MOST_FILES} files at once; send one series alone.")
            file, path = _create(folder, part.filename)
            received.append(path)
            with file:
                start = b""
                while chunk := await part.read_chunk(_CHUNK):
                    total += len(chunk)
                    _check_size(total, folder)
                    start += chunk[: DICOM_START_BYTES - len(start)]
                    file.write(chunk)
            if not _is_known(path, start):
                foreign.append(path)
            has_slices = has_slices or is_dicom_start(start)
    except InputError:
        raise
    except (ValueError, HttpProcessingError, web.RequestPayloadError, ConnectionError) as error:
        raise InputError("The files did not arrive whole; send them again.") from error
    return foreign, has_slices


def _named_as_voxels(received: list[Path], folder: Path) -> set[Path]:
    """Where headers among the files say that their voxels are, which may have any name."""
    names = [named_voxels(path) for path in received if image_ending(path) is not None]
    return {folder / name for name in names if name is not None}


def _remove(path: Path) -> None:
    """Remove a file that is not wanted; where Windows refuses, since a virus scanner has it, it goes with its folder."""
    with suppress(OSError):
        path.unlink()


def _check_size(size: int, folder: Path) -> None:
    if size > LARGEST_UPLOAD:
        raise InputError(
            f"The files are larger than {LARGEST_UPLOAD >> 30} GB together, which is the most that may be sent. Copy them to "
            "the computer that the app runs on, and open them by their path."
        )
    if size and shutil.disk_usage(folder).free < DISK_TO_SPARE:
        raise InputError(f"The disk of the computer that the app runs on is full ({folder}). Make room, and send them again.")


def _create(folder: Path, name: str) -> tuple[BinaryIO, Path]:
    """A new file under the harmless part of a name."""
    for candidate in _candidates(_harmless(name)):
        path = folder / candidate
        try:
            return path.open("xb"), path
        except FileExistsError:
            continue
    raise AssertionError("names do not end")


def _harmless(name: str) -> str:
    """The last part of a name as a file's that every system takes; no hidden file, and no option of a program."""
    # Macs send a letter and its accent apart.
    last = unicodedata.normalize("NFC", _last_part(name)).rstrip(". ")
    # The end, which tells what it is.
    end = last.encode(errors="replace")[-LONGEST_NAME_BYTES:].decode(errors="ignore")
    return kept_name(end.lstrip(".- "))


def _last_part(name: str) -> str:
    return PurePosixPath(name.replace("\\", "/")).name


def _candidates(name: str) -> Iterator[str]:
    """The name itself, then ones with a number: folders of a series have files of equal names."""
    yield name
    stem, dot, ending = name.partition(".")
    for number in range(2, MOST_FILES + 2):
        yield f"{stem}-{number}{dot}{ending}"


def _is_known(path: Path, start: bytes) -> bool:
    """Whether a file is of a kind that can be opened, by its name or by its first bytes."""
    known = image_ending(path) is not None or path.name.lower().endswith((*_BESIDE_HEADERS, *_SCENES, POINTS_ENDING))
    return known or is_dicom_start(start)


def _check_voxels_are_inside(path: Path, folder: Path) -> None:
    """A header may name any file of the computer as that of its voxels."""
    if image_ending(path) is None:
        return
    try:
        stored = locate_voxels(path)
    except InputError as error:
        # The user has it in another folder, of which we do not know.
        raise InputError(str(error).replace(str(path), path.name)) from error
    if stored is not None and folder.resolve() not in stored.path.resolve().parents:
        raise InputError(f"{path.name} names a file elsewhere as that of its voxels. Save it as one file, .nrrd say.")
