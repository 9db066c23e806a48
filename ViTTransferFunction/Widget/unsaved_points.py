"""Points that are saved nowhere else outlive a Slicer that ends by itself: they are offered when their scan is chosen again."""

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
from ViTTransferFunction.Logic.scene.interface.wording import not_kept_text, not_saved_text, unusable_text
from ViTTransferFunction.Logic.scene.volumes.volume_content import first_frame
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import array_from_node
from ViTTransferFunction.Widget.section import Report, Section
from ViTTransferFunction.Widget.wording import breakable

_LEAVE_S = 0.001
"""For so long `advance` leaves Python to the thread: Slicer's event loop holds Python's lock while it idles."""

_Key = tuple[str, tuple[int, ...], bytes]


@dataclass(eq=False)
class _Scan:
    """What is known of the structures of a scan of the scene.

    Attributes:
        key: which node it is, and where it lies.
        file: that they are kept in.
        path: where the scan is, as users know it.
        opened: with which the scan was chosen first; they came with the scene.
        now: as they were when they were looked at last.
        saved: as they are saved elsewhere.
        kept: for which the disk is as it should be; None: for none.
        offered: what was left of the scan when Slicer or the app ended by itself.
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
    """Keeps the structures of each scan on the disk while they are saved nowhere else, and offers what was kept before.

    A thread does all that concerns the disk, in its order; nothing here waits for it but `end`. A scan is known again by its
    voxels and their place, and a sequence by those of its first frame: all of its frames have the same structures.
    """

    def __init__(self, ui: Any, report: Report) -> None:
        super().__init__(ui, report)
        self._scans: dict[_Key, _Scan] = {}
        self._scan: _Scan | None = None
        self._changed_s: float | None = None
        # When the scene was saved last, and to which bundle.
        self._stored: int | None = None
        self._bundle: tuple[str, int] | None = None
        self._disk: ThreadPoolExecutor | None = None
        self._under_way: list[tuple[Future[Any], Callable[[Any], None]]] = []
        self._problem = ""
        ui.restorePointsButton.clicked.connect(lambda: self.attempt(self._restore))
        ui.discardPointsButton.clicked.connect(self._discard)

    @property
    def busy(self) -> bool:
        """Whether the thread has something to do, for which `advance` should be called more often."""
        return bool(self._under_way)

    def refresh(self) -> None:
        """The structures may have changed, or the scan; show what there is to restore of it."""
        self._notice_saving()
        self._scan = self._scan_of_now()
        if self._scan is not None:
            self._scan.now = self._classes
            if self._changed_s is None and self._scan.now != self._scan.kept:
                self._changed_s = time.monotonic()
        self._show(self._scan.offered if self._scan is not None else None)

    def advance(self) -> None:
        """Let the thread get on, take in what it has done, and have it keep what was changed a moment ago."""
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
        """Have the disk keep the structures as they are now, unless they are saved elsewhere; then what was left may go."""
        self._changed_s = None
        session, scan = self.session, self._scan
        if session is None or scan is None or (session.classes == scan.kept and instead_of is None):
            return
        if scan.key != self._key_of_now():
            return  # It is gone, and so are its structures: what was kept of them stays.
        scan.kept = session.classes
        try:
            classes = [] if scan.kept == scan.saved else session.file_classes.to_keep()
        except InputError as error:
            self._tell(error)
            return
        model = session.parameters.get("usedModel")
        self._have_done(partial(scan.file.keep, classes, scan.path, model, instead_of), lambda _: self._tell(None))

    def mark_saved(self) -> None:
        """The structures of the scan are saved elsewhere as they were looked at last."""
        if self._scan is not None:
            self._scan.saved, self._scan.kept = self._scan.now, None
            self.keep()

    def end(self, is_asked: bool) -> None:
        """The scene is closed, or Slicer ends: what was kept of it goes, if the user was asked whether to save."""
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
            # Qt would give the keyboard to the next section's header, which Space closes.
            ui.addClassButton.setFocus()
        ui.unsavedFrame.visible = left is not None
        if left is not None:
            when = time.strftime("%Y-%m-%d %H:%M", time.localtime(left.when_s))
            names = [each.name for each in left.classes]
            ui.unsavedLabel.text = breakable(not_saved_text(left.point_count, names, when))

    def _scan_of_now(self) -> _Scan | None:
        """The scan that is chosen; None where there is none that could have points."""
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
        """Slicer announces to nobody that it has saved a scene, but notes when."""
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
        """Offer what was left of a scan, the latest first. To find out which scan it is takes a second, where it is large."""
        unusable: dict[Path, InputError] = {}

        def look() -> LeftPoints | None:
            # What is wrong here is told where something is to be kept.
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
        """Have the thread do something; `then` gets what that returns. What goes wrong is shown."""
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
        """Show why structures are not kept, until they are again; None: they are."""
        problem, self._problem = self._problem, "" if error is None else str(error)
        if error is not None and self._problem != problem:
            self.report(not_kept_text(error), solved=lambda: self._problem != str(error))


def _written_bundle(path: str) -> tuple[str, int] | None:
    """Which file a scene was saved to with all that is in it, and when; None where that was none, or it is not whole.

    Of lists that were saved so, Slicer says that they are not saved, since they have no files of their own.
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
