"""Brush and eraser in all slice views at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import slicer

from ViTTransferFunction.Logic.scene.stroke_tool import StrokeTool


class StrokeMode:
    """Turns strokes in the slice views into points until it is stopped."""

    def __init__(self) -> None:
        self._tools: list[StrokeTool] = []
        self._restart: Callable[[], None] | None = None
        self._layout_manager = slicer.app.layoutManager()
        if self._layout_manager is not None:
            self._layout_manager.layoutChanged.connect(self._on_layout_changed)

    def start(self, step_mm: float, radius_mm: float, on_point: Callable[[np.ndarray, bool], None]) -> None:
        """Call `on_point` with each point that a stroke leaves every `step_mm`, and whether it continues the stroke.

        A circle of radius `radius_mm` follows the mouse.
        """
        self.stop()
        self._restart = lambda: self.start(step_mm, radius_mm, on_point)
        self._tools = [self._tool(name, step_mm, radius_mm, on_point) for name in self._view_names()]
        for tool in self._tools:
            tool.activate()

    def stop(self) -> None:
        """Give the mouse back to the views."""
        for tool in self._tools:
            tool.deactivate()
        self._tools = []
        self._restart = None

    def _view_names(self) -> list[str]:
        """Of every slice view, in whichever window; there is none where Slicer runs without a window."""
        return list(self._layout_manager.sliceViewNames()) if self._layout_manager is not None else []

    def _tool(self, name: str, step_mm: float, radius_mm: float, on_point: Callable[[np.ndarray, bool], None]) -> StrokeTool:
        widget: Any = self._layout_manager.sliceWidget(name)
        interactor, slice_node = widget.sliceView().interactor(), widget.mrmlSliceNode()
        return StrokeTool(interactor, slice_node, step_mm, radius_mm, on_point, draw=lambda: self._draw(name))

    def _draw(self, name: str) -> None:
        # The view may be gone, with the layout that had it.
        widget = self._layout_manager.sliceWidget(name)
        if widget is not None:
            widget.sliceView().scheduleRender()

    def _on_layout_changed(self) -> None:
        # Another layout may have views that were not there when the stroke tools were made.
        if self._restart is not None:
            self._restart()
