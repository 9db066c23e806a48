"""How structures and what is around them look in the 3D views."""

from __future__ import annotations

from typing import Any

from ViTTransferFunction.Logic.rendering.appearance import STYLES
from ViTTransferFunction.Logic.scene.wording import context_words, style_words
from ViTTransferFunction.Widget.section import Report, Section, signals_blocked


class AppearanceSection(Section):
    """The selected structure's style, what is shown around all of them, and the button that leaves it to the scene."""

    def __init__(self, ui: Any, report: Report) -> None:
        super().__init__(ui, report)
        self._contexts: list[str] = []
        for text in style_words().values():
            ui.styleComboBox.addItem(text)
        ui.styleComboBox.currentIndexChanged.connect(self._on_style)
        ui.lookLowSpinBox.valueChanged.connect(self._on_window)
        ui.lookHighSpinBox.valueChanged.connect(self._on_window)
        ui.lookAutomaticCheckBox.toggled.connect(self._on_window_automatic)
        ui.lookToneSlider.valueChanged.connect(self._on_tone)
        ui.contextComboBox.currentIndexChanged.connect(self._on_context)
        ui.exportRenderingButton.clicked.connect(self._on_export)

    def refresh(self) -> None:
        """Show the selected structure's style, and the surroundings."""
        ui, session, selected = self.ui, self.session, self.selected
        ui.styleComboBox.enabled = selected is not None
        ui.contextComboBox.enabled = ui.exportRenderingButton.enabled = session is not None
        self._show_window()
        with signals_blocked(ui.styleComboBox, ui.contextComboBox):
            ui.styleComboBox.currentIndex = list(STYLES).index(selected.style) if selected else 0
            if session is not None:
                self._list_contexts(session.context_names)
                context = session.parameters.get("context")
                ui.contextComboBox.currentIndex = self._contexts.index(context) if context in self._contexts else 0

    def _show_window(self) -> None:
        """Intensities are known as soon as the structure has been rendered."""
        ui, selected = self.ui, self.selected
        window = self.session.rendered_window(selected.id) if self.session and selected else None
        spin_boxes = (ui.lookLowSpinBox, ui.lookHighSpinBox)
        for widget in (*spin_boxes, ui.lookAutomaticCheckBox, ui.lookToneSlider):
            widget.enabled = selected is not None and window is not None
        if selected is None or window is None:
            return
        with signals_blocked(*spin_boxes, ui.lookAutomaticCheckBox, ui.lookToneSlider):
            for spin_box, value in zip(spin_boxes, window, strict=True):
                spin_box.value = value
            ui.lookAutomaticCheckBox.checked = selected.low is None and selected.high is None
            ui.lookToneSlider.value = STYLES[selected.style].tone if selected.tone is None else selected.tone

    def _list_contexts(self, names: list[str]) -> None:
        if names == self._contexts:
            return
        box, self._contexts = self.ui.contextComboBox, names
        words = context_words()
        box.clear()
        for name in names:
            box.addItem(words.get(name, name))

    def _on_style(self) -> None:
        # Another style brings its own tone.
        self._set(style=list(STYLES)[self.ui.styleComboBox.currentIndex], tone=None)

    def _on_window(self) -> None:
        self._set(low=self.ui.lookLowSpinBox.value, high=self.ui.lookHighSpinBox.value)

    def _on_window_automatic(self) -> None:
        if self.ui.lookAutomaticCheckBox.checked:
            self._set(low=None, high=None)
        else:
            self._on_window()

    def _on_tone(self) -> None:
        self._set(tone=self.ui.lookToneSlider.value)

    def _set(self, **fields: Any) -> None:
        if self.session is not None and self.selected is not None:
            self.session.annotations.set_class(self.selected.id, **fields)

    def _on_context(self) -> None:
        if self.session is not None:
            self.session.parameters.set("context", self._contexts[self.ui.contextComboBox.currentIndex])

    def _on_export(self) -> None:
        if self.session is not None:
            self.session.export_rendering()
