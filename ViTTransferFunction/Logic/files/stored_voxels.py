"""The bytes of an image's voxels as its file stores them, and whether all are there.

ITK fills up with zeros what a NIfTI file lacks, takes damaged streams of NIfTI and MetaImage as they come, and reports a file
as written that the full disk did not take. So voxels are counted before ITK reads them, and compared after it wrote them. Of
NIfTI's floating-point numbers it makes zeros where they are not finite: those are looked up in the file. Each
needs the memory of one chunk, and the time of unpacking the file once: about a second for 512³ voxels of 16 bits.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..core.system.errors import InputError
from ..core.system.regular_file import cannot_read

CHUNK_BYTES = 1 << 20

_MOST_TRAILING_BYTES = 1 << 24
"""Beyond the voxels a stream is read to its end, where its checksum is, unless more than this follows: it may never end."""

_GZIP_OR_ZLIB = zlib.MAX_WBITS | 32


@dataclass(frozen=True)
class StoredVoxels:
    """Where an image's voxels are stored.

    Attributes:
        path: the file that holds them: the image's own, or the one that its header names.
        start: the byte of that file at which they begin, or the compressed stream does; None: they are the file's last bytes.
        compressed: whether they are in a stream of gzip or zlib.
        skipped: bytes of that stream before the voxels.
        voxel_bytes: size of a stored voxel, where it may be of another type than ITK makes of it; None: it is not.
        floats: their type, where ITK makes zeros of those that are not finite; None: it does not.
    """

    path: Path
    start: int | None = 0
    compressed: bool = False
    skipped: int = 0
    voxel_bytes: int | None = None
    floats: np.dtype | None = None

    def check_complete(self, count: int) -> None:
        """Raise InputError unless all of `count` bytes of voxels are there, and undamaged as far as checksums tell."""
        if self.compressed:
            for _ in self.chunks(count):
                pass
        else:
            self._plain_start(count)

    def hold(self, array: np.ndarray) -> bool:
        """Whether they are the bytes of `array`, all of them. Raises InputError where the file is not complete."""
        expected = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
        position = 0
        for chunk in self.chunks(expected.size):
            if not np.array_equal(np.frombuffer(chunk, np.uint8), expected[position : position + len(chunk)]):
                return False
            position += len(chunk)
        return True

    def restore_not_finite(self, array: np.ndarray) -> None:
        """Make NaN, in place, of what ITK read as zero into `array` (K, J, I) where no finite number is stored.

        Raises:
            InputError: the file is not complete.
        """
        if self.floats is None:
            return
        voxels, position, rest = array.reshape(-1), 0, b""
        for chunk in self.chunks(voxels.size * self.floats.itemsize):
            stored = rest + chunk
            values = np.frombuffer(stored, self.floats, len(stored) // self.floats.itemsize)
            voxels[position : position + len(values)][~np.isfinite(values)] = np.nan
            position, rest = position + len(values), stored[values.nbytes :]

    def chunks(self, count: int) -> Iterator[bytes]:
        """The `count` bytes of the voxels, unpacked, a part at a time. Raises InputError where some are missing."""
        try:
            with self.path.open("rb") as file:
                yield from self._unpacked(file, count) if self.compressed else self._plain(file, count)
        except OSError as error:
            raise cannot_read(self.path, error) from error

    def _plain(self, file: BinaryIO, count: int) -> Iterator[bytes]:
        file.seek(self._plain_start(count))
        while count and (chunk := file.read(min(count, CHUNK_BYTES))):
            count -= len(chunk)
            yield chunk

    def _plain_start(self, count: int) -> int:
        size = self.path.stat().st_size
        start = size - count if self.start is None else self.start
        if start < 0 or size < start + count:
            raise self._incomplete(max(0, size - max(start, 0)), count)
        return start

    def _unpacked(self, file: BinaryIO, count: int) -> Iterator[bytes]:
        file.seek(self.start or 0)
        begin, end = self.skipped, self.skipped + count
        position = 0
        for data in self._stream(file):
            part = data[max(0, begin - position) : max(0, end - position)]
            position += len(data)
            if part:
                yield part
            if position > end + _MOST_TRAILING_BYTES:
                return
        if position < end:
            raise self._incomplete(max(0, position - begin), count)

    def _stream(self, file: BinaryIO) -> Iterator[bytes]:
        """The stream's content; several streams of gzip may follow each other. Ends early where the file does."""
        packed = b""
        unpacker = zlib.decompressobj(_GZIP_OR_ZLIB)
        try:
            while True:
                packed = packed or file.read(CHUNK_BYTES)
                data = unpacker.decompress(packed, CHUNK_BYTES)
                if data:
                    yield data
                if unpacker.eof:
                    packed = unpacker.unused_data or file.read(CHUNK_BYTES)
                    if not packed.startswith(b"\x1f\x8b"):
                        return
                    unpacker = zlib.decompressobj(_GZIP_OR_ZLIB)
                    continue
                if not packed and not data:
                    raise InputError(f"{self.path} is cut off: its compressed voxels end too early. {_ADVICE}")
                packed = unpacker.unconsumed_tail
        except zlib.error as error:
            raise InputError(f"{self.path} is damaged: its compressed voxels cannot be unpacked. {_ADVICE}") from error

    def _incomplete(self, found: int, count: int) -> InputError:
        return InputError(f"{self.path} is cut off: it holds {found} of the {count} bytes that its header promises. {_ADVICE}")


_ADVICE = "Copy or save it again."
