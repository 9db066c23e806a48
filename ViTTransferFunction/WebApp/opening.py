"""Opens volumes, sessions and points: files are read in a thread, and their contents are then handed to the app."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ..Logic.core.system.errors import InputError
from ..Logic.core.system.private_folder import PREFIX, private_folder
from ..Logic.core.system.user_path import user_path
from ..Logic.files.series_choice import SeveralSeries
from .points_file import add_points, are_points
from .scene_files import unpacked_session
from .series_question import SeriesQuestion
from .volumes import sample_path, volume_of_files

if TYPE_CHECKING:
    from .app import WebApp

OPENING = "opening"
"""Subject of messages about what could not be opened."""
SESSION_ENDING = ".mrb"


class Opening:
    """Opens the latest requested files; earlier requests that are still being read are dropped.

    Args:
        app: gets the opened volume, session or points, and shows errors.

    Attributes:
        series: the question which of several DICOM series to open.
    """

    def __init__(self, app: WebApp) -> None:
        self._app = app
        self._paths: list[Path] = []
        self._show("")
        self.series = SeriesQuestion(app.server.state)

    async def open(self, paths: list[Path], series: str | None = None) -> None:
        """Open a volume or a session in place of the present one, unless others are requested meanwhile; errors are shown.

        The structures of a file of points are added to the open scan. If there are several DICOM series, the user is asked to
        choose one, unless `series` names it; the files must exist until then.
        """
        if self._app.stopping:
            return  # They were still being uploaded when the app was asked to end, and work that begins now would not be ended.
        self._app.try_again(OPENING)
        if are_points(paths):
            self._add_points(paths[0])
            return
        self._paths = paths
        self.series.answer("")
        self._show(paths[0].name if len(paths) == 1 else f"{len(paths)} files")
        try:
            with private_folder() as folder:
                take_up = await self._read_or_ask(paths, Path(folder), series)
                if take_up is not None and self._paths is paths:
                    take_up()
                    self._app.unsaved_points.follow(_scan_path(paths))
        except InputError as error:
            if self._paths is paths:
                self._app.report(_as_users_know(str(error), paths), OPENING)
        finally:
            if self._paths is paths:
                self._show("")
                self._app.refresh()

    def open_typed(self, path: str) -> None:
        """Open a path that the user typed."""
        try:
            if str(path).strip():
                self._app.begin(self.open([user_path(str(path).strip(), "a volume, a session or points")]))
        except InputError as error:
            self._app.report(str(error), OPENING)

    def open_sample(self) -> None:
        """Open the sample scan, a chest CT."""
        try:
            self._app.begin(self.open([sample_path()]))
        except InputError as error:
            self._app.report(str(error), OPENING)

    def give_up(self) -> None:
        """Drop all requests."""
        self._paths = []
        self.series.answer("")

    def _show(self, name: str) -> None:
        """Show the name of what is being opened on the page; "" for nothing."""
        with self._app.server.state as state:
            state.opening = name

    def _add_points(self, path: Path) -> None:
        try:
            if self._app.server.state.opening:
                raise InputError(f"A scan is just being opened. Open {path.name} again when it is there.")
            were_saved = self._app.unsaved_points.all_saved
            add_points(self._app.session, path)
            if were_saved:
                self._app.unsaved_points.mark_saved(self._app.session.classes)
        except InputError as error:
            self._app.report(str(error), OPENING)
        self._app.refresh()

    async def _read_or_ask(self, paths: list[Path], folder: Path, series: str | None) -> Callable[[], None] | None:
        """The result of `_read`, for the series that the user chooses if there are several; None if none was chosen."""
        try:
            return await asyncio.to_thread(self._read, paths, folder, series)
        except SeveralSeries as several:
            chosen = await self.series.ask(several.lines) if self._paths is paths else ""
        return await self._read_or_ask(paths, folder, chosen) if chosen else None

    def _read(self, paths: list[Path], folder: Path, series: str | None) -> Callable[[], None]:
        """Read a volume or a session, in any thread; returns a function that opens it, for the event loop's thread."""
        if paths[0].name.lower().endswith(SESSION_ENDING):
            return partial(self._app.replace_by_session, paths[0].name, unpacked_session(paths[0], folder))
        warnings: list[str] = []
        volume = volume_of_files(paths, lambda warning: warnings.append(_as_users_know(warning, paths)), series)
        return partial(self._app.replace_by_volume, volume, warnings)


def _scan_path(paths: list[Path]) -> str:
    """The path of a scan as users know it; for several slices, the name of their folder."""
    return paths[0].parent.name if len(paths) > 1 else _as_users_know(str(paths[0].absolute()), paths)


def _as_users_know(text: str, paths: list[Path]) -> str:
    """Remove from a message the private folder that files were uploaded to, which users do not know."""
    folder = paths[0].parent
    if not folder.parent.name.startswith(PREFIX):
        return text
    return text.replace(f"{folder}{os.sep}", "").replace(f"{folder.parent}{os.sep}", "")
