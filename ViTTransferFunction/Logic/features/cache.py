"""Features kept on disk, so that a volume that was opened before is ready at once."""

from __future__ import annotations

import io
import logging
import lzma
import math
import os
import re
import shutil
import stat
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TypeVar, cast

import numpy as np

from ..core.atomic_file import TEMPORARY, replacing
from ..core.cache_folder import CACHE_VARIABLE, cache_folder, make_private
from ..core.errors import InputError
from ..core.geometry import Geometry
from .feature_volume import FeatureVolume
from .stored_features import ArrayInFile, StoredFeatures
from .whitening import FeatureTransform, NormalisedFeatures

logger = logging.getLogger(__name__)

DEFAULT_LIMIT_BYTES = 20 * 1024**3
SPARE_BYTES = 64 * 1024**2
"""Room that is left on the disk beyond the features themselves."""
_BLOCK_BYTES = 1 << 20
_HEADER_BYTES = 30
"""Of what stands in front of each name in a zip file."""
_TYPES = {np.dtype(name) for name in ("float16", "float32", "float64")}
"""Of values in a file; as this computer has them, in the order of bytes as well."""
_WHITENED = ("whitened", "mean", "directions")
"""What a file holds beside the features and where they lie, if they were kept with the whitened ones; the directions are the
projection's columns, which lie like that in memory: another order may give products other last digits."""
_KEY = re.compile(r"[0-9a-f]{64}")
"""A key is a SHA-256 (`feature_key`)."""
_OURS = re.compile(rf"{_KEY.pattern}|{re.escape(TEMPORARY)}.+")
"""What files are called here: by their key, or as `replacing` calls what is half-written."""


Kept = TypeVar("Kept", FeatureVolume, NormalisedFeatures)


def _default_folder() -> Path:
    return cache_folder() / "features"


class FeatureCache:
    """A folder with one `.npz` file (arrays only, never pickles) for each feature volume, named by its key.

    Whitened features may lie beside those that they were made from: then these need not be in memory, nor be whitened again.
    It only ever saves time: whatever it cannot read counts as absent, and what it cannot keep is computed again next time.
    Features are derived from patients' data: nobody but the user can read them.

    Args:
        folder: where; the user's cache folder unless given.
        limit_bytes: size beyond which the features used longest ago are removed.
    """

    def __init__(self, folder: Path | None = None, limit_bytes: int = DEFAULT_LIMIT_BYTES) -> None:
        self.folder = folder or _default_folder()
        self.limit_bytes = limit_bytes

    def get(self, key: str) -> FeatureVolume | None:
        """The features named `key`, or None. A damaged file is removed and counts as absent."""
        return self._read(key, _read_features)

    def get_whitened(self, key: str) -> NormalisedFeatures | None:
        """As `get`, the whitened features named `key`; None also where the features are kept without them."""
        return self._read(key, _read_whitened)

    def _read(self, key: str, read: Callable[[Path, str], Kept | None]) -> Kept | None:
        path = self._path(key)
        try:
            # A pipe would make its reader wait for ever.
            if path.exists() and not path.is_file():
                raise ValueError("expected an ordinary file")
            kept = read(path, key)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except (OSError, ValueError) as error:
            reason = " ".join(str(error).split())
            logger.warning("Cached features cannot be used and are computed again (%s: %s)", path, reason)
            with suppress(OSError):
                path.unlink()
            return None
        # The time of last use, which removal goes by.
        with suppress(OSError):
            os.utime(path)
        return kept

    def __contains__(self, key: str) -> bool:
        """Whether there is a file of features named `key`; whether it is sound, only `get` finds out."""
        return self._entry(self._path(key)) is not None

    def put(self, features: FeatureVolume, whitened: NormalisedFeatures | None = None) -> None:
        """Store features, whole or not at all, then remove the least recently used beyond the limit.

        `whitened` are the same ones whitened, if those are to be kept as well.

        Features that are not finite are not stored. Where the folder cannot be written to, or the disk is full, a warning says
        so once.
        """
        if not all(_all_finite(layer) for layer in features.array):
            logger.warning("The features hold values that are not numbers; they are not kept in the cache.")
            return
        path = self._path(features.key)
        try:
            make_private(self.folder)
            with replacing(path) as temporary, temporary.open("wb") as file:
                arrays = {"features": features.array, "ijk_to_ras": features.geometry.ijk_to_ras, **_arrays_of(whitened)}
                np.savez(file, **arrays)  # type: ignore[arg-type]
            path.chmod(0o600)
        except (OSError, InputError) as error:
            reason = error.strerror if isinstance(error, OSError) else error
            _warn_once(
                f"Features cannot be kept in {self.folder} and are computed again next time ({reason}). The environment "
                f"variable {CACHE_VARIABLE} can name another folder."
            )
            return
        self._evict(keep=features.key)

    def check_room(self, needed_bytes: int) -> None:
        """Raise InputError if features of this size will not fit on the disk: before minutes are spent on them."""
        try:
            existing = next(parent for parent in (self.folder, *self.folder.absolute().parents) if parent.exists())
            free = shutil.disk_usage(existing).free
        except OSError:
            return  # Nothing will be kept there, which `put` tells.
        if not os.access(existing, os.W_OK):
            return
        if free < needed_bytes + SPARE_BYTES:
            raise InputError(
                f"The disk of the cache folder {self.folder} is full: {free / 1e6:.0f} MB free, "
                f"{(needed_bytes + SPARE_BYTES) / 1e6:.0f} MB needed. "
                f"Free some space, or set the environment variable {CACHE_VARIABLE} to a folder on another disk."
            )

    def entries(self) -> list[CacheEntry]:
        """What is stored, most recently used first."""
        found = (self._entry(path) for path in self._files() if _KEY.fullmatch(path.stem))
        return sorted((entry for entry in found if entry), key=lambda entry: entry.last_used_s, reverse=True)

    def size_bytes(self) -> int:
        """Total size of what is stored."""
        return sum(entry.size_bytes for entry in self.entries())

    def clear(self) -> int:
        """Remove all features, and leftovers of interrupted writes; returns the bytes that were freed.

        Whatever else lies in the folder stays.
        """
        return sum(self._remove(entry) for entry in map(self._entry, self._files()) if entry)

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}.npz"

    def _files(self) -> list[Path]:
        """What has a name that only this class gives."""
        try:
            return [path for path in self.folder.iterdir() if path.suffix == ".npz" and _OURS.fullmatch(path.stem)]
        except OSError:
            return []

    def _entry(self, path: Path) -> CacheEntry | None:
        """What a file is; None where there is none, but perhaps a folder, a link, or one that another process has removed."""
        try:
            status = path.lstat()
        except OSError:
            return None
        return CacheEntry(path.stem, status.st_size, status.st_mtime) if stat.S_ISREG(status.st_mode) else None

    def _evict(self, keep: str) -> None:
        remaining = self.size_bytes()
        for entry in reversed(self.entries()):
            if remaining <= self.limit_bytes:
                return
            if entry.key != keep:
                remaining -= self._remove(entry)

    def _remove(self, entry: CacheEntry) -> int:
        """How many bytes that freed; none where it is gone already, or may not be removed."""
        try:
            self._path(entry.key).unlink()
        except OSError:
            return 0
        return entry.size_bytes


