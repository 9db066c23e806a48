"""The tools that add and remove points: place, brush, draw a region and erase, undo, redo, and remove the last one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import slicer

from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Logic.scene.place_mode import PlaceMode
from ViTTransferFunction.Logic.scene.region_tool import RegionTool, Shape
from ViTTransferFunction.Logic.scene.stroke_tool import StrokeTool
from ViTTransferFunction.Widget.section import Report, Section
from ViTTransferFunction.Widget.slice_tools import SliceTools

Tool = Literal["pointOn", "pointOff", "brushOn", "brushOff", "lassoOn", "lassoOff", "boxOn", "boxOff", "eraser"]

_REGIONS: dict[Tool, tuple[Shape, bool]] = {
    "lassoOn": ("lasso", True),
    "lassoOff": ("lasso", False),
    "boxOn": ("box", True),
    "boxOff": ("box", False),
}
"""What each tool for regions draws, and whether it lies inside the structure."""
_INSIDE_COLOR, _OUTSIDE_COLOR = (0.17, 0.51, 0.78), (0.82, 0.34, 0.18)
"""Those of the tools' icons."""


class AnnotationTools(Section):
    """At most one tool is in the user's hand; it works on the selected class, whichever that becomes.

    Attributes:
        tool: the one in hand, or None.
    """

    def __init__(self, ui: Any, report: Report) -> None:
        super().__init__(ui, report)
        self.tool: Tool | None = None
        self._used_on: str | None = None
        self._place_mode = PlaceMode(slicer.app.applicationLogic(), self.put_down)
        self._slice_tools = SliceTools()
        self._buttons: dict[Tool, Any] = {
            "pointOn": ui.pointOnButton,
            "pointOff": ui.pointOffButton,
            "brushOn": ui.brushOnButton,
            "brushOff": ui.brushOffButton,
            "lassoOn": ui.lassoOnButton,
            "lassoOff": ui.lassoOffButton,
            "boxOn": ui.boxOnButton,
            "boxOff": ui.boxOffButton,
            "eraser": ui.eraserButton,
        }
        for tool, button in self._buttons.items():
            self._connect(tool, button)
        ui.brushSizeSlider.valueChanged.connect(self._on_brush_size)
        ui.undoButton.clicked.connect(self.undo)
        ui.redoButton.clicked.connect(self.redo)
        ui.removeLastButton.clicked.connect(self.remove_last)

    def refresh(self) -> None:
        """Enable what can work now, and have the tool in hand work on the selected class."""
        selected, annotations = self.selected, self.session.annotations if self.session else None
        if self.tool and selected is None:
            self.put_down()
        elif self.tool and selected and selected.id != self._used_on:
            self._use()
        for button in self._buttons.values():
            button.enabled = selected is not None
        self.ui.undoButton.enabled = annotations is not None and annotations.can_undo
        self.ui.redoButton.enabled = annotations is not None and annotations.can_redo
        self.ui.removeLastButton.enabled = selected is not None and bool(selected.positive or selected.negative)

    def toggle(self, tool: Tool) -> None:
        """Take a tool, or put it down if it is the one in hand."""
        if tool == self.tool or self.selected is None:
            self.put_down()
        else:
            self.tool = tool
            self._use()

    def put_down(self) -> None:
        """Give the mouse back to the views."""
        self.tool = None
        self._place_mode.stop()
        self._slice_tools.stop()
        self._check_buttons()

    def end_unfinished(self) -> None:
        """Have clicks in the views do nothing that no button shows, whatever the scene was doing when it was saved."""
        self._place_mode.end_unfinished()

    def undo(self) -> None:
        """Take the last change back."""
        if self.session is not None:
            self.session.annotations.undo()

    def redo(self) -> None:
        """Make the change again that was taken back last."""
        if self.session is not None:
            self.session.annotations.redo()

    def remove_last(self) -> None:
        """Remove the point of the selected class that was placed last."""
        selected = self.selected
        if self.session is not None and selected is not None:
            self.session.annotations.remove_last_point(selected.id)

    def _connect(self, tool: Tool, button: Any) -> None:
        button.clicked.connect(lambda: self.toggle(tool))

    def _use(self) -> None:
        """Hand the mouse to the tool, for the selected class."""
        selected = self.selected
        assert self.session is not None
        assert selected is not None
        self._used_on = selected.id
        self._slice_tools.stop()
        if self.tool in ("pointOn", "pointOff"):
            self._place_mode.start(self.session.annotations.points_node(selected.id, self.tool == "pointOn"))
        elif self.tool in _REGIONS:
            self._place_mode.stop()
            shape, inside = _REGIONS[self.tool]
            color = _INSIDE_COLOR if inside else _OUTSIDE_COLOR
            self._slice_tools.start(
                lambda interactor, node, draw: RegionTool(interactor, node, draw, shape, color, self._add_region)
            )
        else:
            self._place_mode.stop()
            size_mm = self.ui.brushSizeSlider.value
            if self.tool == "eraser":
                # Its circles overlap, so that no point slips between two of them.
                self._use_strokes(size_mm / 2, size_mm, self._erase)
            else:
                # Points that are as far apart as the circle is wide.
                self._use_strokes(size_mm, size_mm / 2, self._paint)
        self._check_buttons()

    def _use_strokes(self, step_mm: float, radius_mm: float, on_point: Callable[[np.ndarray, bool], None]) -> None:
        self._slice_tools.start(lambda interactor, node, draw: StrokeTool(interactor, node, draw, step_mm, radius_mm, on_point))

    def _paint(self, points_ras: np.ndarray, continued: bool) -> None:
        selected = self.selected
        if self.session is not None and selected is not None:
            self.session.annotations.add_points(selected.id, points_ras, self.tool == "brushOn", continued)

    def _add_region(self, outline_ras: np.ndarray) -> None:
        selected = self.selected
        if self.session is not None and selected is not None and self.tool in _REGIONS:
            try:
                self.session.regions.add_outline(selected.id, outline_ras, positive=_REGIONS[self.tool][1])
            except InputError as error:
                self.report(str(error))

    def _erase(self, points_ras: np.ndarray, continued: bool) -> None:
        if self.session is not None:
            self.session.annotations.erase_points(points_ras, self.ui.brushSizeSlider.value, continued)

    def _on_brush_size(self) -> None:
        if self.tool in ("brushOn", "brushOff", "eraser"):
            self._use()

    def _check_buttons(self) -> None:
        for tool, button in self._buttons.items():
            button.checked = tool == self.tool
