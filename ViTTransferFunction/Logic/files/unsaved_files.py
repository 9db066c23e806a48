"""Structures that are saved nowhere else, as annotation files in the user's cache folder: for when a program ends by itself.

Each file is of one opening of a scan, and beside it lies another one, which is locked as long as that scan is open: the system
unlocks it however the app ends. Only the user can read them.
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
from ..core.volumes.volume import Volume
from .annotation_files import ANNOTATIONS_ENDING, read_annotations, write_annotations
from .json_files import read_json

DELAY_S = 1.0
"""From a change until it is written: clicks come in rows, and the answer to one is there by then."""
LONGEST_DELAY_S = 10.0
"""For so long an answer is waited for that does not come: what was clicked is more important then."""

MOST_FILES = 20
"""That are kept: scans of some days of work."""
MOST_BYTES = 64 << 20
"""Of all files together: about a million points."""
PLACE_DIGITS = 3
"""Of a scan's place, in millimetres: other formats of the same scan may have fewer digits."""

_OTHERS_LOOK_S = 1.0
"""Much longer than others have a lock that they look at."""


@dataclass(frozen=True)
class LeftPoints:
    """What an opening of a scan left.

    Attributes:
        path: of its file.
        when_s: when it was written, in seconds since the epoch.
        classes: the structures.
        model: that they were made with; "": not known.
    """

    path: Path
    when_s: float
    classes: list[AnnotatedClass]
    model: str

    @property
    def point_count(self) -> int:
        """Of all structures, inside and outside."""
        return sum(len(each.request.positive) + len(each.request.negative) for each in self.classes)


class UnsavedFile:
    """The file of one opening of a scan; there is none until something is written. What takes time about it, a thread does.

    Args:
        array: the scan's voxels, (K, J, I).
        geometry: where they lie.
    """

    def __init__(self, array: np.ndarray, geometry: Geometry) -> None:
        self._array: np.ndarray | None = array
        self._geometry = geometry
        self._lock: int | None = None

    def write(self, classes: Sequence[AnnotatedClass], scan_path: str, model: str) -> None:
        """Write structures in place of those before; beyond `MOST_FILES` and `MOST_BYTES`, the oldest files go.

        Args:
            classes: the structures.
            scan_path: where the scan is, as users know it.
            model: that they were made with.

        Raises:
            InputError: they cannot be written.
        """
        path = self._path
        try:
            make_private(path.parent)
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
        """As `write`; none is written of no structures. Then what was left before may go.

        Args:
            classes: the structures.
            scan_path: as there.
            model: as there.
            instead_of: what they were restored from; None: from nothing.

        Raises:
            InputError: they cannot be written; what was left stays.
        """
        if classes:
            self.write(classes, scan_path, model)
        else:
            self.remove()
        if instead_of is not None:
            remove_left(instead_of.path)

    def remove(self) -> None:
        """Remove it: everything is saved elsewhere."""
        if self._lock is not None:
            with suppress(OSError):
                self._path.unlink()

    def close(self) -> None:
        """Write no more; what is in it may be offered from now on."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None
            if not self._path.exists():
                remove_left(self._path)

    def latest_left(self, on_unusable: Callable[[Path, InputError], object]) -> LeftPoints | None:
        """The latest of what other openings of the scan left that have ended; None if there is nothing.

        Args:
            on_unusable: is told of each file that cannot be used, and why; it is passed over.

        Raises:
            InputError: the scan cannot be segmented, or there can be no cache folder.
        """
        for path in _latest_first(_folder(), f"{self._scan}-*{ANNOTATIONS_ENDING}"):
            if not _is_written_to(path):
                try:
                    return _read(path, self._geometry)
                except InputError as error:
                    on_unusable(path, error)
        return None

    @cached_property
    def _path(self) -> Path:
        return _folder() / f"{self._scan}-{secrets.token_hex(4)}{ANNOTATIONS_ENDING}"

    @cached_property
    def _scan(self) -> str:
        """A name for the scan, by its voxels and where they lie, whatever its own file is called."""
        assert self._array is not None
        digest = hashlib.sha256(Volume(self._array, self._geometry).digest)
        # The scan may be removed while its structures are still kept: its voxels are not.
        self._array = None
        # Without the sign of zero.
        digest.update((self._geometry.ijk_to_ras.round(PLACE_DIGITS) + 0.0).tobytes())
        return digest.hexdigest()[:32]


def remove_left(path: Path) -> None:
    """Remove a file of those that write no more."""
    for each in (path, _lock_of(path)):
        with suppress(OSError):
            each.unlink()


def _folder() -> Path:
    return cache_folder() / "unsaved"


def _lock_of(path: Path) -> Path:
    return path.with_name(f"{path.name.removesuffix(ANNOTATIONS_ENDING)}.lock")


def _locked(lock: Path) -> int:
    """Make and lock a file; returns its descriptor.

    Others have it for a moment when they look whether it is locked, and remove it if nobody else had it: then it is made
    again.
    """
    give_up = time.monotonic() + _OTHERS_LOOK_S
    while True:
        descriptor = os.open(lock, os.O_RDWR | os.O_CREAT, 0o600)
        # Taken first, since who removes it has it as well.
        if (take_lock(descriptor) is not False and is_at(lock, descriptor)) or time.monotonic() > give_up:
            return descriptor
        os.close(descriptor)


def _read(path: Path, geometry: Geometry) -> LeftPoints:
    classes, model = read_annotations(path, geometry), read_json(path).get("model")
    return LeftPoints(path, _changed_s(path), classes, model if isinstance(model, str) else "")


def _latest_first(folder: Path, pattern: str) -> list[Path]:
    return sorted(folder.glob(pattern), key=_changed_s, reverse=True)


def _changed_s(path: Path) -> float:
    """When a file was written last; long ago, if it is gone meanwhile."""
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def _is_written_to(path: Path) -> bool:
    """Whether the scan is still open that a file is of, here or in another app or Slicer."""
    try:
        descriptor = os.open(_lock_of(path), os.O_RDWR)
    except OSError:
        return False
    try:
        return take_lock(descriptor) is False
    finally:
        os.close(descriptor)


def _remove_oldest(written: Path) -> None:
    """Remove what is too much, but for the file that was just written; and locks without one, of those that were killed."""
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
    """Remove a file and its lock unless the scan is still open that it is of."""
    try:
        descriptor = os.open(_lock_of(path), os.O_RDWR)
    except OSError:
        remove_left(path)
        return
    try:
        is_left = take_lock(descriptor) is not False
        if is_left:
            # Before the lock is closed, so that nobody has taken it by then; but Windows removes no open file.
            remove_left(path)
    finally:
        os.close(descriptor)
    if is_left and sys.platform == "win32":
        remove_left(path)
