"""Features kept on disk, so that a volume that was opened before is ready at once."""

from __future__ import annotations

import logging
import shutil
import zipfile
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..core.atomic_file import replacing
from ..core.cache_folder import CACHE_VARIABLE, cache_folder
from ..core.errors import InputError
from ..core.geometry import Geometry
from .feature_volume import FeatureVolume

logger = logging.getLogger(__name__)

DEFAULT_LIMIT_BYTES = 20 * 1024**3
SPARE_BYTES = 64 * 1024**2
"""Room that is left on the disk beyond the features themselves."""


def _default_folder() -> Path:
    return cache_folder() / "features"


class FeatureCache:
    """A folder with one `.npz` file (arrays only, never pickles) for each feature volume, named by its key.

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
        if not path.exists():
            return None
        try:
            with np.load(path, allow_pickle=False) as content:
                array, ijk_to_ras = content["features"], content["ijk_to_ras"]
            features = FeatureVolume(array, Geometry(array.shape[:3], ijk_to_ras), key)
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
            logger.warning("Removing damaged cached features %s: %s", path, error)
            path.unlink(missing_ok=True)
            return None
        path.touch()  # The time of last use, which removal goes by.
        return features

    def __contains__(self, key: str) -> bool:
        """Whether there is a file of features named `key`; whether it is sound, only `get` finds out."""
        return self._path(key).exists()

    def put(self, features: FeatureVolume) -> None:
        """Store features, whole or not at all, then remove the least recently used beyond the limit.

        Raises:
            InputError: the folder cannot be written to or the disk is full.
        """
        with replacing(self._path(features.key)) as temporary, temporary.open("wb") as file:
            np.savez(file, features=features.array, ijk_to_ras=features.geometry.ijk_to_ras)
        self._evict(keep=features.key)

    def check_room(self, needed_bytes: int) -> None:
        """Raise InputError if features of this size will not fit on the disk: before minutes are spent on them."""
        existing = next(parent for parent in (self.folder, *self.folder.absolute().parents) if parent.exists())
        free = shutil.disk_usage(existing).free
        if free < needed_bytes + SPARE_BYTES:
            raise InputError(
                f"The disk of the cache folder {self.folder} is full: {free / 1e6:.0f} MB free, "
                f"{(needed_bytes + SPARE_BYTES) / 1e6:.0f} MB needed. "
                f"Free some space, or set the environment variable {CACHE_VARIABLE} to a folder on another disk."
            )

    def entries(self) -> list[CacheEntry]:
        """What is stored, most recently used first."""
        found = []
        for path in self.folder.glob("*.npz") if self.folder.exists() else []:
            # Another process may have just removed it.
            with suppress(FileNotFoundError):
                status = path.stat()
                if path.stem[:1] != ".":
                    found.append(CacheEntry(path.stem, status.st_size, status.st_mtime))
        return sorted(found, key=lambda entry: entry.last_used_s, reverse=True)

    def size_bytes(self) -> int:
        """Total size of what is stored."""
        return sum(entry.size_bytes for entry in self.entries())

    def clear(self) -> int:
        """Remove all features, and leftovers of interrupted writes; returns the bytes that were freed."""
        freed = 0
        for path in self.folder.glob("*.npz") if self.folder.exists() else []:
            freed += path.stat().st_size
            path.unlink(missing_ok=True)
        return freed

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}.npz"

    def _evict(self, keep: str) -> None:
        remaining = self.size_bytes()
        for entry in reversed(self.entries()):
            if remaining <= self.limit_bytes:
                return
            if entry.key != keep:
                self._path(entry.key).unlink(missing_ok=True)
                remaining -= entry.size_bytes


@dataclass(frozen=True)
class CacheEntry:
    """One stored feature volume: its key, size, and time of last use in seconds since the epoch."""

    key: str
    size_bytes: int
    last_used_s: float
