"""The app in a browser: Slicer's scene and views, a session of the Slicer module on the scene, and the page that shows both."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, Literal
from uuid import uuid4

from trame.app import get_server
from trame_slicer.core import SlicerApp

from ..Logic.core.system.errors import InputError
from ..Logic.core.system.private_folder import private_folder
from ..Logic.core.volumes.intensity_window import IntensityWindow
from ..Logic.core.volumes.volume import Volume
from ..Logic.scene.annotation_tool import AnnotationTool
from ..Logic.scene.classes.class_state import Classes
from ..Logic.scene.interface.choices import choices, make_possible
from ..Logic.scene.interface.messages import Messages
from ..Logic.scene.mrml.nodes import in_text
from ..Logic.scene.session import SceneSession
from ..Logic.scene.size_by_wheel import size_wheels
from ..Logic.scene.tools.brush_size import brush_scale, brush_size
from ..Logic.scene.tools.points_in_3d import MARKUPS_MANAGER
from ..Logic.scene.volumes.offered_volume import offered_volume
from ..Logic.scene.volumes.volume_window import set_window
from .access import Access
from .actions import Actions
from .extraction import ExtractionButton
from .films import Films
from .opening import Opening
from .page import build_page
from .page_requests import PageRequests
from .panel_form import panel_form
from .panel_state import session_state, shown_window, window_ends
from .routes import Routes
from .scene_files import import_scene, parameter_node
from .serving import Serving
from .slicer_views import SlicerViews, slice_tools
from .unsaved_points import UnsavedPoints
from .volumes import add_volume, windows_of
from .window_drag import WindowDrag, is_on_markup

POLL_S = 0.010
"""Interval at which the session is polled while something runs."""
CLICK_POLL_S = 0.005
"""The same while the result of a click is awaited."""
IDLE_POLL_S = 0.5
"""The same while nothing runs; short enough to notice the loss of the compute process."""
PICTURE_S = 0.05
"""Pause after maps have arrived, in which their picture is rendered and sent; the contours that follow would delay it."""
UNEXPECTED = "Something unexpected went wrong beside what the page waits for"
"""Message in the console before the traceback of an unexpected error."""
BRUSH_MM = 6.0
OF_THIS_COMPUTER = ("device", "weightsPath")
"""Parameters that are not taken from a loaded session."""
OF_ALL_VOLUMES = (*OF_THIS_COMPUTER, "preset", "model", "grid", "refinement", "onlyAnnotatedParts")
"""Parameters that are kept when another volume is opened."""


Work = tuple[Classes, str]
"""Structures, and the source of their segments if these were written."""
NO_WORK: Work = ((), "")


class WebApp:
    """One scene, one session, one page. Has to be created and used in a running asyncio loop.

    Args:
        settings: parameters (see `SceneParameters`) of each session, where they differ from the defaults.

    Attributes:
        server: the trame server.
        scene: the MRML scene.
        views: the three slice views and the 3D view.
        session: the session that the page shows; replaced when another volume or session is opened.
        tool: the tool of the mouse in the views.
        extraction: the button that computes features.
        films: makes films of the 3D view.
        opening: opens volumes, sessions and points from files.
        unsaved_points: keeps copies of the points until they are saved.
        actions: the actions that the page can request.
        requests: answers the page's requests, each once and in order.
    """

    def __init__(self, settings: dict[str, Any] | None = None) -> None:
        self.server = get_server(f"vittf {uuid4().hex}", client_type="vue3")
        self._slicer = SlicerApp()
        _keep_temporary_files_in_private_folder(self._slicer)
        self.scene = self._slicer.scene
        self._settings = dict(settings or {})
        self._messages = Messages()
        self._replaced: list[str] = []
        self._news = asyncio.Event()
        self._stale = False
        self._downloads_when_written = False
        self._tasks: set[asyncio.Task[None]] = set()
        self._stopped = asyncio.Event()
        self._brush_scale = 1.0
        brush_range = panel_form()["brushSizeSlider"]["range"]
        self.server.state.update({"brush_mm": BRUSH_MM, "brush_range": brush_range, "theme": "dark"})
        self.server.state.update({"corrected": [], "consent": ""})
        self.server.state.update({"saving": None, "film": None, "film_ready": False, "download_due": False})
        self.views = SlicerViews(self.server, self._slicer, lambda: self.session.awaits_maps, self._delays_3d)
        self.tool = AnnotationTool(
            self._slicer.app_logic, slice_tools(self.views), self._brush_mm, self.report, self._on_changed
        )
        self._wheel = slice_tools(self.views)
        self._wheel.start(size_wheels(lambda: self.session))
        self._window_drags = slice_tools(self.views)
        self._window_drags.start(self._window_drag)
        self.session = self._new_session()
        self._saved = self.work
        self.extraction = ExtractionButton(lambda: self.session)
        self.films = Films(self)
        self.opening = Opening(self)
        self.unsaved_points = UnsavedPoints(self)
        self.actions = Actions(self)
        self.requests = PageRequests(self.server.controller.trigger_fn)
        self.server.trigger("ask")(self._answer)
        self.server.trigger("act")(self.actions)
        self.server.trigger("open_path")(self.opening.open_typed)
        self.server.trigger("open_sample")(self.opening.open_sample)
        self.server.state.change("brush_mm")(lambda **_: self.tool.follow_brush_size())
        build_page(self.server, self.session.views.context_names)
        self.refresh()

    async def start(
        self,
        host: str,
        port: int,
        volume: Path | None,
        on_ready: Callable[[str], None],
        on_warning: Callable[[str], None],
        series: str | None,
    ) -> None:
        """Serve the page until `stop` is called, or the browser's tab was closed or disconnected and did not come back.

        Args:
            host: host name or address to listen on.
            port: port to listen on; 0: any free one.
            volume: image, DICOM folder or saved session to open; None: nothing.
            on_ready: called with the page's address when it can be opened; the address grants access.
            on_warning: called with a warning if other computers can reach the page.
            series: the DICOM series to open, as in `choose_series`.

        Raises:
            InputError: it is not possible to listen on this host and port.
        """
        access = Access(host, on_left=self.stop, on_entered=self._expect_page)
        if access.warning:
            on_warning(access.warning)
        self.server.controller.on_server_bind.add(Routes(self, access.path).add)
        self.server.controller.on_server_ready.add(lambda **_: on_ready(access.address(self.server.port)))
        serving = Serving(self.server, access, port)
        following = asyncio.create_task(self._follow())
        if volume is not None:
            self.begin(self.opening.open([volume], series))
        stopped = asyncio.create_task(self._stopped.wait())
        try:
            await serving.until_any(following, stopped)
        finally:
            for task in (following, stopped, *self._tasks):
                task.cancel()
            self.opening.give_up()
            self.films.give_up()
            self.unsaved_points.end()
            self.session.close()
            await serving.end()

    def stop(self) -> None:
        """Make `start` return."""
        self._stopped.set()

    @property
    def stopping(self) -> bool:
        """Whether `stop` was called. May be read from any thread."""
        return self._stopped.is_set()

    def report(self, message: str, about: str = "", solved: Callable[[], bool] | None = None) -> None:
        """Show a message why something was not done, until its cause is gone or it is tried again.

        Args:
            message: the message to the user.
            about: name of what was requested, for `try_again`; empty: nothing that can be tried again.
            solved: returns whether the cause is gone; None: it is when the structures are changed next.
        """
        before = self.session, self.session.classes
        self._messages.put(message, solved or (lambda: (self.session, self.session.classes) != before), about)
        self._on_changed()

    def try_again(self, about: str) -> None:
        """Remove the message about something that is being requested again."""
        self._messages.try_again(about)

    def close_messages(self) -> None:
        """Remove all messages, which the user has read."""
        self._messages.clear()

    def write_segments(self, corrections: Literal["ask", "keep", "overwrite"]) -> None:
        """Write the structures as segments; "ask": if segments were corrected by hand, the page asks the user first."""
        self.server.state.corrected = []
        if corrections in ("ask", "keep", "overwrite"):
            self.session.segments.write(corrections)

    def update_and_download(self) -> None:
        """Write the current structures as segments, and have the page download these when they are written."""
        self._downloads_when_written = True
        self.write_segments("ask")

    def refresh(self) -> None:
        """Update the page to the state of the session."""
        self._stale = False
        self.tool.session = self.session
        self._fit_brush()
        self.tool.follow_selection()
        self.extraction.go_on()
        while error := self.session.take_error():
            self._messages.put(error, partial(self._is_solved, self.session, error))
        with self.server.state as state:
            corrected = self.session.segments.take_corrected()
            if corrected:
                state.corrected = [in_text(name) for name in corrected]
            shown = {"with_cache": bool(state.advanced_open), "with_look": bool(state.appearance_open)}
            state.update(session_state(self.session, **shown))
            state.update({
                "tool": self.tool.tool or "",
                "message": "\n\n".join(self._messages.standing()),
                "consent": self.extraction.question,
                "pressed": self.extraction.pressed,
                "download_due": state.download_due or self._is_written_for_download(),
                "unsaved": self.work not in (NO_WORK, self._saved),
            })  # fmt: skip
        self.unsaved_points.note()
        self.views.settle()

    def _is_written_for_download(self) -> bool:
        """Whether the segments that `update_and_download` requested have been written."""
        awaited, written = self._downloads_when_written, self.session.segments.take_written()
        self._downloads_when_written = awaited and not written and bool(self.session.progress or self.server.state.corrected)
        return awaited and written and self.session.segments.exist

    def _is_solved(self, session: SceneSession, error: str) -> bool:
        return self.session is not session or error not in session.errors

    @property
    def work(self) -> Work:
        """The current work, which is lost with the page unless it is saved."""
        return self.session.classes, self.session.segments.source

    def mark_saved(self, work: Work) -> None:
        """Note that this work was saved; until it changes, the page can be closed without a question."""
        self._saved = work
        self.unsaved_points.mark_saved(work[0])
        self.refresh()

    def show_saving(self, name: str, share: float | None) -> None:
        """Show the progress of making a file for download, 0 to 1; None: it is complete or given up."""
        with self.server.state as state:
            state.saving = None if share is None else {"name": name, "percent": int(100 * share)}

    def begin(self, work: Coroutine[Any, Any, None]) -> None:
        """Run work in the background, until it or the app ends."""
        task = asyncio.create_task(self._beside_all_else(work))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def replace_by_session(self, name: str, scene_file: Path) -> None:
        """Replace the open volume by an unpacked session; `name` is its name in messages.

        Raises:
            InputError: the session cannot be read completely, or it is unclear which of its volumes is meant.
        """
        self._close_scene()
        try:
            import_scene(self.scene, scene_file)
        finally:
            self._take_session(saved=True)
        if self.session.parameters.volume is None:
            # As in a session that was saved in Slicer without this module.
            selection = self.scene.GetSingletonNode("Singleton", "vtkMRMLSelectionNode")
            volume = offered_volume(self.scene, selection.GetActiveVolumeID() if selection is not None else None)
            if volume is None:
                raise InputError(
                    f"In {name} no volume is chosen. Open the volume's own file, or choose it in Slicer's module "
                    "ViT Transfer Function, and save the session again."
                )
            self.session.set_volume(volume)
            self._saved = self.work
            self._show_volume(volume)

    def replace_by_volume(self, volume: Volume, warnings: list[str]) -> None:
        """Replace the open volume by another one, without structures, and show the warnings."""
        self._close_scene()
        node = add_volume(self.scene, volume)
        self._take_session()
        self.session.set_volume(node)
        self.views.show(node)
        first, *_ = self._offer_windows(node)
        set_window(node, first.low, first.high)
        for warning in warnings:
            self.report(warning)

    async def _follow(self) -> None:
        """Poll the session for results, and update the page, until cancelled."""
        self.session.start_computing()
        while True:
            awaited_maps = self.session.awaits_maps
            self._go_on_after(self.session.poll)
            if self._stale:
                self._go_on_after(self.refresh)
            if awaited_maps and not self.session.awaits_maps:
                await asyncio.sleep(PICTURE_S)
            pace_s = CLICK_POLL_S if self.session.awaits_maps else POLL_S if self.session.busy else IDLE_POLL_S
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._news.wait(), pace_s)
            if self._news.is_set():
                self._news.clear()
                await asyncio.sleep(0)  # Lets the loop do other work first, such as sending pictures.

    def _answer(self, *request: Any) -> Any:
        """Answer a request of the page. Errors are shown there, and raised to the server, which prints and answers them."""
        try:
            return self.requests(*request)
        except Exception as error:
            self.session.tell_of_defect(error)
            raise

    async def _beside_all_else(self, work: Coroutine[Any, Any, None]) -> None:
        """Await work. Errors are shown and printed, since no caller receives them."""
        try:
            await work
        except Exception as error:
            self._tell_of_defect(self.session, error)

    def _go_on_after(self, step: Callable[[], None]) -> None:
        """Call a function. Errors are shown and printed, and the app keeps running, so that no work is lost."""
        session = self.session
        try:
            step()
        except Exception as error:
            self._tell_of_defect(session, error)

    def _tell_of_defect(self, session: SceneSession, error: Exception) -> None:
        """Show an error and print its traceback, once until the user continues, since it may be raised repeatedly."""
        if session.tell_of_defect(error):
            asyncio.get_running_loop().call_exception_handler({"message": UNEXPECTED, "exception": error})

    def _expect_page(self) -> None:
        """Prepare for a page that is being loaded; in the page before, a mouse button may have been held."""
        self.requests.expect_page()
        self.views.leave()

    def _on_changed(self) -> None:
        self._stale = True
        self._news.set()

    def _new_session(self, saved: bool = False) -> SceneSession:
        """A session on the scene; `saved`: the scene comes with parameters, of which only `OF_THIS_COMPUTER` are replaced."""
        session = SceneSession(
            self.scene,
            self._slicer.app_logic,
            parameter_node(self.scene),
            windows_3d=lambda: [self.views.view_3d.render_window()],
            points_3d=lambda: [self.views.view_3d.get_displayable_manager_by_class(MARKUPS_MANAGER)],
        )
        of_this_computer = {name: value for name, value in self._settings.items() if name in OF_THIS_COMPUTER}
        for name, value in of_this_computer.items():
            session.parameters.set(name, value)
        self._replaced = make_possible(session.parameters, choices())
        if not saved:
            for name, value in self._settings.items():
                session.parameters.set(name, value)
        session.add_observer(self._on_changed)
        return session

    def _close_scene(self) -> None:
        self.tool.put_down()
        self.extraction.give_up()
        self.films.give_up()
        self.unsaved_points.leave()
        self._settings |= {name: self.session.parameters.get(name) for name in OF_ALL_VOLUMES}
        self.session.close()
        self._downloads_when_written = False
        self.scene.Clear(0)

    def _take_session(self, saved: bool = False) -> None:
        self.session = self._new_session(saved)
        self._saved = self.work
        self.tool.session = self.session
        self.tool.end_unfinished()
        self.session.start_computing()
        volume = self.session.parameters.volume
        if volume is not None and volume.GetImageData() is None:
            volume = None  # Its file was missing in the session, which is reported to the user.
        self._show_volume(volume)
        for message in self._replaced:
            self.report(message)
        self._on_changed()

    def _show_volume(self, volume: Any) -> None:
        """Show the volume of a session; None: nothing."""
        self.views.show(volume)
        self._offer_windows(volume)

    def _offer_windows(self, volume: Any) -> list[IntensityWindow]:
        """Offer the common intensity windows for a volume on the page; returns them."""
        windows = windows_of(volume) if volume else {}
        with self.server.state as state:
            state.windows = [{"text": text, **window_ends(window.low, window.high)} for text, window in windows.items()]
        return list(windows.values())

    def _window_drag(self, interactor: Any, slice_node: Any, draw: Callable[[], None]) -> WindowDrag:
        """Changes the window by left drags if no tool is active and no point is under the mouse, and with Ctrl in any case."""

        def is_free() -> bool:
            return self.tool.tool is None and not is_on_markup(self.scene)

        def show() -> None:
            # Sent with the answer to a batch of mouse events, once for all moves in it.
            self.server.state.window = shown_window(self.session.parameters.volume)

        return WindowDrag(interactor, lambda: self.session.parameters.volume, is_free, show)

    def _delays_3d(self) -> bool:
        """Whether the 3D view is drawn later because the session is busy; not while the user changes the look of structures."""
        return self.session.busy and not self.session.views.drawing_quickly

    def _fit_brush(self) -> None:
        """Adapt the range of brush sizes to the volume's size, and scale the chosen size with it."""
        scale, before = brush_scale(self.session.body_scale), self._brush_scale
        if scale != before:
            self._brush_scale = scale
            with self.server.state as state:
                ends = panel_form()["brushSizeSlider"]["range"]
                state.brush_range = {end: brush_size(size_mm, scale) for end, size_mm in ends.items()}
                state.brush_mm = brush_size(state.brush_mm / before, scale)

    def _brush_mm(self) -> float:
        return float(self.server.state.brush_mm)


def _keep_temporary_files_in_private_folder(app: SlicerApp) -> None:
    """Replace trame-slicer's temporary folder, which would stay if the app is killed, by one that is removed later."""
    manager = app.io_manager
    manager.cache_dir.cleanup()
    manager.cache_dir = private_folder()
    manager.remote_io.GetCacheManager().SetRemoteCacheDirectory(manager.cache_dir.name)
