"""How structures look in 3D, chosen in the panel."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

from ViTTransferFunction.Logic.core.geometry import Geometry
from ViTTransferFunction.Logic.rendering.appearance import STYLES
from ViTTransferFunction.Logic.rendering.structure_volume import StructureVolume
from ViTTransferFunction.Testing.support.widgets import add_class

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]


def test_the_style_is_the_selected_structures_and_undone(widget: Any) -> None:
    ui, session = widget.ui, widget.panel.session
    assert not ui.styleComboBox.isEnabled()
    add_class(widget)
    add_class(widget)
    first, second = session.classes
    session.select_class(first.id)
    assert ui.styleComboBox.count() == len(STYLES)
    ui.styleComboBox.setCurrentText("Glass")
    assert [state.style for state in session.classes] == ["glass", "surface"]
    session.select_class(second.id)
    assert ui.styleComboBox.currentText() == "Surface"
    session.select_class(first.id)
    assert ui.styleComboBox.currentText() == "Glass"
    session.annotations.undo()
    assert session.classes[0].style == "surface"


def test_intensities_are_the_structures_own_until_they_are_set(widget: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    ui, session = widget.ui, widget.panel.session
    add_class(widget)
    assert not ui.lookLowSpinBox.isEnabled()
    (state,) = session.classes
    levels, own = np.linspace(-100.0, 410.0, 256), np.array([[50.0, 150.0]])
    rendering = StructureVolume(np.zeros((2, 2, 2, 4), np.uint8), own, levels, True, 1.0, Geometry((2, 2, 2), np.eye(4)))
    monkeypatch.setattr(session._proxy, "rendering", rendering)
    monkeypatch.setattr(session._proxy, "rendered", (state.id,))
    widget.panel.refresh()
    assert (ui.lookLowSpinBox.value(), ui.lookHighSpinBox.value()) == (0.0, 200.0)
    assert ui.lookAutomaticCheckBox.isChecked()
    ui.lookLowSpinBox.setValue(60.0)
    assert [(state.low, state.high) for state in session.classes] == [(60.0, 200.0)]
    assert not ui.lookAutomaticCheckBox.isChecked()
    ui.lookToneSlider.value = 0.4
    assert session.classes[0].tone == 0.4
    ui.lookAutomaticCheckBox.click()
    assert [(state.low, state.high) for state in session.classes] == [(None, None)]
    assert ui.lookLowSpinBox.value() == 0.0


def test_surroundings_are_ours_or_slicers_presets_and_kept_in_the_scene(widget: Any) -> None:
    ui, parameters = widget.ui, widget.panel.session.parameters
    offered = [ui.contextComboBox.itemText(index) for index in range(ui.contextComboBox.count())]
    assert offered[:3] == ["Off", "Bones and vessels", "Skin"]
    assert {"CT-AAA", "CT-Bones", "MR-Default"} <= set(offered)
    ui.contextComboBox.setCurrentText("CT-AAA")
    ui.contextStrengthSlider.value = 0.25
    ui.contextCutAwayCheckBox.click()
    ui.renderingSoloCheckBox.click()
    written = [parameters.get(name) for name in ("context", "contextStrength", "contextCutAway", "renderingSolo")]
    assert written == ["CT-AAA", 0.25, True, True]
    parameters.set("context", "skin")
    assert ui.contextComboBox.currentText() == "Skin"


def test_an_export_of_nothing_is_refused_in_words(widget: Any) -> None:
    widget.ui.exportRenderingButton.click()
    assert "no 3D rendering" in widget.ui.messageLabel.text()
