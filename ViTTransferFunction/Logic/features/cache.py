"""Features kept on disk, so that a volume that was opened before is ready at once."""

from __future__ import annotations

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
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np

from ..core.atomic_file import replacing
from ..core.cache_folder import CACHE_VARIABLE, cache_folder, make_private
from ..core.errors import InputError
from ..core.geometry import Geometry
from .feature_volume import FeatureVolume

logger = logging.getLogger(__name__)

DEFAULT_LIMIT_BYTES = 20 * 1024**3
SPARE_BYTES = 64 * 1024**2
"""Room that is left on the disk beyond the features themselves."""
_BLOCK_BYTES = 1 << 20
_KEY = re.compile(r"[0-9a-f]{64}")
"""A key is a SHA-256 (`feature_key`)."""
_OURS = re.compile(rf"{_KEY.pattern}|\.writing-.+")
"""What files are called here: by their key, or as `replacing` calls what is half-written."""


def _default_folder() -> Path:
    return cache_folder() / "features"


class FeatureCache:
    """A folder with one `.npz` file (arrays only, never pickles) for each feature volume, named by its key.

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
        path = self._path(key)
        try:
            # A pipe would make its reader wait for ever.
            if path.exists() and not path.is_file():
                raise ValueError("expected an ordinary file")
            array, ijk_to_ras = read_arrays(path)
            if not array.size or not _all_finite(array):
                raise ValueError("the features hold values that are not numbers, or none at all")
            features = FeatureVolume(array, Geometry(array.shape[:3], ijk_to_ras), key)
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
        return features

    def __contains__(self, key: str) -> bool:
        """Whether there is a file of features named `key`; whether it is sound, only `get` finds out."""
        return self._entry(self._path(key)) is not None

    def put(self, features: FeatureVolume) -> None:
        """Store features, whole or not at all, then remove the least recently used beyond the limit.

        Features that are not finite are not stored. Where the folder cannot be written to, or the disk is full, a warning says
        so once.
        """
        if not _all_finite(features.array):
            logger.warning("The features hold values that are not numbers; they are not kept in the cache.")
            return
        path = self._path(features.key)
        try:
            make_private(self.folder)
            with replacing(path) as temporary, temporary.open("wb") as file:
                np.savez(file, features=features.array, ijk_to_ras=features.geometry.ijk_to_ras)
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


def _all_finite(array: np.ndarray) -> bool:
    """Layer by layer: features are large."""
    return all(bool(np.isfinite(layer).all()) for layer in array)


def read_arrays(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """The arrays `features` and `ijk_to_ras` of a file, complete and with matching checksums.

    Raises:
        OSError: it cannot be read.
        ValueError: it is damaged.
    """
    try:
        with path.open("rb") as file, zipfile.ZipFile(file) as archive:
            return _read_array(archive, "features"), _read_array(archive, "ijk_to_ras")
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
    """An array of numbers, as `numpy.load` reads it, but for the checksum: that counts only once all has been read."""
    info = archive.getinfo(f"{name}.npy")
    with archive.open(info) as member:
        np.lib.format.read_magic(member)
        shape, fortran_order, dtype = np.lib.format.read_array_header_1_0(member)
        # Before there is room made for it: a flipped bit can make a size absurd.
        if fortran_order or dtype.kind != "f" or member.tell() + math.prod(shape) * dtype.itemsize != info.file_size:
            raise ValueError(f"{info.filename} is not what its header says")
        array = np.empty(shape, dtype)
        values = array.reshape(-1).view(np.uint8).data
        while len(values):
            read = cast(zipfile.ZipExtFile, member).readinto(values[:_BLOCK_BYTES])
            if not read:
                raise EOFError(f"{info.filename} ends early")
            values = values[read:]
        return array


_told: set[str] = set()


def _warn_once(message: str) -> None:
    if message not in _told:
        _told.add(message)
        logger.warning(message)
