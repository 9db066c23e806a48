"""The tools that add and remove points: place, brush and erase, undo, redo, and remove the last one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import slicer

from ViTTransferFunction.Widget.place_mode import PlaceMode
from ViTTransferFunction.Widget.section import Section
from ViTTransferFunction.Widget.stroke_mode import StrokeMode

Tool = Literal["pointOn", "pointOff", "brushOn", "brushOff", "eraser"]


class AnnotationTools(Section):
    """At most one tool is in the user's hand; it works on the selected class, whichever that becomes.

    Attributes:
        tool: the one in hand, or None.
    """

    def __init__(self, ui: Any, report: Callable[[str], None]) -> None:
        super().__init__(ui, report)
        self.tool: Tool | None = None
        self._used_on: str | None = None
        self._place_mode = PlaceMode(slicer.app.applicationLogic(), self.put_down)
        self._stroke_mode = StrokeMode()
        self._buttons: dict[Tool, Any] = {
            "pointOn": ui.pointOnButton,
            "pointOff": ui.pointOffButton,
            "brushOn": ui.brushOnButton,
            "brushOff": ui.brushOffButton,
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
        self._stroke_mode.stop()
        self._check_buttons()

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
        self._stroke_mode.stop()
        if self.tool in ("pointOn", "pointOff"):
            self._place_mode.start(self.session.annotations.points_node(selected.id, self.tool == "pointOn"))
        else:
            self._place_mode.stop()
            size_mm = self.ui.brushSizeSlider.value
            # The eraser's circles overlap, so that no point slips between two of them.
            step_mm = size_mm / 2 if self.tool == "eraser" else size_mm
            self._stroke_mode.start(step_mm, self._erase if self.tool == "eraser" else self._paint)
        self._check_buttons()

    def _paint(self, points_ras: np.ndarray, continued: bool) -> None:
        selected = self.selected
        if self.session is not None and selected is not None:
            self.session.annotations.add_points(selected.id, points_ras, self.tool == "brushOn", continued)

    def _erase(self, points_ras: np.ndarray, continued: bool) -> None:
        if self.session is not None:
            self.session.annotations.erase_points(points_ras, self.ui.brushSizeSlider.value, continued)

    def _on_brush_size(self) -> None:
        if self.tool in ("brushOn", "brushOff", "eraser"):
            self._use()

    def _check_buttons(self) -> None:
        for tool, button in self._buttons.items():
            button.checked = tool == self.tool
