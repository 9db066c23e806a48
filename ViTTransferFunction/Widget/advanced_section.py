"""Settings that rarely need a change and are not bound by name: the user's own weights, the intensity window, the cache."""

from __future__ import annotations

from typing import Any

import qt
import slicer
from slicer.i18n import tr as _

from ViTTransferFunction.Logic.core.volumes.intensity_window import telling_decimals
from ViTTransferFunction.Logic.scene.interface.cache_contents import CacheContents
from ViTTransferFunction.Logic.scene.interface.parameters import SceneParameters
from ViTTransferFunction.Widget.remembered_weights import remember_weights
from ViTTransferFunction.Widget.section import Report, Section, signals_blocked

TYPING_MS = 700
"""A path is taken when nobody has typed for so long."""
LARGEST_INTENSITY = 1e9
"""Becquerels per millilitre, in PET, go beyond a million."""


class AdvancedSection(Section):
    """The advanced settings; sizes on disk are looked up only while they are in sight."""

    def __init__(self, ui: Any, report: Report) -> None:
        super().__init__(ui, report)
        self._typing = qt.QTimer()
        self._typing.interval = TYPING_MS
        self._typing.timeout.connect(self._take_weights)
        # At every letter, and whether the path is there or not.
        ui.weightsPathLineEdit.currentPathChanged.connect(lambda *_: self._typing.start())
        # A ctkPathLineEdit whose button opens files does not open folders.
        ui.weightsFolderButton.clicked.connect(self._on_weights_folder)
        ui.clearWeightsButton.clicked.connect(self._on_clear_weights)
        ui.windowAutomaticCheckBox.toggled.connect(self._on_window_automatic)
        for spin_box in (ui.windowLowSpinBox, ui.windowHighSpinBox):
            spin_box.valueChanged.connect(self._on_window)
            # With more decimals or digits it would ask for more room than numbers take, and the panel would be wider.
            spin_box.minimumWidth = spin_box.minimumSizeHint.width()
            spin_box.minimum, spin_box.maximum = -LARGEST_INTENSITY, LARGEST_INTENSITY
        ui.clearFeaturesButton.clicked.connect(self._on_clear_features)
        ui.removeModelButton.clicked.connect(self._on_remove_model)
        ui.advancedCollapsibleButton.contentsCollapsed.connect(self.refresh)

    def refresh(self) -> None:
        """Show the settings."""
        if self.ui.advancedCollapsibleButton.collapsed:
            return
        self._show_weights()
        self._show_window()
        self._show_cache()

    def _show_weights(self) -> None:
        path = self.session.parameters.get("weightsPath") if self.session else ""
        if self._typing.active:
            return
        if self.ui.weightsPathLineEdit.currentPath != path:
            with signals_blocked(self.ui.weightsPathLineEdit):
                self.ui.weightsPathLineEdit.currentPath = path
        self.ui.weightsFolderButton.enabled = self.session is not None
        self.ui.clearWeightsButton.enabled = bool(path)

    def _show_window(self) -> None:
        """The window that was set; while it is automatic, no numbers: what is chosen is not the window of the views."""
        ui = self.ui
        widgets = (ui.windowLowSpinBox, ui.windowHighSpinBox, ui.windowAutomaticCheckBox)
        for widget in widgets:
            widget.enabled = self.session is not None and self.session.parameters.volume is not None
        if self.session is None:
            return
        parameters = self.session.parameters
        with signals_blocked(*widgets):
            ui.windowAutomaticCheckBox.checked = ui.windowChosenLabel.visible = automatic = parameters.get("windowAutomatic")
            ui.windowLowSpinBox.visible = ui.windowHighSpinBox.visible = not automatic
            # Also while they are hidden: it is what one begins with.
            low, high = parameters.window
            if low != high:
                # Of maps with intensities below 1, one decimal would leave nothing.
                decimals = max(telling_decimals(abs(high - low)), 1)
                for spin_box in (ui.windowLowSpinBox, ui.windowHighSpinBox):
                    spin_box.decimals, spin_box.singleStep = decimals, 10.0 ** (2 - decimals)
            ui.windowLowSpinBox.value, ui.windowHighSpinBox.value = low, high

    def _show_cache(self) -> None:
        cache = self._cache
        self.ui.cacheFolderLabel.text = cache.text
        self.ui.clearFeaturesButton.enabled = cache.has_features
        self.ui.removeModelButton.enabled = cache.has_model

    @property
    def _cache(self) -> CacheContents:
        return CacheContents(self.session.parameters if self.session else None)

    def _take_weights(self) -> None:
        self._typing.stop()
        if self.session is not None:
            self._name_weights(self.session.parameters, self.ui.weightsPathLineEdit.currentPath)

    def _on_weights_folder(self) -> None:
        if self.session is not None:
            path = self.session.parameters.get("weightsPath")
            folder = ask_folder(_("Folder with the model's weights"), path, self.ui.weightsFolderButton)
            if folder:
                self._name_weights(self.session.parameters, folder)

    def _on_clear_weights(self) -> None:
        self._typing.stop()
        if self.session is not None:
            self._name_weights(self.session.parameters, "")

    def _name_weights(self, parameters: SceneParameters, path: str) -> None:
        parameters.set("weightsPath", path)
        remember_weights(path)

    def _on_window_automatic(self) -> None:
        self._set_window(self.ui.windowAutomaticCheckBox.checked)

    def _on_window(self) -> None:
        self._set_window(automatic=False)

    def _set_window(self, automatic: bool) -> None:
        if self.session is not None:
            self.session.parameters.set_window(self.ui.windowLowSpinBox.value, self.ui.windowHighSpinBox.value, automatic)

    def _on_clear_features(self) -> None:
        cache = self._cache
        if slicer.util.confirmOkCancelDisplay(cache.features_question):
            self.attempt(cache.clear_features)

    def _on_remove_model(self) -> None:
        session = self.session
        if slicer.util.confirmOkCancelDisplay(self._cache.model_question) and session is not None and session is self.session:
            self.attempt(session.remove_model)


def ask_folder(title: str, path: str, parent: Any) -> str:
    """Have the user choose a folder, beginning at `path`; "" where the user cancels."""
    return str(qt.QFileDialog.getExistingDirectory(parent, title, path))
