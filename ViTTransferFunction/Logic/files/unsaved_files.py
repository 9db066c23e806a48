"""Keeps unsaved structures as annotation files in the user's cache folder, in case the program crashes.

There is one file for each time that a scan was opened, and beside it a lock file, which is locked while the scan is open; the
system unlocks it however the program ends. Only the user can read them.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from ..core.classes.annotated_class import AnnotatedClass
from ..core.system.atomic_file import set_rights
from ..core.system.cache_folder import CACHE_VARIABLE, cache_folder, make_private
from ..core.system.errors import InputError
from ..core.system.file_lock import is_at, take_lock
from ..core.volumes.geometry import Geometry
from ..core.volumes.volume import digest_of_voxels
from .annotation_files import ANNOTATIONS_ENDING, read_annotations, write_annotations
from .json_files import read_json

DELAY_S = 1.0
"""Time from a change until it is written: clicks come in quick succession, and their answers come first."""
LONGEST_DELAY_S = 10.0
"""If answers take longer than this, the change is written without waiting for them any more."""

MOST_FILES = 20
"""Most files that are kept: the scans of some days of work."""
MOST_BYTES = 64 << 20
"""Largest size of all files together: about a million points."""
PLACE_DIGITS = 3
"""Decimals to which a scan's position in millimetres is compared: other formats of the same scan may have fewer."""

_OTHERS_LOOK_S = 1.0
"""Much longer than other processes hold a lock to test it."""
_LOOKS, _LOOK_AGAIN_S = 3, 0.01
"""How often a lock is tested that is held, and the seconds in between: another process may hold it only to test it."""


@dataclass(frozen=True)
class LeftPoints:
    """Structures that an ended program left behind.

    Attributes:
        path: their file.
        when_s: when it was written, in seconds since the epoch.
        classes: the structures.
        model: the model that they were made with; "": not known.
    """

    path: Path
    when_s: float
    classes: list[AnnotatedClass]
    model: str

    @property
    def point_count(self) -> int:
        """Number of points of all structures, inside and outside."""
        return sum(len(each.request.positive) + len(each.request.negative) for each in self.classes)


