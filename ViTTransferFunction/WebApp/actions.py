"""The actions that the page can request, by name; each does one thing to the session, as the panel's controls do."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ..Logic.core.system.errors import InputError, shown
from ..Logic.scene.annotation_tool import TOOLS
from ..Logic.scene.classes.class_state import ClassState
from ..Logic.scene.interface.cache_contents import CacheContents
from ..Logic.scene.interface.choice_words import style_words
from ..Logic.scene.interface.choices import check_possible, choices
from ..Logic.scene.session import SceneSession
from ..Logic.scene.views.exported_renderings import exported_renderings, remove_exported
from ..Logic.scene.volumes.volume_window import set_window
from .opening import OPENING
from .panel_state import PARAMETERS, color_of_hex
from .view_camera import load_camera

if TYPE_CHECKING:
    from .app import WebApp

_SETTINGS: dict[str, type] = {"opacity": float, "proximity": float, "refine": bool, "iso": float, "tone": float, "edges": float}
"""Fields of the selected class that the page's sliders and boxes set."""
_FOLDED = ("appearance", "advanced")
"""Parts of the page whose content is made only while they are open."""
_NOT_OPENED = ("notReadable", "nothingDropped", "notSent")
"""Actions by which the page reports why nothing was opened; the message stays until something else is opened."""


