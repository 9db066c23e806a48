"""How structures and what is around them look in the 3D views."""

from __future__ import annotations

from typing import Any

import qt

from ViTTransferFunction.Logic.rendering.appearance import STYLES, effective
from ViTTransferFunction.Logic.scene.interface.choice_words import context_words, style_words
from ViTTransferFunction.Widget.section import Report, Section, signals_blocked


class AppearanceSection(Section):
    """The selected structure's transfer function, what is shown around all, and the button that leaves it to the scene."""

    def __init__(self, ui: Any, report: Report) -> None:
        super().__init__(ui, report)
        self._contexts: list[str] = []
        self._drawn: str | None = None
        for text in style_words().values():
            ui.styleComboBox.addItem(text)
        ui.styleComboBox.currentIndexChanged.connect(self._on_style)
        ui.lookLowSpinBox.valueChanged.connect(self._on_window)
        ui.lookHighSpinBox.valueChanged.connect(self._on_window)
        ui.lookAutomaticCheckBox.toggled.connect(self._on_window_automatic)
        ui.lookWindowSlider.minimumValueChanged.connect(self._on_low_handle)
        ui.lookWindowSlider.maximumValueChanged.connect(self._on_high_handle)
        ui.lookToneSlider.valueChanged.connect(self._on_tone)
        ui.lookFadeSlider.valueChanged.connect(self._on_fade)
        ui.lookEdgesSlider.valueChanged.connect(self._on_edges)
        ui.appearanceCollapsibleButton.contentsCollapsed.connect(self.refresh)
        ui.contextComboBox.currentIndexChanged.connect(self._on_context)
        ui.exportRenderingButton.clicked.connect(self._on_export)

    def refresh(self) -> None:
        """Show how the selected structure looks, and the surroundings."""
        ui, session, selected = self.ui, self.session, self.selected
        ui.styleComboBox.enabled = selected is not None
        ui.contextComboBox.enabled = ui.exportRenderingButton.enabled = session is not None
        self._show_look()
        with signals_blocked(ui.styleComboBox, ui.contextComboBox):
            ui.styleComboBox.currentIndex = list(STYLES).index(selected.look.style) if selected else 0
            if session is not None:
                self._list_contexts(session.views.context_names)
                context = session.parameters.get("context")
                ui.contextComboBox.currentIndex = self._contexts.index(context) if context in self._contexts else 0

    def _show_look(self) -> None:
        """Intensities are known as soon as the structure has been rendered."""
        ui, session, selected = self.ui, self.session, self.selected
        window = session.views.window(selected) if session and selected else None
        numbers = (ui.lookLowSpinBox, ui.lookHighSpinBox)
        shares = (ui.lookToneSlider, ui.lookFadeSlider, ui.lookEdgesSlider)
        for widget in (*numbers, ui.lookWindowSlider, ui.lookAutomaticCheckBox, *shares):
            widget.enabled = window is not None
        if session is None or selected is None or window is None:
            ui.lookHistogramLabel.clear()
            self._drawn = None
            return
        style = effective(session.views.look(selected))
        ui.lookEdgesSlider.enabled = style.density > 0.0
        self._show_histogram(window)
        with signals_blocked(*numbers, ui.lookAutomaticCheckBox, *shares):
            for spin_box, value in zip(numbers, window, strict=True):
                spin_box.value = value
            ui.lookAutomaticCheckBox.checked = selected.look.low is None and selected.look.high is None
            for slider, value in zip(shares, (style.tone, 1.0 - style.low, style.edges), strict=True):
                slider.value = value

    def _show_histogram(self, window: tuple[float, float]) -> None:
        """Draw the histogram, with a handle below each end of the window; once somebody sees it, since it takes its time."""
        ui, session, selected = self.ui, self.session, self.selected
        if session is None or selected is None or ui.appearanceCollapsibleButton.collapsed:
            return
        histogram = session.views.histogram(selected)
        if histogram is None:
            return
        first, last = histogram.ends
        with signals_blocked(ui.lookWindowSlider, ui.lookLowSpinBox, ui.lookHighSpinBox):
            if (ui.lookWindowSlider.minimum, ui.lookWindowSlider.maximum) != (first, last):
                ui.lookWindowSlider.setRange(first, last)
                ui.lookWindowSlider.singleStep = histogram.step
            ui.lookWindowSlider.setValues(*window)
            for spin_box in (ui.lookLowSpinBox, ui.lookHighSpinBox):
                spin_box.decimals = histogram.decimals
                spin_box.singleStep = max((last - first) / 100.0, 1e-9)
        picture = session.views.histogram_svg(selected)
        if picture is not None and picture != self._drawn:
            self._drawn = picture
            pixmap = qt.QPixmap()
            pixmap.loadFromData(picture.encode())
            ui.lookHistogramLabel.pixmap = pixmap

    def _list_contexts(self, names: list[str]) -> None:
        if names == self._contexts:
            return
        box, self._contexts = self.ui.contextComboBox, names
        words = context_words()
        box.clear()
        for name in names:
            box.addItem(words.get(name, name))

    def _on_style(self) -> None:
        self.set_selected(style=list(STYLES)[self.ui.styleComboBox.currentIndex])

    def _on_window(self) -> None:
        self.set_selected(low=self.ui.lookLowSpinBox.value, high=self.ui.lookHighSpinBox.value)

    def _on_low_handle(self, low: float) -> None:
        """The other end stays, also where it lies beyond what the handles reach."""
        self.set_selected(low=low, high=self.ui.lookHighSpinBox.value)

    def _on_high_handle(self, high: float) -> None:
        self.set_selected(low=self.ui.lookLowSpinBox.value, high=high)

    def _on_window_automatic(self) -> None:
        if self.ui.lookAutomaticCheckBox.checked:
            self.set_selected(low=None, high=None)
        else:
            self._on_window()

    def _on_tone(self) -> None:
        self.set_selected(tone=self.ui.lookToneSlider.value)

    def _on_fade(self) -> None:
        self.set_selected(ramp=1.0 - self.ui.lookFadeSlider.value)

    def _on_edges(self) -> None:
        self.set_selected(edges=self.ui.lookEdgesSlider.value)

    def _on_context(self) -> None:
        if self.session is not None:
            self.session.parameters.set("context", self._contexts[self.ui.contextComboBox.currentIndex])

    def _on_export(self) -> None:
        if self.session is not None:
            self.session.views.export_rendering()
