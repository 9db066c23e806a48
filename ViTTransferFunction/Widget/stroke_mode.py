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

    def start(self, step_mm: float, on_point: Callable[[np.ndarray, bool], None]) -> None:
        """Call `on_point` with each point that a stroke leaves every `step_mm`, and whether it continues the stroke."""
        self.stop()
        self._restart = lambda: self.start(step_mm, on_point)
        self._tools = [StrokeTool(*place, step_mm, on_point) for place in self._views()]
        for tool in self._tools:
            tool.activate()

    def stop(self) -> None:
        """Give the mouse back to the views."""
        for tool in self._tools:
            tool.deactivate()
        self._tools = []
        self._restart = None

    def _views(self) -> list[tuple[Any, Any]]:
        """The interactor and the slice node of every slice view; there is none where Slicer runs without a window."""
        if self._layout_manager is None:
            return []
        widgets = [self._layout_manager.sliceWidget(name) for name in self._layout_manager.sliceViewNames()]
        return [(widget.sliceView().interactor(), widget.mrmlSliceNode()) for widget in widgets]

    def _on_layout_changed(self) -> None:
        # Another layout may have views that were not there when the stroke tools were made.
        if self._restart is not None:
            self._restart()
