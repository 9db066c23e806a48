"""How structures look in 3D, chosen in the panel."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

from PySide6.QtCore import Qt

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.rendering.appearance import STYLES
from ViTTransferFunction.Logic.rendering.composition import DEPTH, INTENSITY, NUMBER
from ViTTransferFunction.Logic.rendering.structure_volume import StructureVolume
from ViTTransferFunction.Testing.support.widgets import add_class

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]


@pytest.fixture
def unit() -> float:
    """Of the intensities."""
    return 1.0


@pytest.fixture
def shown(widget: Any, unit: float, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The panel with a structure that is in 3D: intensities 40 to 160, and 20 around it."""
    add_class(widget)
    session = widget.panel.session
    voxels = np.zeros((20, 20, 20, 4), np.uint8)
    voxels[..., INTENSITY] = 20
    voxels[5:15, 5:15, 5:15, INTENSITY] = np.linspace(40, 160, 10).astype(np.uint8)
    voxels[5:15, 5:15, 5:15, NUMBER], voxels[5:15, 5:15, 5:15, DEPTH] = 1, 255
    grid = Geometry((20, 20, 20), np.eye(4))
    rendering = StructureVolume(voxels, np.array([[50.0, 150.0]]), unit * np.arange(256.0), False, 1.0, grid)
    monkeypatch.setattr(session._proxy, "rendering", rendering)
    monkeypatch.setattr(session._proxy, "rendered", (session.classes[0].id,))
    widget.panel.refresh()
    return widget


def image(ui: Any) -> bytes:
    """The histogram that is shown."""
    picture = ui.lookHistogramLabel.pixmap().toImage()
    assert not picture.isNull()
    return bytes(picture.constBits())


def test_the_style_is_the_selected_structures_and_undone(widget: Any) -> None:
    ui, session = widget.ui, widget.panel.session
    assert not ui.styleComboBox.isEnabled()
    add_class(widget)
    add_class(widget)
    first, second = session.classes
    session.select_class(first.id)
    assert ui.styleComboBox.count() == len(STYLES)
    ui.styleComboBox.setCurrentText("Glass")
    assert [state.look.style for state in session.classes] == ["glass", "surface"]
    session.select_class(second.id)
    assert ui.styleComboBox.currentText() == "Surface"
    session.select_class(first.id)
    assert ui.styleComboBox.currentText() == "Glass"
    session.annotations.undo()
    assert session.classes[0].look.style == "surface"


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
    assert [(state.look.low, state.look.high) for state in session.classes] == [(60.0, 200.0)]
    assert not ui.lookAutomaticCheckBox.isChecked()
    ui.lookToneSlider.value = 0.4
    assert session.classes[0].look.tone == 0.4
    ui.lookAutomaticCheckBox.click()
    assert [(state.look.low, state.look.high) for state in session.classes] == [(None, None)]
    assert ui.lookLowSpinBox.value() == 0.0
    ui.lookAutomaticCheckBox.click()
    assert [(state.look.low, state.look.high) for state in session.classes] == [(0.0, 200.0)]


def test_the_histogram_has_handles_at_the_ends_of_the_window(shown: Any) -> None:
    ui, session = shown.ui, shown.panel.session
    assert ui.lookHistogramLabel.pixmap().isNull()
    ui.appearanceCollapsibleButton.click()
    drawn = image(ui)
    slider = ui.lookWindowSlider
    assert slider.minimum < 50.0 < 150.0 < slider.maximum < 200.0
    assert (slider.minimumValue, slider.maximumValue) == (50.0, 150.0)
    slider.minimumValue = 80.0
    assert [(state.look.low, state.look.high) for state in session.classes] == [(80.0, 150.0)]
    assert ui.lookLowSpinBox.value() == 80.0
    assert image(ui) != drawn
    slider.maximumValue = 120.0
    assert [(state.look.low, state.look.high) for state in session.classes] == [(80.0, 120.0)]
    add_class(shown)
    assert ui.lookHistogramLabel.pixmap().isNull(), "not the histogram of another structure"
    session.select_class(session.classes[0].id)
    assert image(ui)


@pytest.mark.parametrize("unit", [1e-5])
def test_intensities_of_a_map_of_small_numbers_are_not_rounded_to_nothing(shown: Any) -> None:
    ui = shown.ui
    ui.appearanceCollapsibleButton.click()
    assert (ui.lookLowSpinBox.value(), ui.lookHighSpinBox.value()) == pytest.approx((50e-5, 150e-5), abs=1e-6)
    ui.lookLowSpinBox.setValue(60e-5)
    look = shown.panel.session.classes[0].look
    assert (look.low, look.high) == pytest.approx((60e-5, 150e-5), abs=1e-6)


def test_the_handles_lie_below_the_histogram_also_in_languages_that_run_from_the_right(shown: Any) -> None:
    """Qt turns a slider round there, and no picture."""
    shown.ui.appearanceCollapsibleButton.setLayoutDirection(Qt.LayoutDirection.RightToLeft)
    assert shown.ui.styleComboBox.layoutDirection() == Qt.LayoutDirection.RightToLeft
    assert shown.ui.lookWindowSlider.layoutDirection() == Qt.LayoutDirection.LeftToRight


def test_a_window_beyond_the_histogram_stays_when_the_other_end_is_moved(shown: Any) -> None:
    ui, session = shown.ui, shown.panel.session
    ui.appearanceCollapsibleButton.click()
    ui.lookHighSpinBox.setValue(250.0)
    assert ui.lookWindowSlider.maximumValue == ui.lookWindowSlider.maximum < 250.0
    ui.lookWindowSlider.minimumValue = 70.0
    assert [(state.look.low, state.look.high) for state in session.classes] == [(70.0, 250.0)]


def test_fading_and_edges_are_the_styles_until_they_are_set(shown: Any) -> None:
    ui, session = shown.ui, shown.panel.session
    assert not ui.lookEdgesSlider.isEnabled()
    ui.styleComboBox.setCurrentText("As scanned")
    assert ui.lookEdgesSlider.isEnabled()
    assert ui.lookFadeSlider.value == pytest.approx(1.0 - STYLES["as scanned"].low)
    ui.lookFadeSlider.value = 0.25
    ui.lookEdgesSlider.value = 0.5
    look = session.classes[0].look
    assert (look.ramp, look.edges) == (0.75, 0.5)
    ui.styleComboBox.setCurrentText("Vessels")
    assert session.classes[0].look.ramp is None
    assert (ui.lookFadeSlider.value, ui.lookEdgesSlider.value) == (1.0, 0.0)


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
