"""Keeps unsaved points on disk in case Slicer crashes, and offers them when their scan is chosen again."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from zipfile import is_zipfile

import slicer

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.files.unsaved_files import DELAY_S, LONGEST_DELAY_S, LeftPoints, UnsavedFile, remove_left
from ViTTransferFunction.Logic.scene.classes.class_nodes import points_are_in_files
from ViTTransferFunction.Logic.scene.classes.class_state import Classes
from ViTTransferFunction.Logic.scene.interface.message_texts import not_kept_text, not_saved_text, unusable_text
from ViTTransferFunction.Logic.scene.volumes.volume_content import first_frame
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import array_from_node
from ViTTransferFunction.Widget.section import Report, Section
from ViTTransferFunction.Widget.wording import breakable

_LEAVE_S = 0.001
"""How long `advance` waits for the thread: it can only run meanwhile, since Slicer's idle event loop holds Python's lock."""

_Key = tuple[str, tuple[int, ...], bytes]


@dataclass(eq=False)
class _Scan:
    """A scan of the scene, and different states of its structures.

    Attributes:
        key: identifies the scan's node and its position.
        file: the file in which the structures are kept.
        path: path of the scan, for users.
        opened: the structures that the scan had when it was chosen for the first time, from the saved scene.
        now: the structures at the last `refresh`.
        saved: the structures as they are saved in the scene or a file of the user's.
        kept: the structures for which the file has the right content; None if it has not.
        offered: points that an ended Slicer or app left behind, and that the user may restore.
    """

    key: _Key
    file: UnsavedFile
    path: str
    opened: Classes
    now: Classes
    saved: Classes
    kept: Classes | None
    offered: LeftPoints | None = None


class UnsavedPoints(Section):
    """Keeps the structures of each scan on disk while they are not saved elsewhere, and offers those that were left behind.

    One thread does all work on the disk, in order; only `end` waits for it. A scan is recognised by its voxels and their
    position, and a sequence by those of its first frame, because all frames share structures.
    """

    def __init__(self, ui: Any, report: Report) -> None:
        super().__init__(ui, report)
        self._scans: dict[_Key, _Scan] = {}
        self._scan: _Scan | None = None
        self._changed_s: float | None = None
        # The time at which the scene was last saved, and the bundle that it was saved to.
        self._stored: int | None = None
        self._bundle: tuple[str, int] | None = None
        self._disk: ThreadPoolExecutor | None = None
        self._under_way: list[tuple[Future[Any], Callable[[Any], None]]] = []
        self._problem = ""
        ui.restorePointsButton.clicked.connect(lambda: self.attempt(self._restore))
        ui.discardPointsButton.clicked.connect(self._discard)

    @property
    def busy(self) -> bool:
        """Whether the thread is working: `advance` should then be called more often."""
        return bool(self._under_way)

    def refresh(self) -> None:
        """Take in changes of the scan and its structures, and show whether there is something to restore."""
        self._notice_saving()
        self._scan = self._scan_of_now()
        if self._scan is not None:
            self._scan.now = self._classes
            if self._changed_s is None and self._scan.now != self._scan.kept:
                self._changed_s = time.monotonic()
        self._show(self._scan.offered if self._scan is not None else None)

    def advance(self) -> None:
        """Let the thread work, take in its results, and have it keep changes that are a moment old."""
        while self._under_way:
            work, then = self._under_way[0]
            wait([work], _LEAVE_S)
            if not work.done():
                break
            del self._under_way[0]
            self._take_in(work, then)
        self._notice_saving()
        session, changed_s = self.session, self._changed_s
        if session is not None and changed_s is not None:
            waited_s = time.monotonic() - changed_s
            if waited_s >= (LONGEST_DELAY_S if session.awaits_maps else DELAY_S):
                self.keep()

    def keep(self, instead_of: LeftPoints | None = None) -> None:
        """Keep the structures as they are now on disk, or remove the file if they are saved elsewhere.

        Args:
            instead_of: points left behind, whose file this one replaces.
        """
        self._changed_s = None
        session, scan = self.session, self._scan
        if session is None or scan is None or (session.classes == scan.kept and instead_of is None):
            return
        if scan.key != self._key_of_now():
            return  # The scan was removed or moved, and with it its structures: the file stays.
        scan.kept = session.classes
        try:
            classes = [] if scan.kept == scan.saved else session.file_classes.to_keep()
        except InputError as error:
            self._tell(error)
            return
        model = session.parameters.get("usedModel")
        self._have_done(partial(scan.file.keep, classes, scan.path, model, instead_of), lambda _: self._tell(None))

    def mark_saved(self) -> None:
        """Note that the scan's structures were saved elsewhere, as they were at the last `refresh`."""
        if self._scan is not None:
            self._scan.saved, self._scan.kept = self._scan.now, None
            self.keep()

    def end(self, is_asked: bool) -> None:
        """The scene is closed, or Slicer ends: remove the files if the user was asked whether to save, else keep them."""
        if not is_asked:
            self._notice_saving()
            self.keep()
        for scan in self._scans.values():
            if is_asked:
                self._have_done(scan.file.remove)
            self._have_done(scan.file.close)
        if self._disk is not None:
            self._disk.shutdown()
        self._disk = self._scan = self._changed_s = self._stored = self._bundle = None
        self._problem = ""
        self._under_way.clear()
        self._scans.clear()

    @property
    def _classes(self) -> Classes:
        return self.session.classes if self.session is not None else ()

    def _show(self, left: LeftPoints | None) -> None:
        ui = self.ui
        if left is None and (ui.restorePointsButton.focus or ui.discardPointsButton.focus):
            # Otherwise Qt moves the focus to the next section's header, which Space would close.
            ui.addClassButton.setFocus()
        ui.unsavedFrame.visible = left is not None
        if left is not None:
            when = time.strftime("%Y-%m-%d %H:%M", time.localtime(left.when_s))
            names = [each.name for each in left.classes]
            ui.unsavedLabel.text = breakable(not_saved_text(left.point_count, names, when))

    def _scan_of_now(self) -> _Scan | None:
        """The chosen scan; None if there is none, or none that could have points."""
        session, key = self.session, self._key_of_now()
        if session is None or key is None:
            return None
        if key not in self._scans:
            volume, classes = session.parameters.volume, session.classes
            file = UnsavedFile(array_from_node(first_frame(volume)), session.file_classes.geometry)
            self._scans[key] = _Scan(key, file, _path_of(volume), classes, classes, classes, classes)
            self._look(self._scans[key])
        return self._scans[key]

    def _key_of_now(self) -> _Key | None:
        volume = self.session.parameters.volume if self.session is not None else None
        if self.session is None or volume is None:
            return None
        try:
            geometry = self.session.file_classes.geometry
        except InputError:
            return None
        return volume.GetID(), geometry.shape, geometry.ijk_to_ras.tobytes()

    def _notice_saving(self) -> None:
        """Detect that the scene was saved: Slicer sends no event for this, but changes the stored time."""
        session, scene = self.session, slicer.mrmlScene
        if session is None or scene.GetStoredTime() == self._stored:
            return
        is_first, bundle = self._stored is None, self._bundle
        self._stored, self._bundle = scene.GetStoredTime(), _written_bundle(scene.GetURL() or "")
        is_in_bundle = self._bundle not in (None, bundle)
        if not is_first and (is_in_bundle or points_are_in_files(session.parameters.node)):
            for scan in self._scans.values():
                if scan is not self._scan:
                    scan.saved = scan.kept = scan.now
                    self._have_done(scan.file.remove)
            self.mark_saved()

    def _restore(self) -> None:
        session, scan = self.session, self._scan
        if session is not None and scan is not None and scan.offered is not None:
            left = scan.offered
            session.file_classes.restore(left.classes, left.model, scan.opened)
            self.keep(instead_of=left)
            self._look_again(scan)

    def _discard(self) -> None:
        if self._scan is not None and self._scan.offered is not None:
            self._have_done(partial(remove_left, self._scan.offered.path))
            self._look_again(self._scan)
            self.refresh()

    def _look_again(self, scan: _Scan) -> None:
        scan.offered = None
        self._look(scan)

    def _look(self, scan: _Scan) -> None:
        """Search for points that were left behind for a scan, and offer the latest. For a large scan this takes a second."""
        unusable: dict[Path, InputError] = {}

        def look() -> LeftPoints | None:
            # The same error occurs, and is shown, when something is to be kept.
            with suppress(InputError):
                return scan.file.latest_left(unusable.__setitem__)
            return None

        def offer(left: LeftPoints | None) -> None:
            scan.offered = left
            for path, error in unusable.items():
                self.report(unusable_text(path, error), about=str(path))
            self.refresh()

        self._have_done(look, offer)

    def _have_done(self, work: Callable[[], Any], then: Callable[[Any], None] = lambda _: None) -> None:
        """Do some work in the thread; `advance` then calls `then` with its result, or shows its error."""
        if self._disk is None:
            self._disk = ThreadPoolExecutor(1, thread_name_prefix="unsaved points")
        self._under_way.append((self._disk.submit(work), then))

    def _take_in(self, work: Future[Any], then: Callable[[Any], None]) -> None:
        try:
            result = work.result()
        except InputError as error:
            self._tell(error)
        else:
            then(result)

    def _tell(self, error: InputError | None) -> None:
        """Show the reason why structures cannot be kept, until they can be kept again (None)."""
        problem, self._problem = self._problem, "" if error is None else str(error)
        if error is not None and self._problem != problem:
            self.report(not_kept_text(error), solved=lambda: self._problem != str(error))


def _written_bundle(path: str) -> tuple[str, int] | None:
    """Path and time of the bundle (.mrb) that a scene was saved to; None if it was saved otherwise, or is not complete.

    Slicer counts lists that are saved in a bundle as not saved, because they have no files of their own.
    """
    if not path.lower().endswith(".mrb"):
        return None
    try:
        return (path, Path(path).stat().st_mtime_ns) if is_zipfile(path) else None
    except OSError:
        return None


def _path_of(volume: slicer.vtkMRMLScalarVolumeNode) -> str:
    storage = volume.GetStorageNode()
    return (storage.GetFileName() if storage is not None else None) or volume.GetName() or ""
