"""How large the selected structure is meant to be: buttons, keys, and the wheel over it in the slice views."""

from __future__ import annotations

from typing import Any, Literal

from ViTTransferFunction.Logic.scene.classes.class_size import stepped
from ViTTransferFunction.Logic.scene.interface.number_texts import size_in_steps
from ViTTransferFunction.Logic.scene.size_by_wheel import size_wheels
from ViTTransferFunction.Widget.section import Report, Section
from ViTTransferFunction.Widget.slice_tools import LayoutSliceTools


class SizeControls(Section):
    """Steps to the smaller and the larger proposal and beyond, and back to what was chosen."""

    def __init__(self, ui: Any, report: Report) -> None:
        super().__init__(ui, report)
        self._wheel = LayoutSliceTools()
        ui.smallerButton.clicked.connect(self.make_smaller)
        ui.largerButton.clicked.connect(self.make_larger)
        ui.sizeAsChosenButton.clicked.connect(self.reset)

    def refresh(self) -> None:
        """Show how large the selected class is meant to be, and enable the steps that are left."""
        ui, selected = self.ui, self.selected
        ui.smallerButton.enabled = selected is not None and stepped(selected, -1) != selected
        ui.largerButton.enabled = selected is not None and stepped(selected, 1) != selected
        ui.sizeAsChosenButton.enabled = selected is not None and (selected.size != 0.0 or selected.iso is not None)
        ui.sizeLabel.text = "" if selected is None else size_in_steps(selected.size, fixed=selected.iso is not None)

    def make_smaller(self) -> None:
        """One step smaller."""
        self._step(-1)

    def make_larger(self) -> None:
        """One step larger."""
        self._step(1)

    def reset(self) -> None:
        """Back to what is chosen from the points."""
        self.set_selected(size=0.0, iso=None)

    def take_wheel(self) -> None:
        """Have Ctrl and the wheel change the size where they are over the structure, in all slice views."""
        self._wheel.start(size_wheels(lambda: self.session))

    def leave_wheel(self) -> None:
        """Leave the wheel to the views."""
        self._wheel.stop()

    def _step(self, direction: Literal[-1, 1]) -> None:
        self.with_selected(lambda session, id_: session.annotations.step_size(id_, direction))