@dataclass(frozen=True)
class CacheEntry:
    """One stored feature volume: its key, size, and time of last use in seconds since the epoch."""

    key: str
    size_bytes: int
    last_used_s: float


def _arrays_of(whitened: NormalisedFeatures | None) -> dict[str, np.ndarray]:
    if whitened is None or whitened.transform.projection is None:
        return {}
    arrays = (whitened.array, whitened.transform.mean, whitened.transform.projection.T)
    return {name: np.ascontiguousarray(array) for name, array in zip(_WHITENED, arrays, strict=True)}


def _read_features(path: Path, key: str) -> FeatureVolume:
    """The features of a file, complete and with matching checksums.

    Raises:
        OSError: it cannot be read.
        ValueError: it is damaged.
    """
    with path.open("rb") as file, _archive(file) as archive:
        array = _read_array(archive, "features")
        return FeatureVolume(array, Geometry(array.shape[:3], _read_array(archive, "ijk_to_ras")), key)


def _read_whitened(path: Path, key: str) -> NormalisedFeatures | None:
    """The whitened features of a file, if it has any; the others are only looked through. Errors as `_read_features`."""
    file = path.open("rb")
    with ExitStack() as unless_kept:
        unless_kept.callback(file.close)
        with _archive(file) as archive:
            if not all(f"{name}.npy" in archive.namelist() for name in _WHITENED):
                return None
            place = _checked_array(archive, "features")
            array, mean, directions = (_read_array(archive, name) for name in _WHITENED)
            if array.shape[3:] + place.shape[3:] != directions.shape or mean.shape != place.shape[3:]:
                raise ValueError(f"features of shape {array.shape} are not whitened ones of features of shape {place.shape}")
            geometry = Geometry(array.shape[:3], _read_array(archive, "ijk_to_ras"))
        stored = StoredFeatures(file, place, geometry, key)
        unless_kept.pop_all()
        return NormalisedFeatures(array, geometry, FeatureTransform(mean, directions.T), stored)


