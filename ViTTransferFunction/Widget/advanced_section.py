"""Settings that rarely need a change and are not bound by name: the user's own weights, the intensity window, the cache."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import qt
import slicer
from slicer.i18n import tr as _

from ViTTransferFunction.Logic.core.cache_folder import cache_folder
from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Logic.features.cache import FeatureCache
from ViTTransferFunction.Logic.scene.wording import size
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, preset
from ViTTransferFunction.Logic.weights.models import PretrainedModel, pretrained_model
from ViTTransferFunction.Logic.weights.store import file_in, remove_weights, weights_folder
from ViTTransferFunction.Widget.section import Report, Section, signals_blocked

TYPING_MS = 700
"""A path is taken when nobody has typed for so long."""


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
        """The window that was set; while it is automatic, the one in which the views show the volume."""
        ui = self.ui
        widgets = (ui.windowLowSpinBox, ui.windowHighSpinBox, ui.windowAutomaticCheckBox)
        for widget in widgets:
            widget.enabled = self.session is not None and self.session.parameters.volume is not None
        if self.session is None:
            return
        parameters = self.session.parameters
        automatic = parameters.get("windowAutomatic")
        low, high = parameters.get("windowLow"), parameters.get("windowHigh")
        if automatic:
            low, high = _displayed_window(parameters.volume)
        with signals_blocked(*widgets):
            ui.windowAutomaticCheckBox.checked = automatic
            ui.windowLowSpinBox.value, ui.windowHighSpinBox.value = low, high

    def _show_cache(self) -> None:
        cache, model = FeatureCache(), self._model()
        weights = file_in(weights_folder(), model)
        self.ui.cacheFolderLabel.text = _("{folder}\nFeatures: {features}. {model}: {weights}.").format(
            folder=cache_folder(),
            features=size(cache.size_bytes()),
            model=model.name,
            weights=size(weights.stat().st_size) if weights else _("not downloaded"),
        )
        self.ui.clearFeaturesButton.enabled = bool(cache.entries())
        self.ui.removeModelButton.enabled = weights is not None

    def _model(self) -> PretrainedModel:
        """The model of the settings, whose downloaded weights can be removed; the user's own file may be of another."""
        if self.session is None:
            return pretrained_model(preset(DEFAULT_PRESET).model)
        parameters = self.session.parameters
        return pretrained_model(parameters.get("model") or preset(parameters.get("preset")).model)

    def _take_weights(self) -> None:
        self._typing.stop()
        if self.session is not None:
            self.session.parameters.set("weightsPath", self.ui.weightsPathLineEdit.currentPath)

    def _on_weights_folder(self) -> None:
        if self.session is not None:
            path = self.session.parameters.get("weightsPath")
            folder = ask_folder(_("Folder with the model's weights"), path, self.ui.weightsFolderButton)
            if folder:
                self.session.parameters.set("weightsPath", folder)

    def _on_clear_weights(self) -> None:
        if self.session is not None:
            self.session.parameters.set("weightsPath", "")

    def _on_window_automatic(self) -> None:
        self._set_window(self.ui.windowAutomaticCheckBox.checked)

    def _on_window(self) -> None:
        self._set_window(automatic=False)

    def _set_window(self, automatic: bool) -> None:
        """Write the three parameters at once, so that nobody sees a window that is half the old one."""
        if self.session is None:
            return
        parameters = self.session.parameters
        with slicer.util.NodeModify(parameters.node):
            parameters.set("windowLow", self.ui.windowLowSpinBox.value)
            parameters.set("windowHigh", self.ui.windowHighSpinBox.value)
            parameters.set("windowAutomatic", automatic)

    def _on_clear_features(self) -> None:
        question = _("Delete the features of all volumes from the cache ({size})? They can be computed again.")
        if slicer.util.confirmOkCancelDisplay(question.format(size=size(FeatureCache().size_bytes()))):
            self._attempt(FeatureCache().clear)

    def _on_remove_model(self) -> None:
        model = self._model()
        question = _("Delete the weights of {model} from the cache? They can be downloaded again ({size}).")
        if model.url is None:
            question = _("Delete the weights of {model} from the cache ({size})? This module cannot download them again.")
        if slicer.util.confirmOkCancelDisplay(question.format(model=model.name, size=size(model.size_mb * 1e6))):
            self._attempt(lambda: remove_weights(model.name))

    def _attempt(self, action: Callable[[], Any]) -> None:
        try:
            action()
        except InputError as error:
            self.report(str(error))
        except OSError as error:
            self.report(_("Cannot delete from the cache: {reason}. Close what uses it and try again.").format(reason=error))
        self.refresh()


def ask_folder(title: str, path: str, parent: Any) -> str:
    """Have the user choose a folder, beginning at `path`; "" where the user cancels."""
    return str(qt.QFileDialog.getExistingDirectory(parent, title, path))


def _displayed_window(volume: slicer.vtkMRMLScalarVolumeNode | None) -> tuple[float, float]:
    display = volume.GetScalarVolumeDisplayNode() if volume else None
    return (display.GetWindowLevelMin(), display.GetWindowLevelMax()) if display else (0.0, 0.0)
