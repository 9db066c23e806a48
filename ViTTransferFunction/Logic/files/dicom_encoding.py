"""In which encoding a DICOM file's elements are, whether memory has room for deflated ones, and whether all pixels are there.

ITK unpacks them whatever comes: a megabyte can become a gigabyte. Of an element with fewer pixels than the header promises, it
reads on into memory that holds something else.
"""

from __future__ import annotations

import mmap
import re
import zlib
from pathlib import Path

from ..core.system.available_memory import require_memory
from ..core.system.errors import InputError
from ..core.system.regular_file import cannot_read
from .file_start import DICOM_START_BYTES
from .stored_voxels import CHUNK_BYTES

DEFLATED, BIG_ENDIAN = b"1.2.840.10008.1.2.1.99", b"1.2.840.10008.1.2.2"
"""Transfer syntaxes; those that are left are little-endian and not packed, but for the pixels."""
_PLAIN = (b"1.2.840.10008.1.2", b"1.2.840.10008.1.2.1")
"""Those that are little-endian and not packed at all, with implicit and explicit types."""

_META = re.compile(rb"\x02\x00\x00\x00UL\x04\x00(.{4})", re.DOTALL)
"""How long what describes the file itself is, which is always in little-endian order and never deflated (DICOM PS3.10, 7.1)."""
_TRANSFER_SYNTAX = re.compile(rb"\x02\x00\x10\x00UI..([0-9.]+)", re.DOTALL)

_PIXELS = re.compile(rb"\xe0\x7f\x10\x00(?:O[BW]\0\0)?(.{4})", re.DOTALL)
"""Pixels of the image, or of a small picture of it, and how many bytes they have."""

_COPIES = 2
"""Of the unpacked elements: ITK's, and that in which places and scales of frames are looked for."""


def data_set(written: mmap.mmap) -> tuple[int, bytes]:
    """At which byte of a file its elements begin, and their transfer syntax; b"" where the file does not say."""
    meta = _META.match(written, DICOM_START_BYTES)
    start = meta.end() + int.from_bytes(meta[1], "little") if meta else 0
    found = _TRANSFER_SYNTAX.search(written, 0, start)
    return start, found[1] if found else b""


def lacks_pixels(path: Path, promised: int) -> bool:
    """Whether a file has fewer bytes of pixels than its header promises; False if they are compressed or big-endian.

    Args:
        path: of the file.
        promised: bytes of all pixels, by the numbers of rows, columns and frames, and the bits of each pixel.

    Raises:
        InputError: the file cannot be read.
    """
    try:
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as written:
            start, syntax = data_set(written)
            if syntax not in _PLAIN:
                return False
            # The image's own are mostly the first, and those of a small picture are fewer.
            found = False
            for match in _PIXELS.finditer(written, start):
                if int.from_bytes(match[1], "little") >= promised:
                    return False
                found = True
            return found
    except ValueError:
        return False  # An empty file, of which ITK says more.
    except OSError as error:
        raise cannot_read(path, error) from error


def require_memory_to_unpack(path: Path) -> None:
    """Raise InputError where a file's elements are deflated and memory has no room for them; or where it cannot be read."""
    try:
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as written:
            start, syntax = data_set(written)
            if syntax == DEFLATED:
                _require_memory(written, start, path)
    except InputError:
        raise
    except OSError as error:
        raise cannot_read(path, error) from error
    except (ValueError, zlib.error):
        return  # An empty or damaged file, of which ITK says more.


def _require_memory(written: mmap.mmap, start: int, path: Path) -> None:
    unpacker, unpacked_bytes = zlib.decompressobj(-zlib.MAX_WBITS), 0
    advice = "Close other programs, or export the file again without compression."
    for begin in range(start, len(written), CHUNK_BYTES):
        packed = written[begin : begin + CHUNK_BYTES]
        while packed and not unpacker.eof:
            unpacked_bytes += len(unpacker.decompress(packed, 16 * CHUNK_BYTES))
            packed = unpacker.unconsumed_tail
            require_memory(_COPIES * unpacked_bytes, f"Unpacking {path}", advice)