@contextmanager
def _archive(file: IO[bytes]) -> Iterator[zipfile.ZipFile]:
    """Reads a file; whatever shows that it is damaged becomes a ValueError."""
    try:
        with zipfile.ZipFile(file) as archive:
            yield archive
    except _DAMAGED as error:
        raise ValueError(str(error) or type(error).__name__) from error


_DAMAGED = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    struct.error,
    RuntimeError,
    LookupError,
    TypeError,
    EOFError,
    AttributeError,
    OverflowError,
    SyntaxError,
)
"""What reading a damaged archive raises beside OSError and ValueError: an encrypted file or an unknown method, say, is a
RuntimeError. Found by flipping the bits of one."""


def _read_array(archive: zipfile.ZipFile, name: str) -> np.ndarray:
    """An array of numbers, as `numpy.load` reads it."""
    place, crc = _place_of(archive, name)
    array = np.empty(place.shape, place.dtype)
    values = array.reshape(-1).view(np.uint8).data
    blocks = (values[start : start + _BLOCK_BYTES] for start in range(0, len(values), _BLOCK_BYTES))
    _read_checked(archive, name, place, crc, blocks)
    return array


def _checked_array(archive: zipfile.ZipFile, name: str) -> ArrayInFile:
    """Where an array lies that is all there, by its checksum."""
    place, crc = _place_of(archive, name)
    size = math.prod(place.shape) * place.dtype.itemsize
    # Always the same block: fresh memory costs more than reading does.
    block = memoryview(bytearray(_BLOCK_BYTES))
    _read_checked(archive, name, place, crc, (block[: size - start] for start in range(0, size, _BLOCK_BYTES)))
    return place


def _place_of(archive: zipfile.ZipFile, name: str) -> tuple[ArrayInFile, int]:
    """Where an array lies in an archive's file, and the checksum of what stands before it under its name."""
    info = archive.getinfo(f"{name}.npy")
    if info.compress_type != zipfile.ZIP_STORED:
        raise ValueError(f"{info.filename} is compressed")
    with archive.open(info) as member:
        np.lib.format.read_magic(member)
        shape, fortran_order, dtype = np.lib.format.read_array_header_1_0(member)
        header_bytes = member.tell()
        # Before there is room made for it: a flipped bit can make a size absurd.
        if fortran_order or dtype not in _TYPES or header_bytes + math.prod(shape) * dtype.itemsize != info.file_size:
            raise ValueError(f"{info.filename} is not what its header says")
        if not math.prod(shape):
            raise ValueError(f"{info.filename} holds nothing")
        member.seek(0)
        crc = zlib.crc32(member.read(header_bytes))
    return ArrayInFile(_start(archive, info) + header_bytes, shape, dtype), crc


def _read_checked(archive: zipfile.ZipFile, name: str, place: ArrayInFile, crc: int, blocks: Iterable[memoryview]) -> None:
    """Read an array into blocks, which may be the same memory; not through `zipfile`, which takes three times as long."""
    file = cast(io.BufferedReader, archive.fp)
    file.seek(place.start)
    for block in blocks:
        if file.readinto(block) != len(block):
            raise EOFError(f"{name} ends early")
        crc = zlib.crc32(block, crc)
        if not _all_finite(np.frombuffer(block, place.dtype)):
            raise ValueError(f"{name} holds values that are not numbers")
    if crc != archive.getinfo(f"{name}.npy").CRC:
        raise ValueError(f"the checksum of {name} is another one")


def _all_finite(values: np.ndarray) -> bool:
    """Whether no exponent has all of its bits set; `numpy.isfinite` takes many times as long in half precision."""
    form = np.finfo(values.dtype)
    exponent = ((1 << form.nexp) - 1) << form.nmant
    bits = values.view(f"u{values.itemsize}")
    return not values.size or int((bits & bits.dtype.type(exponent)).max()) < exponent


def _start(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> int:
    """Offset in the file of what is stored under a name: behind a header that ends with the lengths of two fields after it."""
    file = cast(io.BufferedReader, archive.fp)
    file.seek(info.header_offset)
    header = file.read(_HEADER_BYTES)
    of_name, of_extra = struct.unpack("<HH", header[-4:])
    return int(info.header_offset + _HEADER_BYTES + of_name + of_extra)


_told: set[str] = set()


def _warn_once(message: str) -> None:
    if message not in _told:
        _told.add(message)
        logger.warning(message)