class UnsavedFile:
    """The file for one opening of a scan, which does not exist until something is written. Methods may take long: use a thread.

    Args:
        array: the scan's voxels, (K, J, I).
        geometry: where they lie.
    """

    def __init__(self, array: np.ndarray, geometry: Geometry) -> None:
        self._array: np.ndarray | None = array
        self._geometry = geometry
        self._lock: int | None = None

    def write(self, classes: Sequence[AnnotatedClass], scan_path: str, model: str) -> None:
        """Write structures in place of the former ones; remove the oldest files beyond `MOST_FILES` and `MOST_BYTES`.

        Args:
            classes: the structures.
            scan_path: path of the scan, for users.
            model: the model that the structures were made with.

        Raises:
            InputError: they cannot be written.
        """
        path = self._path
        try:
            make_private(path.parent)
            if self._lock is not None and not is_at(_lock_of(path), self._lock):
                # The cache folder was removed by hand, and others would take the file for one that was left behind.
                os.close(self._lock)
                self._lock = None
            if self._lock is None:
                self._lock = _locked(_lock_of(path))
            write_annotations(classes, path, {"scan": scan_path, "model": model})
            set_rights(path, 0o600)
        except OSError as error:
            raise InputError(
                f"Cannot write {path}: {error.strerror or error}. The environment variable {CACHE_VARIABLE} can name another "
                "folder."
            ) from error
        _remove_oldest(path)

    def keep(self, classes: Sequence[AnnotatedClass], scan_path: str, model: str, instead_of: LeftPoints | None = None) -> None:
        """Write structures, or remove the file if there are none; then remove the file that they were restored from.

        Args:
            classes: the structures.
            scan_path: see `write`.
            model: see `write`.
            instead_of: the points left behind that the structures were restored from, if any.

        Raises:
            InputError: the structures cannot be written; the file of `instead_of` stays.
        """
        if classes:
            self.write(classes, scan_path, model)
        else:
            self.remove()
        if instead_of is not None:
            remove_left(instead_of.path)

    def remove(self) -> None:
        """Remove the file, because everything is saved elsewhere."""
        if self._lock is not None:
            with suppress(OSError):
                self._path.unlink()

    def close(self) -> None:
        """Stop writing and release the lock, so that the file's content can be offered from now on."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None
            if not self._path.exists():
                remove_left(self._path)

    def latest_left(self, on_unusable: Callable[[Path, InputError], object]) -> LeftPoints | None:
        """The latest points that were left behind when the same scan was open before; None if there are none.

        Args:
            on_unusable: called with each file that cannot be used, and the reason; such files are skipped.

        Raises:
            InputError: there cannot be a cache folder.
        """
        for path in _latest_first(_folder(), f"{self._scan}-*{ANNOTATIONS_ENDING}"):
            if not _is_written_to(path):
                try:
                    return _read(path, self._geometry)
                except InputError as error:
                    # The program that it belonged to may have removed it meanwhile.
                    if path.exists():
                        on_unusable(path, error)
        return None

    @cached_property
    def _path(self) -> Path:
        return _folder() / f"{self._scan}-{secrets.token_hex(4)}{ANNOTATIONS_ENDING}"

    @cached_property
    def _scan(self) -> str:
        """A name that identifies the scan by its voxels and their position, independent of its file name."""
        assert self._array is not None
        digest = hashlib.sha256(digest_of_voxels(self._array))
        # Frees the voxels, because the scan may be removed from the scene while its structures are still kept.
        self._array = None
        # Without the sign of zero.
        digest.update((self._geometry.ijk_to_ras.round(PLACE_DIGITS) + 0.0).tobytes())
        return digest.hexdigest()[:32]


def remove_left(path: Path) -> None:
    """Remove a file that is no longer written to, and its lock file."""
    for each in (path, _lock_of(path)):
        with suppress(OSError):
            each.unlink()


def _folder() -> Path:
    return cache_folder() / "unsaved"


def _lock_of(path: Path) -> Path:
    return path.with_name(f"{path.name.removesuffix(ANNOTATIONS_ENDING)}.lock")


def _locked(lock: Path) -> int:
    """Create and lock a file; returns its descriptor.

    Other processes lock it for a moment to test it, and remove it if nobody else has locked it; then it is created again.
    """
    give_up = time.monotonic() + _OTHERS_LOOK_S
    while True:
        descriptor = os.open(lock, os.O_RDWR | os.O_CREAT, 0o600)
        # The lock is taken before `is_at` checks that the file still exists: whoever removes it holds the lock.
        if (take_lock(descriptor) is not False and is_at(lock, descriptor)) or time.monotonic() > give_up:
            return descriptor
        os.close(descriptor)


def _read(path: Path, geometry: Geometry) -> LeftPoints:
    classes, model = read_annotations(path, geometry), read_json(path).get("model")
    return LeftPoints(path, _changed_s(path), classes, model if isinstance(model, str) else "")


def _latest_first(folder: Path, pattern: str) -> list[Path]:
    return sorted(folder.glob(pattern), key=_changed_s, reverse=True)


def _changed_s(path: Path) -> float:
    """Time at which a file was last written; 0 if it is gone meanwhile."""
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def _is_written_to(path: Path) -> bool:
    """Whether a file's scan is still open, in this program or another one."""
    for look in range(_LOOKS):
        if look:
            time.sleep(_LOOK_AGAIN_S)
        try:
            descriptor = os.open(_lock_of(path), os.O_RDWR)
        except OSError:
            return False
        try:
            if take_lock(descriptor) is not False:
                return False
        finally:
            os.close(descriptor)
    return True


def _remove_oldest(written: Path) -> None:
    """Remove the oldest files beyond the limits, except `written`, and lock files of killed programs that have no file."""
    total = 0
    for number, path in enumerate(_latest_first(written.parent, f"*{ANNOTATIONS_ENDING}")):
        with suppress(OSError):
            total += path.stat().st_size
        if (number >= MOST_FILES or total > MOST_BYTES) and path != written:
            _remove_unless_written_to(path)
    for lock in written.parent.glob("*.lock"):
        path = lock.with_name(f"{lock.stem}{ANNOTATIONS_ENDING}")
        if not path.exists():
            _remove_unless_written_to(path)


def _remove_unless_written_to(path: Path) -> None:
    """Remove a file and its lock file unless its scan is still open."""
    try:
        descriptor = os.open(_lock_of(path), os.O_RDWR)
    except OSError:
        remove_left(path)
        return
    try:
        is_left = take_lock(descriptor) is not False
        if is_left:
            # While the lock is held, so that nobody else can take it. On Windows, which removes no open file, again below.
            remove_left(path)
    finally:
        os.close(descriptor)
    if is_left and sys.platform == "win32":
        remove_left(path)
