"""What takes long about saving: compressing. It knows nothing of the scene, so that a thread can do it while the page goes on.

Each function calls `progress` with the bytes done so far, which may raise to stop it.
"""

from __future__ import annotations

import errno
import math
import os
import zipfile
import zlib
from pathlib import Path
from typing import BinaryIO

from ..Logic.core.system.progress import Progress, no_progress

COMPRESSING = "Compressing"
LEVEL = 1
"""Of zlib, 1 to 9. Of a CT, the highest saves some per cent more and takes many times as long."""
_CHUNK = 1 << 20
_ZIP64_BYTES = 1 << 31
_GZIP_BITS = 31
"""What zlib calls its largest window in a gzip file."""
_NRRD_TYPES = {
    1: (b"signed char", b"unsigned char"),
    2: (b"short", b"unsigned short"),
    4: (b"int", b"unsigned int", b"float"),
    8: (b"long long int", b"unsigned long long int", b"double"),
}
_VOXEL_BYTES = {name: size for size, names in _NRRD_TYPES.items() for name in names}
"""By the type's name in a header, as Slicer and ITK write it."""


def zip_folder(folder: Path, path: Path, progress: Progress = no_progress) -> None:
    """Put a folder with all that is in it into a new archive; its files are removed one by one as they are in.

    Raises:
        OSError: it cannot be written.
    """
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    done, total = 0, sum(file.stat().st_size for file in files)
    with zipfile.ZipFile(path, "x", zipfile.ZIP_DEFLATED, compresslevel=LEVEL) as archive:
        for file in files:
            name = file.relative_to(folder.parent).as_posix()
            large = file.stat().st_size >= _ZIP64_BYTES
            with file.open("rb") as source, archive.open(name, "w", force_zip64=large) as target:
                while chunk := source.read(_CHUNK):
                    target.write(chunk)
                    done += len(chunk)
                    progress(done, total, COMPRESSING)
            # So that the disk holds the voxels once.
            file.unlink()


def gzip_nrrd(raw: Path, path: Path, progress: Progress = no_progress) -> None:
    """Write a NRRD file with its voxels compressed to a new one.

    Args:
        raw: its voxels stand in it after the header, uncompressed.
        path: the new file.
        progress: called with bytes compressed; may raise to cancel.

    Raises:
        OSError: it cannot be written, or voxels lack in `raw`, for which the disk had no room.
        ValueError: `raw` is no such file.
    """
    with raw.open("rb") as source, path.open("xb") as target:
        header = _header(source)
        for line in header:
            target.write(b"encoding: gzip\n" if line == b"encoding: raw\n" else line)
        done, total = source.tell(), raw.stat().st_size
        # Slicer does not notice where it was only the last of them.
        if total < done + _promised_bytes(header):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        packer = zlib.compressobj(LEVEL, zlib.DEFLATED, _GZIP_BITS)
        while chunk := source.read(_CHUNK):
            target.write(packer.compress(chunk))
            done += len(chunk)
            progress(done, total, COMPRESSING)
        target.write(packer.flush())


def _header(nrrd: BinaryIO) -> list[bytes]:
    """The lines of a header, with the empty one that ends it."""
    lines = [nrrd.readline()]
    while lines[-1] not in (b"\n", b""):
        lines.append(nrrd.readline())
    if not lines[0].startswith(b"NRRD") or b"encoding: raw\n" not in lines or lines[-1] != b"\n":
        raise ValueError("no NRRD file of uncompressed voxels")
    return lines


def _promised_bytes(header: list[bytes]) -> int:
    """How many bytes of voxels there are by a header; 0 where it is not one as Slicer writes."""
    fields = dict(line.rstrip().split(b": ", 1) for line in header if b": " in line)
    return math.prod(map(int, fields.get(b"sizes", b"0").split())) * _VOXEL_BYTES.get(fields.get(b"type", b""), 0)
