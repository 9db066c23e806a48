"""The settings of the selected structure: opacity, threshold, proximity, refinement."""

from __future__ import annotations

from typing import Any

from ViTTransferFunction.Widget.section import Report, Section, signals_blocked


class ClassSettings(Section):
    """Sliders and boxes; disabled while no class is selected."""

    def __init__(self, ui: Any, report: Report) -> None:
        super().__init__(ui, report)
        # What is below it stays where it is when it has no number.
        ui.thresholdSlider.minimumHeight = ui.opacitySlider.sizeHint.height()
        ui.opacitySlider.valueChanged.connect(self._on_opacity)
        ui.thresholdSlider.valueChanged.connect(self._on_threshold)
        ui.thresholdAutomaticCheckBox.toggled.connect(self._on_threshold_automatic)
        ui.proximitySlider.valueChanged.connect(self._on_proximity)
        ui.refineCheckBox.toggled.connect(self._on_refine)

    def refresh(self) -> None:
        """Show the settings of the selected class."""
        ui, selected = self.ui, self.selected
        threshold = None if selected is None else self.threshold(selected)
        of_class = (ui.opacitySlider, ui.proximitySlider, ui.refineCheckBox)
        of_threshold = (ui.thresholdSlider, ui.thresholdAutomaticCheckBox)
        for widget in of_class:
            widget.enabled = selected is not None
        for widget in of_threshold:
            widget.enabled = threshold is not None
        # What it was before is another structure's.
        ui.thresholdSlider.spinBoxVisible = threshold is not None
        if selected is None:
            return
        with signals_blocked(*of_class, *of_threshold):
            ui.opacitySlider.value = selected.look.opacity
            if threshold is not None:
                ui.thresholdSlider.value = threshold
            ui.thresholdAutomaticCheckBox.checked = selected.iso is None
            ui.proximitySlider.value = selected.proximity
            ui.refineCheckBox.checked = selected.refine

    def _on_opacity(self) -> None:
        self.set_selected(opacity=self.ui.opacitySlider.value)

    def _on_threshold(self) -> None:
        self.set_selected(iso=self.ui.thresholdSlider.value)

    def _on_threshold_automatic(self) -> None:
        automatic = self.ui.thresholdAutomaticCheckBox.checked
        self.set_selected(iso=None if automatic else self.ui.thresholdSlider.value)

    def _on_proximity(self) -> None:
        self.set_selected(proximity=self.ui.proximitySlider.value)

    def _on_refine(self) -> None:
        self.set_selected(refine=self.ui.refineCheckBox.checked)
