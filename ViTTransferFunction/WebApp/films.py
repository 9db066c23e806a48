"""The page's film of the 3D view: shot a frame at a time, while clicks are answered, and kept until it is fetched."""

from __future__ import annotations

import asyncio
import time
from dataclasses import replace
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any

from ..Logic.core.system.errors import InputError, shown
from ..Logic.core.system.private_folder import PrivateFolder, private_folder
from ..Logic.files.film import ENDINGS, FilmPlan, check_film_writer, film_steps
from ..Logic.scene.interface.number_texts import progress_text
from ..Logic.scene.views.filming import FRAMES_PER_SECOND, Filming
from .panel_form import panel_form
from .view_pictures import asked_size

if TYPE_CHECKING:
    from .app import WebApp

PAUSE_S = 0.02
"""Between frames, at least."""
PAUSE_SHARE = 0.25
"""And of what a frame took: so that clicks are heard of, whose answers come before the next frame, however slow frames are."""


class Films:
    """One film at a time.

    Args:
        app: whose 3D view is filmed, and whose page shows how far it is.

    Attributes:
        path: of the film, as soon as it is finished.
    """

    def __init__(self, app: WebApp) -> None:
        self._app = app
        self._filming: Filming | None = None
        self._folder: PrivateFolder | None = None
        self.path: Path | None = None

    def start(self, width: Any, height: Any, seconds: Any, ending: Any) -> None:
        """Begin a film in place of the one before; where one is being shot, nothing happens.

        Raises:
            InputError: it cannot be made, of that size or length or at all.
        """
        if self._filming is not None:
            return
        if ending not in ENDINGS:
            raise InputError(f"A film cannot be of the kind {shown(ending)}; expected {' or '.join(ENDINGS)}.")
        size, seconds = asked_size(width, height), float(seconds or 0.0)
        lengths = panel_form()["filmSecondsSpinBox"]["range"]
        if not lengths["min"] <= seconds <= lengths["max"]:
            known = f"{lengths['min']:g} to {lengths['max']:g}"
            raise InputError(f"A film of {seconds:g} seconds cannot be made; expected {known}.")
        plan = FilmPlan(Path(f"film{ending}"), round(FRAMES_PER_SECOND * seconds), seconds)
        check_film_writer(plan.path)
        self.give_up()
        self._folder = private_folder()
        plan = replace(plan, path=Path(self._folder.name, plan.path))
        scene, window = self._app.scene, self._app.views.view_3d.render_window()
        self._filming = Filming(scene, window, size, plan.frames, plan.drawings, lambda frame: film_steps(plan, frame))
        self._show()
        self._app.begin(self._shoot(self._filming, plan.path))

    def give_up(self) -> None:
        """Let go of the film, finished or not; nothing is left of it."""
        filming, folder = self._filming, self._folder
        self._filming = self._folder = self.path = None
        if filming is not None and folder is not None:
            # What is being written ends when it next looks, which may be seconds later.
            Thread(target=_let_go, args=(filming, folder), daemon=True).start()
        elif folder is not None:
            folder.cleanup()
        self._show()

    async def _shoot(self, filming: Filming, path: Path) -> None:
        finished = False
        try:
            while self._filming is filming and not finished:
                begun = time.monotonic()
                if not self._app.session.awaits_maps:
                    finished = filming.advance()
                    self._show()
                await asyncio.sleep(max(PAUSE_S, PAUSE_SHARE * (time.monotonic() - begun)))
        except InputError as error:
            self._app.report(str(error), "film")
            self._app.refresh()
        finally:
            if self._filming is filming:
                if finished:
                    self._filming, self.path = None, path
                    self._show()
                else:
                    self.give_up()

    def _show(self) -> None:
        """Have the page show how far the film is, and that it is there."""
        progress = self._filming.progress if self._filming else None
        with self._app.server.state as state:
            state.film = progress and {"text": progress_text(progress), "share": progress.done / progress.total}
            state.film_ready = self.path is not None


def _let_go(filming: Filming, folder: PrivateFolder) -> None:
    filming.cancel()
    folder.cleanup()


def film_endings() -> list[str]:
    """The endings of films that can be made here; a GIF is offered in any case, and says what it lacks."""
    return [ending for ending in ENDINGS[::-1] if ending == ".gif" or _can_be_made(ending)]


def _can_be_made(ending: str) -> bool:
    try:
        check_film_writer(Path(f"film{ending}"))
    except InputError:
        return False
    return True
