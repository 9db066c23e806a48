"""The tools that add and remove points, of which the user has at most one in hand: place, brush, draw, erase."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, get_args

import numpy as np

from ..core.system.errors import InputError
from .classes.class_state import ClassState
from .interface.message_texts import no_structure_text
from .session import SceneSession
from .tools.drawing_tool import DrawingTool, Shape
from .tools.free_mouse import FreeMouse
from .tools.place_mode import PlaceMode
from .tools.slice_tools import SliceTools
from .tools.stroke_tool import StrokeTool

Tool = Literal[
    "pointOn", "pointOff", "brushOn", "brushOff", "lassoOn", "lassoOff", "boxOn", "boxOff", "outline", "diameter", "eraser"
]
TOOLS: tuple[Tool, ...] = get_args(Tool)
"""In the order in which front ends show them."""
TOOL_ICONS: dict[Tool, str] = {tool: tool[0].upper() + tool[1:] for tool in TOOLS}
"""The names of their icons' files, without the ending."""

_SHAPES: dict[Tool, tuple[Shape, bool]] = {
    "lassoOn": ("lasso", True),
    "lassoOff": ("lasso", False),
    "boxOn": ("box", True),
    "boxOff": ("box", False),
    "outline": ("lasso", True),
    "diameter": ("line", True),
}
"""What each tool that draws shapes draws, and whether it lies inside the structure."""
INSIDE_COLOR, OUTSIDE_COLOR = (0.17, 0.51, 0.78), (0.82, 0.34, 0.18)
"""Those of the tools' icons."""


class AnnotationTool:
    """The tool in the user's hand; it works on the selected class, whichever that becomes.

    Args:
        app_logic: the application's logic, which knows the nodes that decide what the mouse does.
        slice_tools: has tools work in the slice views.
        brush_mm: how large the brush is now, in millimetres.
        report: tells the user why something was not done.
        on_changed: called after a tool was taken or put down.

    Attributes:
        tool: the one in hand, or None.
        session: whose classes are annotated; None while there is none.
    """

    def __init__(
        self,
        app_logic: Any,
        slice_tools: SliceTools,
        brush_mm: Callable[[], float],
        report: Callable[[str], None],
        on_changed: Callable[[], None],
    ) -> None:
        self.tool: Tool | None = None
        self.session: SceneSession | None = None
        self._used_on: tuple[Any, str] | None = None
        self._place_mode = PlaceMode(app_logic, self.put_down)
        self._free_mouse = FreeMouse(app_logic, self.put_down)
        self._slice_tools = slice_tools
        self._brush_mm = brush_mm
        self._report = report
        self._on_changed = on_changed

    def toggle(self, tool: Tool) -> None:
        """Take a tool, or put it down if it is the one in hand; where there is no structure, tell what to do first."""
        if tool == self.tool:
            self.put_down()
        elif self._selected is None:
            self._report(no_structure_text(self.session is not None and self.session.parameters.volume is not None))
        else:
            self.tool = tool
            self._use()

    def put_down(self) -> None:
        """Give the mouse back to the views."""
        self.tool = self._used_on = None
        self._place_mode.stop()
        self._free_mouse.stop()
        self._slice_tools.stop()
        self._on_changed()

    def follow_selection(self) -> None:
        """Have the tool in hand work on the selected class; put it down where there is none."""
        selected = self._selected
        if self.tool and selected is None:
            self.put_down()
        elif self.tool and selected and self._used_on != self._where(selected):
            self._use()

    def follow_brush_size(self) -> None:
        """Take the brush's size up anew."""
        if self.tool in ("brushOn", "brushOff", "eraser"):
            self._use()

    def end_unfinished(self) -> None:
        """Have clicks in the views do nothing to a structure that no button shows, whatever was begun elsewhere."""
        self._place_mode.end_unfinished()

    @property
    def _selected(self) -> ClassState | None:
        return self.session.selected_class if self.session else None

    def _where(self, selected: ClassState) -> tuple[Any, str]:
        """Volume and class, since classes of two volumes may have the same id."""
        return (self.session.parameters.volume if self.session else None), selected.id

    def _use(self) -> None:
        """Hand the mouse to the tool, for the selected class."""
        selected = self._selected
        assert self.session is not None
        assert selected is not None
        self._used_on = self._where(selected)
        self._slice_tools.stop()
        if self.tool in ("pointOn", "pointOff"):
            self._free_mouse.stop()
            self._place_mode.start(self.session.annotations.points_node(selected.id, self.tool == "pointOn"))
        else:
            self._place_mode.stop()
            self._free_mouse.start()
            self._use_in_slices()
        self._on_changed()

    def _use_in_slices(self) -> None:
        if self.tool in _SHAPES:
            shape, inside = _SHAPES[self.tool]
            color = INSIDE_COLOR if inside else OUTSIDE_COLOR
            self._slice_tools.start(
                lambda interactor, node, draw: DrawingTool(
                    interactor, node, draw, shape, color, self._add_drawn, self._tell_to_drag
                )
            )
        else:
            size_mm = self._brush_mm()
            if self.tool == "eraser":
                # Its circles overlap, so that no point slips between two of them.
                self._use_strokes(size_mm / 2, size_mm, self._erase)
            else:
                # Points that are as far apart as the circle is wide.
                self._use_strokes(size_mm, size_mm / 2, self._paint)

    def _use_strokes(self, step_mm: float, radius_mm: float, on_point: Callable[[np.ndarray, bool], None]) -> None:
        self._slice_tools.start(lambda interactor, node, draw: StrokeTool(interactor, node, draw, step_mm, radius_mm, on_point))

    def _paint(self, points_ras: np.ndarray, continued: bool) -> None:
        selected = self._selected
        if self.session is not None and selected is not None:
            self.session.annotations.add_points(selected.id, points_ras, self.tool == "brushOn", continued)

    def _add_drawn(self, corners_ras: np.ndarray) -> None:
        selected = self._selected
        if self.session is None or selected is None or self.tool not in _SHAPES:
            return
        _, inside = _SHAPES[self.tool]
        try:
            if self.tool == "diameter":
                self.session.regions.add_diameter(selected.id, corners_ras)
            elif self.tool == "outline":
                self.session.regions.add_outline(selected.id, corners_ras)
            else:
                self.session.regions.add_region(selected.id, corners_ras, inside)
        except InputError as error:
            self._report(str(error))

    def _tell_to_drag(self) -> None:
        self._report("Nothing was drawn, so no points were added. Hold the left button down, and drag.")

    def _erase(self, points_ras: np.ndarray, continued: bool) -> None:
        if self.session is not None:
            self.session.annotations.erase_points(points_ras, self._brush_mm(), continued)
