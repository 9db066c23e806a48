"""A tool for the mouse, in the slice views of Slicer's layout."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import slicer

from ViTTransferFunction.Logic.scene.tools.slice_tools import Draw, SliceTools


class LayoutSliceTools(SliceTools):
    """Keeps a tool in every slice view, whichever window it is in, until it is stopped."""

    def __init__(self) -> None:
        super().__init__(self._slice_views)
        self._layout_manager = slicer.app.layoutManager()
        if self._layout_manager is not None:
            # Another layout may have views that were not there when the tools were made.
            self._layout_manager.layoutChanged.connect(self.follow_views)

    def _slice_views(self) -> Iterator[tuple[Any, Any, Draw]]:
        # There is no view where Slicer runs without a window.
        for name in self._layout_manager.sliceViewNames() if self._layout_manager is not None else ():
            widget: Any = self._layout_manager.sliceWidget(name)
            yield widget.sliceView().interactor(), widget.mrmlSliceNode(), self._drawing(name)

    def _drawing(self, name: str) -> Draw:
        return lambda: self._draw(name)

    def _draw(self, name: str) -> None:
        # The view may be gone, with the layout that had it.
        widget = self._layout_manager.sliceWidget(name)
        if widget is not None:
            widget.sliceView().scheduleRender()
