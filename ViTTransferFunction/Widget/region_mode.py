"""Lasso and box in all slice views at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import slicer

from ViTTransferFunction.Logic.core.colors import Color
from ViTTransferFunction.Logic.scene.region_tool import RegionTool, Shape


class RegionMode:
    """Turns drags in the slice views into regions until it is stopped."""

    def __init__(self) -> None:
        self._tools: list[RegionTool] = []
        self._restart: Callable[[], None] | None = None
        self._layout_manager = slicer.app.layoutManager()
        if self._layout_manager is not None:
            self._layout_manager.layoutChanged.connect(self._on_layout_changed)

    def start(self, shape: Shape, color: Color, on_region: Callable[[np.ndarray], None]) -> None:
        """Call `on_region` with the outline of each region that is drawn; `color` is its line's meanwhile."""
        self.stop()
        self._restart = lambda: self.start(shape, color, on_region)
        # There is no view where Slicer runs without a window.
        names = self._layout_manager.sliceViewNames() if self._layout_manager is not None else ()
        self._tools = [self._tool(name, shape, color, on_region) for name in names]
        for tool in self._tools:
            tool.activate()

    def stop(self) -> None:
        """Give the mouse back to the views."""
        for tool in self._tools:
            tool.deactivate()
        self._tools = []
        self._restart = None

    def _tool(self, name: str, shape: Shape, color: Color, on_region: Callable[[np.ndarray], None]) -> RegionTool:
        widget: Any = self._layout_manager.sliceWidget(name)
        interactor, slice_node = widget.sliceView().interactor(), widget.mrmlSliceNode()
        return RegionTool(interactor, slice_node, shape, color, on_region, draw=lambda: self._draw(name))

    def _draw(self, name: str) -> None:
        # The view may be gone, with the layout that had it.
        widget = self._layout_manager.sliceWidget(name)
        if widget is not None:
            widget.sliceView().scheduleRender()

    def _on_layout_changed(self) -> None:
        # Another layout may have views that were not there when the tools were made.
        if self._restart is not None:
            self._restart()
