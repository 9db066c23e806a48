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
"""Beyond it, the features used longest ago are removed."""
SPARE_BYTES = 64 * 1024**2
"""Room that is left on the disk beyond the features themselves."""
_KEY = re.compile(r"[0-9a-f]{64}")
"""A key is a SHA-256 (`feature_key`)."""
_OURS = re.compile(rf"{_KEY.pattern}|{re.escape(TEMPORARY)}.+")
"""What files are called here: by their key, or as `replacing` calls what is half-written."""


def _default_folder() -> Path:
    return cache_folder() / "features"


class FeatureCache:
    """A folder with one `.npz` file (arrays only, never pickles) for each feature volume, named by its key.

    It only ever saves time: whatever it cannot read counts as absent, and what it cannot keep is computed again next time.
    Features are derived from patients' data: nobody but the user can read them.

    Args:
        folder: where; the user's cache folder unless given.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = folder or _default_folder()

    def get(self, key: str) -> FeatureVolume | None:
        """The features named `key`, or None. A damaged file is removed and counts as absent."""
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
            # Not where it could not be opened: another program may have it for a moment.
            if isinstance(error, ValueError):
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

    def put(self, features: FeatureVolume) -> str:
        """Store features, whole or not at all, then remove the least recently used beyond the limit.

        Features that are not finite are not stored. Where the folder cannot be written to, or the disk is full, a warning says
        so once.

        Returns:
            Why they are not kept, for the user; "" where they are.
        """
        if not all(all_finite(layer) for layer in features.array):
            return _warn_once("The features hold values that are not numbers; they are not kept in the cache.")
        path = self._path(features.key)
        try:
            make_private(self.folder)
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

    def check_room(self, needed_bytes: int) -> None:
        """Raise InputError if features of this size will not fit on the disk: before minutes are spent on them."""
        try:
            existing = next((parent for parent in (self.folder, *self.folder.absolute().parents) if parent.exists()), None)
            if existing is None:
                return  # On Windows, a disk that is not there.
            total, _, free = shutil.disk_usage(existing)
        except OSError:
            return  # Nothing will be kept there, which `put` tells.
        # A folder such as /proc is on no disk: it has no room, and none can be made.
        if total == 0 or not os.access(existing, os.W_OK):
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

        Raises:
            OSError: some may not be removed, since another program has them open on Windows, say; all others are.
        """
        entries = [entry for entry in map(self._entry, self._files()) if entry]
        freed = sum(self._remove(entry) for entry in entries)
        for entry in entries:
            # What stands in the way of one that is still there, trying again tells.
            self._path(entry.key).unlink(missing_ok=True)
        return freed

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
            if remaining <= LIMIT_BYTES:
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


_told: set[str] = set()


def _warn_once(message: str) -> str:
    """Warn of something unless that was done before; returns it."""
    if message not in _told:
        _told.add(message)
        logger.warning(message)
    return message
