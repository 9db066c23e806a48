"""Features kept on disk, so that a volume that was opened before is ready at once."""

from __future__ import annotations

import logging
import os
import re
import shutil
import stat
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ..core.system.atomic_file import TEMPORARY, replacing, set_rights
from ..core.system.cache_folder import CACHE_VARIABLE, cache_folder, make_private
from ..core.system.errors import InputError
from .feature_file import all_finite, read_features, write_features
from .feature_volume import FeatureVolume

logger = logging.getLogger(__name__)

LIMIT_BYTES = 20 * 10**9
"""When the cache is larger than this, the least recently used features are removed."""
SPARE_BYTES = 64 * 1024**2
"""Free space that must remain on the disk after the features are stored."""
_KEY = re.compile(r"[0-9a-f]{64}")
"""A key is a SHA-256 (`feature_key`)."""
_OURS = re.compile(rf"{_KEY.pattern}|{re.escape(TEMPORARY)}.+")
"""Names of the cache's files, without `.npz`: a key, or the temporary name that `replacing` gives while it writes."""


def _default_folder() -> Path:
    return cache_folder() / "features"


class FeatureCache:
    """A folder with one `.npz` file (arrays only, never pickles) for each feature volume, named by its key.

    The cache only saves time, and never stops the work: features that it cannot read count as absent, and features that it
    cannot store are computed again next time. Features are derived from patients' data, so only the user can read the files.

    Args:
        folder: the folder to keep them in; by default in the user's cache folder.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = folder or _default_folder()

    def get(self, key: str) -> FeatureVolume | None:
        """The features stored under `key`, or None. A damaged file is removed and counts as absent."""
        path = self._path(key)
        try:
            # A pipe would make its reader wait for ever.
            if path.exists() and not path.is_file():
                raise ValueError("expected an ordinary file")
            features = read_features(path, key)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except (OSError, ValueError) as error:
            reason = " ".join(str(error).split())
            logger.warning("Cached features cannot be used and are computed again (%s: %s)", path, reason)
            # A file that could not be opened stays: another program may have it open for a moment.
            if isinstance(error, ValueError):
                with suppress(OSError):
                    path.unlink()
            return None
        # The time of last use, by which `_evict` chooses.
        with suppress(OSError):
            os.utime(path)
        return features

    def __contains__(self, key: str) -> bool:
        """Whether there is a file of features for `key`; only `get` finds out whether it is intact."""
        return self._entry(self._path(key)) is not None

    def put(self, features: FeatureVolume) -> str:
        """Store features completely or not at all, then remove the least recently used ones beyond the limit.

        Features with values that are not finite are not stored. If the folder cannot be written to or its disk is full, that is
        logged once.

        Returns:
            Why the features are not kept, as a sentence for the user; "" if they are kept.
        """
        if not all(all_finite(layer) for layer in features.array):
            return _warn_once("The features hold values that are not numbers; they are not kept in the cache.")
        path = self._path(features.key)
        try:
            make_private(self.folder)
            self._check_room(features.array.nbytes)
            with replacing(path) as temporary, temporary.open("wb") as file:
                write_features(file, features)
            set_rights(path, 0o600)
        except (OSError, InputError) as error:
            reason = error.strerror if isinstance(error, OSError) else error
            return _warn_once(
                f"Features cannot be kept in {self.folder} and are computed again next time ({reason}). The environment "
                f"variable {CACHE_VARIABLE} can name another folder."
            )
        self._evict(keep=features.key)
        return ""

    def entries(self) -> list[CacheEntry]:
        """The stored feature volumes, most recently used first."""
        found = (self._entry(path) for path in self._files() if _KEY.fullmatch(path.stem))
        return sorted((entry for entry in found if entry), key=lambda entry: entry.last_used_s, reverse=True)

    def size_bytes(self) -> int:
        """Total size of all stored features."""
        return sum(entry.size_bytes for entry in self.entries())

    def clear(self) -> int:
        """Remove all features and the remains of interrupted writes; returns the number of bytes freed.

        Other files in the folder stay.

        Raises:
            OSError: a file cannot be removed, for example because another program has it open on Windows. All others are
                removed all the same.
        """
        entries = [entry for entry in map(self._entry, self._files()) if entry]
        freed = sum(self._remove(entry) for entry in entries)
        for entry in entries:
            # If a file is still there, a second attempt raises the reason.
            self._path(entry.key).unlink(missing_ok=True)
        return freed

    def _check_room(self, needed_bytes: int) -> None:
        """Raise InputError if features of this size would fill the disk."""
        total, _, free = shutil.disk_usage(self.folder)
        # Some disks, such as those of other computers, do not say how large they are.
        if total and free < needed_bytes + SPARE_BYTES:
            raise InputError(f"its disk is full: {free / 1e6:.0f} MB free, {(needed_bytes + SPARE_BYTES) / 1e6:.0f} MB needed")

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}.npz"

    def _files(self) -> list[Path]:
        """The files whose names only this class gives."""
        try:
            return [path for path in self.folder.iterdir() if path.suffix == ".npz" and _OURS.fullmatch(path.stem)]
        except OSError:
            return []

    def _entry(self, path: Path) -> CacheEntry | None:
        """The entry of a file; None if it is gone, for example removed by another process, or is no regular file."""
        try:
            status = path.lstat()
        except OSError:
            return None
        return CacheEntry(path.stem, status.st_size, status.st_mtime) if stat.S_ISREG(status.st_mode) else None

    def _evict(self, keep: str) -> None:
        remaining = self.size_bytes()
        for entry in reversed(self.entries()):
            if remaining <= LIMIT_BYTES:
                return
            if entry.key != keep:
                remaining -= self._remove(entry)

    def _remove(self, entry: CacheEntry) -> int:
        """Remove a file; returns the number of bytes freed, 0 if it is gone already or cannot be removed."""
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


_told: set[str] = set()


def _warn_once(message: str) -> str:
    """Log a warning, unless the same one was logged before; returns the message."""
    if message not in _told:
        _told.add(message)
        logger.warning(message)
    return message
