"""The buttons of the tools that add and remove points, and undo, redo, and remove the last one."""

from __future__ import annotations

from typing import Any

import qt
import slicer

from ViTTransferFunction.Logic.core.volumes.measures import decimals_of
from ViTTransferFunction.Logic.scene.annotation_tool import AnnotationTool, Tool
from ViTTransferFunction.Logic.scene.interface.message_texts import not_in_slices_text
from ViTTransferFunction.Logic.scene.tools.brush_size import STEP_MM, brush_scale, brush_size
from ViTTransferFunction.Logic.scene.views.volume_in_slices import is_in_slices
from ViTTransferFunction.Widget.section import Report, Section, signals_blocked
from ViTTransferFunction.Widget.slice_tools import LayoutSliceTools
from ViTTransferFunction.Widget.views import tell_of_resting_mouse

IN_HAND = "QToolButton:checked { border: 2px solid palette(highlight); border-radius: 3px; }"
"""Style of the buttons: in Slicer's dark colours, a button that is down looks all but like the others."""


class AnnotationTools(Section):
    """At most one tool is in the user's hand; it works on the selected class, whichever that becomes."""

    def __init__(self, ui: Any, report: Report) -> None:
        super().__init__(ui, report)
        self._buttons: dict[Tool, Any] = {
            "pointOn": ui.pointOnButton,
            "pointOff": ui.pointOffButton,
            "brushOn": ui.brushOnButton,
            "brushOff": ui.brushOffButton,
            "lassoOn": ui.lassoOnButton,
            "lassoOff": ui.lassoOffButton,
            "boxOn": ui.boxOnButton,
            "boxOff": ui.boxOffButton,
            "outline": ui.outlineButton,
            "diameter": ui.diameterButton,
            "eraser": ui.eraserButton,
        }
        brush = ui.brushSizeSlider
        self._brush_ends, self._brush_scale = (brush.minimum, brush.maximum), 1.0
        app_logic = slicer.app.applicationLogic()
        self._in_hand = AnnotationTool(app_logic, LayoutSliceTools(), lambda: brush.value, report, self._on_tool)
        self._told_of_other_scans = False
        self._watches_colours = False
        for tool, button in self._buttons.items():
            self._connect(tool, button)
        brush.valueChanged.connect(self._in_hand.follow_brush_size)
        ui.undoButton.clicked.connect(self.undo)
        ui.redoButton.clicked.connect(self.redo)
        ui.removeLastButton.clicked.connect(self.remove_last)

    @property
    def tool(self) -> Tool | None:
        """The one in hand, or None."""
        return self._in_hand.tool

    def refresh(self) -> None:
        """Enable what can work now, and have the tool in hand work on the selected class."""
        selected, annotations = self.selected, self.session.annotations if self.session else None
        self._in_hand.session = self.session
        self._fit_brush()
        self._in_hand.follow_selection()
        for button in self._buttons.values():
            button.enabled = selected is not None
        self.ui.undoButton.enabled = annotations is not None and annotations.can_undo
        self.ui.redoButton.enabled = annotations is not None and annotations.can_redo
        self.ui.removeLastButton.enabled = selected is not None and bool(selected.positive or selected.negative)
        self.tell_of_other_scans()

    def toggle(self, tool: Tool) -> None:
        """Take a tool, or put it down if it is the one in hand."""
        self._in_hand.session = self.session
        self._in_hand.toggle(tool)
        self.tell_of_other_scans()

    def watch_colours(self) -> None:
        """Keep the name of the tool in hand readable from now on, also when Slicer's style changes."""
        if not self._watches_colours:
            self._watches_colours = True
            slicer.app.paletteChanged.connect(self._on_palette)

    def leave_colours(self) -> None:
        """Watch them no longer: the application outlives the panel."""
        if self._watches_colours:
            self._watches_colours = False
            slicer.app.paletteChanged.disconnect(self._on_palette)

    def put_down(self) -> None:
        """Give the mouse back to the views."""
        self._in_hand.put_down()

    def end_unfinished(self) -> None:
        """Have clicks in the views do nothing to a structure that no button shows, whatever was begun elsewhere."""
        self._in_hand.end_unfinished()

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
        self.with_selected(lambda session, id_: session.annotations.remove_last_point(id_))

    def tell_of_other_scans(self) -> None:
        """Once for each time that a tool is in hand and the views show other scans than the one that it works on."""
        volume = self._volume_out_of_view()
        told, self._told_of_other_scans = self._told_of_other_scans, volume is not None
        if volume is not None and not told:
            self.report(not_in_slices_text(volume.GetName()), solved=lambda: self._volume_out_of_view() is not volume)

    def _volume_out_of_view(self) -> slicer.vtkMRMLScalarVolumeNode | None:
        """The volume that the tool in hand works on, where no slice view shows it."""
        volume = self.session.parameters.volume if self.session and self.tool else None
        in_view = volume is None or is_in_slices(slicer.mrmlScene, slicer.app.applicationLogic(), volume)
        return None if in_view else volume

    def _connect(self, tool: Tool, button: Any) -> None:
        button.clicked.connect(lambda: self.toggle(tool))

    def _on_tool(self) -> None:
        self._check_buttons()
        if self.tool in ("pointOn", "pointOff"):
            # Not in the midst of what is being changed.
            qt.QTimer.singleShot(0, tell_of_resting_mouse)

    def _check_buttons(self) -> None:
        for tool, button in self._buttons.items():
            button.checked = tool == self.tool
            # The others have none: when Slicer goes from its light style to its dark one, text under a style sheet stays black.
            style = IN_HAND if tool == self.tool else ""
            if button.styleSheet != style:
                button.styleSheet = style

    def _fit_brush(self) -> None:
        """Offer brushes that suit the volume's size, and keep the one that is chosen in proportion."""
        scale = brush_scale(self.session.body_scale) if self.session else self._brush_scale
        if scale == self._brush_scale:
            return
        brush, (smallest, largest) = self.ui.brushSizeSlider, self._brush_ends
        size_mm = brush_size(brush.value / self._brush_scale, scale)
        self._brush_scale = scale
        with signals_blocked(brush):
            step = brush_size(STEP_MM, scale)
            # The largest first, since it takes the smallest along; the step afterwards, since CTK refuses one beyond the ends.
            brush.decimals = decimals_of(step, 1, least_decimals=1)
            brush.maximum, brush.minimum = brush_size(largest, scale), brush_size(smallest, scale)
            brush.singleStep, brush.pageStep = step, 10.0 * step
            brush.value = size_mm
        self._in_hand.follow_brush_size()

    def _on_palette(self, *_: Any) -> None:
        # Its buttons have not got the colours yet.
        qt.QTimer.singleShot(0, self._take_up_colours)

    def _take_up_colours(self) -> None:
        """Slicer's style is another one, whose colours the button with a style sheet takes up with that set anew."""
        if self.tool is not None:
            self._buttons[self.tool].styleSheet = ""
            self._check_buttons()
