"""Gives the panel the height that it needs, also where Slicer does not ask for it."""

from __future__ import annotations

from typing import Any

import qt


class PanelHeight(qt.QObject):
    """Has a widget be as high as its layout needs to be for its width, for as long as this object is kept.

    Text that is broken into lines needs the more of them the narrower it is. Layouts ask for that, but Slicer's module panel
    goes on with what held when the module was entered, from the second time on (qSlicerModulePanel::removeModule leaves the
    item of the first time to the widget, which then tells no other). A message would squeeze all that is below it, and a
    section that was open then would leave a gap at the end when it is closed, to which the panel may be scrolled.

    Args:
        widget: all that is in the module's widget, which a layout of Slicer's has; it has a layout itself.
    """

    def __init__(self, widget: Any) -> None:
        qt.QObject.__init__(self)
        widget.installEventFilter(self)

    def eventFilter(self, widget: Any, event: Any) -> bool:  # noqa: N802
        """Called by Qt, when the layout has done its part: whether the widget is not to be told of something."""
        if event.type() in (qt.QEvent.LayoutRequest, qt.QEvent.Resize):
            # −1 where nothing is broken into lines.
            widget.minimumHeight = max(widget.heightForWidth(widget.width), 0)
        if event.type() == qt.QEvent.LayoutRequest:
            # Not at Resize, which may be told while Slicer's layout goes through its items.
            _forget_height(widget.parentWidget())
        return False


def _forget_height(module: Any) -> None:
    """Have Slicer's layout ask how high the module's widget wants to be, where it goes on with more than that."""
    panel = module.parentWidget()
    layout: Any = panel.layout() if panel is not None else None
    if layout is None:
        return
    index = layout.indexOf(module)
    if index >= 0 and layout.itemAt(index).heightForWidth(module.width) > module.heightForWidth(module.width):
        layout.removeWidget(module)
        layout.insertWidget(index, module, 1)
