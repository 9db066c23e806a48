"""Keeps unsaved points on the disk, however the app ends, and offers them when their scan is opened again."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from ..Logic.core.system.errors import InputError
from ..Logic.files.unsaved_files import DELAY_S, LONGEST_DELAY_S, LeftPoints, UnsavedFile, remove_left
from ..Logic.scene.classes.class_state import Classes
from ..Logic.scene.interface.message_texts import not_kept_text, unusable_text
from ..Logic.scene.mrml.nodes import in_text
from ..Logic.scene.volumes.volume_nodes import array_from_node

if TYPE_CHECKING:
    from .app import WebApp

LONGEST_DELAYS = round(LONGEST_DELAY_S / DELAY_S)
"""Largest number of delays for which keeping structures waits for maps."""

_Result = TypeVar("_Result")


class UnsavedPoints:
    """Keeps the structures of the open scan on the disk while they are not saved elsewhere, and offers those kept before.

    A single thread accesses the disk, so that requests keep their order. The event loop only collects the structures.

    Args:
        app: the app with the structures. Its page shows the offer and errors.
    """

    def __init__(self, app: WebApp) -> None:
        self._app = app
        self._disk = ThreadPoolExecutor(1, thread_name_prefix="unsaved points")
        self._timer: asyncio.TimerHandle | None = None
        self._problem = ""
        self._scan_path = ""
        self._file: UnsavedFile | None = None
        # The classes with which the scan was opened, those that are saved elsewhere, and those for which the disk is up to
        # date.
        self._opened: Classes = ()
        self._saved: Classes = ()
        self._kept: Classes | None = None
        self._offer(None)

    def follow(self, scan_path: str) -> None:
        """Begin with a scan that was opened, by itself or with a session; `scan_path` is its path as users know it."""
        session = self._app.session
        self._opened = self._saved = self._kept = session.classes
        self._scan_path = scan_path
        # Without a scan, there is nothing to keep.
        with suppress(InputError):
            geometry = session.file_classes.geometry
            self._file = UnsavedFile(array_from_node(session.parameters.volume), geometry)
            self._app.begin(self._look(self._file))

    def leave(self) -> None:
        """Stop before the scan is closed; unsaved structures may be offered when it is opened again."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._keep()
        if self._file is not None:
            self._have_done(self._file.close)
        self._file = None
        self._offer(None)

    def end(self) -> None:
        """Stop for good, after everything has been written to the disk."""
        self.leave()
        self._disk.shutdown()

    def note(self) -> None:
        """Note that the structures may have changed, and keep them soon if they have."""
        if self._timer is None and self._file is not None and self._app.session.classes != self._kept:
            self._keep_soon(LONGEST_DELAYS)

    @property
    def all_saved(self) -> bool:
        """Whether all structures are saved elsewhere in their present state."""
        return self._app.session.classes == self._saved

    def mark_saved(self, classes: Classes) -> None:
        """Note that these structures are saved elsewhere."""
        self._saved, self._kept = classes, None
        self._keep()

    def restore(self) -> None:
        """Restore the offered structures in place of those that the scan was opened with.

        Raises:
            InputError: all of them exist already.
        """
        left = self._offered
        if left is not None:
            self._app.session.file_classes.restore(left.classes, left.model, self._opened)
            self._keep(instead_of=left)
            self._look_again()

    def discard(self) -> None:
        """Remove the offered structures from the disk."""
        left = self._offered
        if left is not None:
            self._have_done(partial(remove_left, left.path))
            self._look_again()

    def _look_again(self) -> None:
        self._offer(None)
        if self._file is not None:
            self._app.begin(self._look(self._file))

    def _offer(self, left: LeftPoints | None) -> None:
        self._offered = left
        with self._app.server.state as state:
            state.restorable = None if left is None else {
                "points": left.point_count,
                "names": [in_text(each.name) for each in left.classes],
                "when_ms": 1000.0 * left.when_s,
            }  # fmt: skip

    async def _look(self, file: UnsavedFile) -> None:
        """Offer the latest structures that were left of the scan. Identifying a large scan takes a second."""
        unusable: dict[Path, InputError] = {}
        # An error here is shown when structures are to be kept.
        with suppress(InputError):
            left = await self._done(partial(file.latest_left, unusable.__setitem__))
            if self._file is file:
                self._offer(left)
                for path, error in unusable.items():
                    self._app.report(unusable_text(path, error), str(path))

    def _keep_soon(self, delays: int) -> None:
        self._timer = asyncio.get_running_loop().call_later(DELAY_S, self._keep_or_wait, delays)

    def _keep_or_wait(self, delays: int) -> None:
        self._timer = None
        if self._app.session.awaits_maps and delays > 0:
            self._keep_soon(delays - 1)
        else:
            self._keep()

    def _keep(self, instead_of: LeftPoints | None = None) -> None:
        """Keep the present structures on the disk or, if they are saved elsewhere, remove those kept before."""
        session = self._app.session
        if self._file is None or (session.classes == self._kept and instead_of is None):
            return
        self._kept = session.classes
        try:
            classes = [] if self.all_saved else session.file_classes.to_keep()
        except InputError as error:
            self._tell(error)
            return
        model = session.parameters.get("usedModel")
        self._have_done(partial(self._file.keep, classes, self._scan_path, model, instead_of))

    async def _done(self, work: Callable[[], _Result]) -> _Result:
        return await asyncio.get_running_loop().run_in_executor(self._disk, work)

    def _have_done(self, work: Callable[[], object]) -> None:
        """Run work in the disk's thread; errors are shown."""
        loop = asyncio.get_running_loop()

        def tell(done: Future[object]) -> None:
            # The loop may have ended.
            with suppress(RuntimeError):
                loop.call_soon_threadsafe(self._tell, done.exception())

        self._disk.submit(work).add_done_callback(tell)

    def _tell(self, error: BaseException | None) -> None:
        """Show why structures are not kept, until they are kept again (None)."""
        if error is not None and not isinstance(error, InputError):
            raise error
        problem, self._problem = self._problem, "" if error is None else str(error)
        if error is not None and self._problem != problem:
            self._app.report(not_kept_text(error), solved=lambda: self._problem != str(error))