class Actions:
    """The table of actions.

    Args:
        app: the app whose session and tools they work on.
    """

    def __init__(self, app: WebApp) -> None:
        self._app = app
        self._offered = choices() | {"context": dict.fromkeys(app.session.views.context_names, "")}
        self._by_name: dict[str, Callable[..., Any]] = {
            "extract": app.extraction.press,
            "cancel": self._cancel,
            "consent": app.extraction.answer,
            "series": lambda line: app.opening.series.answer(str(line)),
            "addClass": self._add_class,
            "select": lambda id_: app.session.select_class(self._class(id_).id),
            "rename": lambda id_, name: self._set(id_, name=str(name)),
            "recolor": lambda id_, color: self._set(id_, color=color_of_hex(str(color))),
            "show": lambda id_, visible: self._set(id_, visible=bool(visible)),
            "remove": self._remove_class,
            "moveUp": self._of_selected(lambda session, id_: session.annotations.move_class(id_, -1)),
            "moveDown": self._of_selected(lambda session, id_: session.annotations.move_class(id_, 1)),
            "set": self._set_selected,
            "thresholdAutomatic": self._set_threshold_automatic,
            "undo": lambda: app.session.annotations.undo(),
            "redo": lambda: app.session.annotations.redo(),
            "removeLast": self._of_selected(lambda session, id_: session.annotations.remove_last_point(id_)),
            "smaller": self._of_selected(lambda session, id_: session.annotations.step_size(id_, -1)),
            "larger": self._of_selected(lambda session, id_: session.annotations.step_size(id_, 1)),
            "lookCloser": self._of_selected(lambda session, id_: session.close_ups.look_closer(id_)),
            "lookAtWhole": self._of_selected(lambda session, id_: session.close_ups.look_at_whole(id_)),
            "sizeAsChosen": lambda: self._set_fields(size=0.0, iso=None),
            "previousClass": lambda: app.session.selection.select_neighbour(-1),
            "nextClass": lambda: app.session.selection.select_neighbour(1),
            "nextPoint": self._of_selected(lambda session, id_: session.show_next_point(id_)),
            "putDown": app.tool.put_down,
            "removePoints": self._of_selected(lambda session, id_: session.annotations.remove_points(id_)),
            "duplicate": self._of_selected(lambda session, id_: session.selection.duplicate(id_)),
            "parameter": self._set_parameter,
            "style": self._set_style,
            "look": self._set_look,
            "fade": lambda share: self._set_fields(ramp=1.0 - min(max(float(share), 0.0), 1.0)),
            "networkWindow": self._set_network_window,
            "film": app.films.start,
            "cancelFilm": app.films.give_up,
            "loadCamera": self._load_camera,
            "exportRendering": lambda: app.session.views.export_rendering(),
            "removeExported": self._remove_exported,
            "continueSegment": lambda segment_id: app.session.continue_segment(str(segment_id)),
            "clearFeatures": lambda: CacheContents(app.session.parameters).clear_features(),
            "removeModel": lambda: app.session.remove_model(),
            "window": self._set_window,
            "restorePoints": app.unsaved_points.restore,
            "discardPoints": app.unsaved_points.discard,
            "write": lambda corrections="ask": app.write_segments(corrections),
            "updateAndDownload": app.update_and_download,
            "showSegments": self._show_segments,
            "notReadable": self._tell_of_unreadable_drop,
            "nothingDropped": self._tell_of_empty_drop,
            "notSent": self._tell_of_broken_upload,
            "closeMessages": app.close_messages,
        }
        for tool in TOOLS:
            self._by_name[tool] = self._toggle(tool)
        for part in _FOLDED:
            self._by_name[part] = self._unfold(part)

    def __call__(self, name: str, *arguments: Any) -> bool:
        """Carry out a request of the page; unknown actions are ignored, and an InputError is shown to the user.

        Returns:
            Whether the action was carried out.
        """
        action = self._by_name.get(name)
        if action is None:
            return False
        # A new attempt at the same setting or action removes the message of the former one.
        about = OPENING if name in _NOT_OPENED else f"{name} {arguments[0]}" if name == "parameter" and arguments else name
        self._app.try_again(about)
        done = True
        try:
            action(*arguments)
        except InputError as error:
            done = False
            self._app.report(str(error), about)
        self._app.refresh()
        return done

    def _toggle(self, tool: Any) -> Callable[[], None]:
        return lambda: self._app.tool.toggle(tool)

    def _of_selected(self, do: Callable[[SceneSession, str], object]) -> Callable[[], None]:
        """An action on the session and the id of the selected class; it does nothing if no class is selected."""

        def act() -> None:
            selected = self._app.session.selected_class
            if selected is not None:
                do(self._app.session, selected.id)

        return act

    def _unfold(self, part: str) -> Callable[[bool], None]:
        """An action by which the page says whether it shows a part."""

        def unfold(opened: bool) -> None:
            self._app.server.state[f"{part}_open"] = bool(opened)

        return unfold

    def _cancel(self) -> None:
        self._app.extraction.give_up()
        self._app.session.cancel()

    def _tell_of_unreadable_drop(self, reason: str) -> None:
        raise InputError(
            f"What was dropped cannot be read by the browser ({shown(str(reason))}), and nothing was opened. Check that its "
            "files are still there and that you may read them."
        )

    def _tell_of_empty_drop(self) -> None:
        raise InputError(
            "What was dropped has no files in it, and nothing was opened. Drop a scan's file, or the folder with its slices."
        )

    def _tell_of_broken_upload(self) -> None:
        raise InputError("The files did not arrive, since the connection was lost, and nothing was opened. Open them again.")

    def _class(self, id_: str) -> ClassState:
        """The class with an id that the page sent. Raises InputError if it was removed meanwhile."""
        for state in self._app.session.classes:
            if state.id == id_:
                return state
        raise InputError("This structure was removed meanwhile.")

    def _set(self, id_: str, **fields: Any) -> None:
        self._app.session.annotations.set_class(self._class(id_).id, **fields)

    def _add_class(self) -> None:
        """Add a class and select it; the next click in a view is its first point."""
        session, tool = self._app.session, self._app.tool
        session.select_class(session.annotations.add_class().id)
        if tool.tool != "pointOn":
            tool.toggle("pointOn")

    def _remove_class(self, id_: str = "") -> None:
        """Remove a class, by default the selected one, and select the next one."""
        session = self._app.session
        state = self._class(id_) if id_ else session.selected_class
        if state is not None:
            session.selection.remove(state.id)

    def _set_selected(self, field: str, value: Any) -> None:
        if field in _SETTINGS:
            value = _SETTINGS[field](value)
            self._set_fields(**{field: value if isinstance(value, bool) else min(max(value, 0.0), 1.0)})

    def _set_fields(self, **fields: Any) -> None:
        selected = self._app.session.selected_class
        if selected is not None:
            self._app.session.annotations.set_class(selected.id, **fields)

    def _set_threshold_automatic(self, automatic: bool) -> None:
        selected = self._app.session.selected_class
        if selected is not None:
            self._set_fields(iso=None if automatic else self._app.session.chosen_iso(selected.id))

    def _set_parameter(self, name: str, value: Any) -> None:
        """Set one of the session's settings. Raises InputError if the value is not possible."""
        if name in PARAMETERS and value is not None:
            parameters = self._app.session.parameters
            value = type(parameters.DEFAULTS[name])(value)
            check_possible(name, value, self._offered)
            parameters.set(name, value)

    def _set_style(self, style: str) -> None:
        """Choose the selected class's style in 3D; tone, ramp and edges become those of the style."""
        if style in style_words():
            self._set_fields(style=style)

    def _set_look(self, low: float | None, high: float | None, automatic: bool) -> None:
        """Set the intensities between which the selected class gets brighter in 3D; None: unchanged."""
        selected = self._app.session.selected_class
        shown = self._app.session.views.window(selected) if selected is not None else None
        if automatic:
            self._set_fields(low=None, high=None)
        elif shown is not None:
            self._set_fields(low=_or(low, shown[0]), high=_or(high, shown[1]))

    def _load_camera(self, text: str) -> None:
        """Set the camera of the 3D view to that of a file with this text."""
        view, state = self._app.views.view_3d, self._app.server.state
        state.picture_width, state.picture_height = load_camera(self._app.session, view.render_window(), str(text))
        view.schedule_render()

    def _set_network_window(self, low: float | None, high: float | None, automatic: bool) -> None:
        """Set the range of intensities that the network sees; None: unchanged."""
        parameters = self._app.session.parameters
        shown = parameters.window
        parameters.set_window(_or(low, shown[0]), _or(high, shown[1]), bool(automatic))

    def _remove_exported(self, id_: str) -> None:
        """Remove an exported rendering from the scene."""
        for volume in exported_renderings(self._app.scene):
            if volume.GetID() == id_:
                remove_exported(self._app.scene, volume)

    def _show_segments(self, visible: bool) -> None:
        """Show or hide all segments, in all views."""
        node = self._app.session.parameters.segmentation
        if node is not None:
            node.CreateDefaultDisplayNodes()
            node.GetDisplayNode().SetVisibility(bool(visible))

    def _set_window(self, low: float | None, high: float | None) -> None:
        """Set one or both ends of the slices' window; None: unchanged."""
        volume = self._app.session.parameters.volume
        if volume is not None:
            display = volume.GetScalarVolumeDisplayNode()
            set_window(volume, _or(low, display.GetWindowLevelMin()), _or(high, display.GetWindowLevelMax()))


def _or(given: float | None, otherwise: float) -> float:
    """The page's value as a number, or the present one if the page sent None."""
    return otherwise if given is None else float(given)
