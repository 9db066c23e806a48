"""A tool for the mouse, in all slice views at once."""

from __future__ import annotations

from typing import Any

import slicer

from ViTTransferFunction.Logic.scene.annotation_tool import MakeTool, SliceTool


class SliceTools:
    """Keeps a tool in every slice view, whichever window it is in, until it is stopped."""

    def __init__(self) -> None:
        self._tools: list[SliceTool] = []
        self._make: MakeTool | None = None
        self._layout_manager = slicer.app.layoutManager()
        if self._layout_manager is not None:
            self._layout_manager.layoutChanged.connect(self._on_layout_changed)

    def start(self, make: MakeTool) -> None:
        """Have a tool made for each view, and let them have the mouse."""
        self.stop()
        self._make = make
        # There is no view where Slicer runs without a window.
        names = self._layout_manager.sliceViewNames() if self._layout_manager is not None else ()
        self._tools = [self._tool(name, make) for name in names]
        for tool in self._tools:
            tool.activate()

    def stop(self) -> None:
        """Give the mouse back to the views."""
        for tool in self._tools:
            tool.deactivate()
        self._tools = []
        self._make = None

    def _tool(self, name: str, make: MakeTool) -> SliceTool:
        widget: Any = self._layout_manager.sliceWidget(name)
        return make(widget.sliceView().interactor(), widget.mrmlSliceNode(), lambda: self._draw(name))

    def _draw(self, name: str) -> None:
        # The view may be gone, with the layout that had it.
        widget = self._layout_manager.sliceWidget(name)
        if widget is not None:
            widget.sliceView().scheduleRender()

    def _on_layout_changed(self) -> None:
        # Another layout may have views that were not there when the tools were made.
        if self._make is not None:
            self.start(self._make)
