"""Smaller and larger in the panel: buttons, keys, words, and the wheel over the structure in any slice view."""

from __future__ import annotations

import sys
from typing import Any

import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import slicer
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras
from ViTTransferFunction.Testing.support.standin.host import Host
from ViTTransferFunction.Testing.support.widgets import add_class, in_front, place, wait_until

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]


def size(widget: Any) -> float:
    return float(widget.panel.session.selected_class.size)


def test_the_buttons_step_and_the_words_beside_them_say_how_far(widget: Any) -> None:
    ui = widget.ui
    add_class(widget)
    assert ui.sizeLabel.text() == "as chosen"
    assert not ui.sizeAsChosenButton.isEnabled()
    ui.largerButton.click()
    assert (size(widget), ui.sizeLabel.text()) == (1.0, "one step larger")
    ui.largerButton.click()
    assert (size(widget), ui.sizeLabel.text()) == (1.5, "larger (+1.5)")
    for _ in range(3):
        ui.smallerButton.click()
    assert (size(widget), ui.sizeLabel.text()) == (-1.0, "one step smaller")
    ui.undoButton.click()
    assert size(widget) == 0.0
    ui.redoButton.click()
    ui.sizeAsChosenButton.click()
    assert (size(widget), ui.sizeLabel.text()) == (0.0, "as chosen")


def test_the_steps_end(widget: Any) -> None:
    assert not widget.ui.largerButton.isEnabled()
    add_class(widget)
    for _ in range(5):
        assert widget.ui.largerButton.isEnabled()
        widget.ui.largerButton.click()
    assert not widget.ui.largerButton.isEnabled()
    assert widget.ui.smallerButton.isEnabled()


def test_after_the_threshold_was_moved_steps_move_it_on_and_one_button_leads_back(widget: Any) -> None:
    ui = widget.ui
    add_class(widget)
    ui.largerButton.click()
    ui.thresholdSlider.value = 0.4
    assert ui.sizeLabel.text() == "set by hand"
    ui.largerButton.click()
    state = widget.panel.session.selected_class
    assert (state.iso, state.size) == (pytest.approx(0.2), 0.0)
    assert ui.thresholdSlider.value == pytest.approx(0.2)
    ui.sizeAsChosenButton.click()
    assert ui.sizeLabel.text() == "as chosen"
    assert ui.thresholdAutomaticCheckBox.isChecked()


def test_the_keys_step_in_every_window_with_views_while_the_module_is_open(widget: Any, host: Host) -> None:
    add_class(widget)
    monitor = slicer.app.layoutManager().add_detached_view("Compare", host.window)
    for window, key, expected in (
        (host.window, Qt.Key.Key_BracketRight, 1.0),
        (monitor, Qt.Key.Key_BracketRight, 1.5),
        (monitor, Qt.Key.Key_BracketLeft, 1.0),
        (host.window, Qt.Key.Key_BracketLeft, 0.0),
    ):
        in_front(window)
        QTest.keyClick(window, key)
        assert size(widget) == expected
    host.representation.exit()
    in_front(host.window)
    QTest.keyClick(host.window, Qt.Key.Key_BracketRight)
    assert size(widget) == 0.0


def test_keys_and_buttons_without_a_structure_do_nothing(widget: Any) -> None:
    widget.panel.size.make_larger()
    widget.panel.size.make_smaller()
    widget.panel.size.reset()
    assert widget.panel.session.classes == ()


def test_the_list_of_keys_tells_of_the_wheel_and_of_what_it_does_elsewhere(widget: Any) -> None:
    told = widget.ui.shortcutsLabel.text()
    assert "<b>Ctrl+wheel</b>" in told
    assert "elsewhere it zooms" in told


def test_on_a_mac_the_list_of_keys_calls_ctrl_as_qt_has_it_there(monkeypatch: pytest.MonkeyPatch) -> None:
    from ViTTransferFunction.Widget.shortcuts import shortcuts_table

    monkeypatch.setattr(sys, "platform", "darwin")
    assert "<b>Cmd+wheel</b>" in shortcuts_table()
    assert "Ctrl" not in shortcuts_table()


@pytest.fixture
def clicked(ready: Any, spheres: Spheres) -> Any:
    """The module's widget with a click on a sphere, and a map of it."""
    add_class(ready, "sphere")
    place(ready, tuple(centre_ras(spheres, 1)[0]))
    wait_until(lambda: not ready.panel.session.busy)
    return ready


def turn(view: str, ras: Any) -> bool:
    """Turn the wheel away with Ctrl held over a point of the patient; returns whether Slicer's view got to know of it."""
    slice_widget = slicer.app.layoutManager().sliceWidget(view)
    node, interactor = slice_widget.mrmlSliceNode(), slice_widget.sliceView().interactor()
    node.JumpSliceByCentering(*ras)
    reached: list[str] = []
    tag = interactor.AddObserver("MouseWheelForwardEvent", lambda caller, name: reached.append(name), 0.0)
    interactor.SetEventInformation(100, 100, 1, 0)
    interactor.InvokeEvent("MouseWheelForwardEvent")
    interactor.RemoveObserver(tag)
    return bool(reached)


def test_the_wheel_works_over_the_structure_in_any_view_and_is_slicers_elsewhere(
    clicked: Any, host: Host, spheres: Spheres
) -> None:
    on_sphere, beside = centre_ras(spheres, 1)[0], centre_ras(spheres, 3)[0]
    assert not turn("Red", on_sphere)
    assert size(clicked) == pytest.approx(0.1)
    assert clicked.ui.sizeLabel.text() == "larger (+0.1)"
    slicer.app.layoutManager().add_detached_view("Compare", host.window)
    assert not turn("Compare", on_sphere)
    assert size(clicked) == pytest.approx(0.2)
    assert turn("Red", beside)
    clicked.ui.classTable.item(0, 2).setCheckState(Qt.CheckState.Unchecked)
    assert turn("Green", on_sphere)
    clicked.ui.classTable.item(0, 2).setCheckState(Qt.CheckState.Checked)
    assert not turn("Green", on_sphere)
    host.representation.exit()
    assert turn("Red", on_sphere)
    assert size(clicked) == pytest.approx(0.3)
    host.representation.enter()
    assert not turn("Red", on_sphere)


def test_the_threshold_that_results_is_shown_at_once(clicked: Any) -> None:
    before = clicked.ui.thresholdSlider.value
    clicked.ui.largerButton.click()
    after = clicked.ui.thresholdSlider.value
    assert after < 0.5 * before
    assert clicked.ui.thresholdAutomaticCheckBox.isChecked()
    clicked.ui.undoButton.click()
    wait_until(lambda: not clicked.panel.session.busy)
    assert clicked.ui.thresholdSlider.value == pytest.approx(before, abs=1e-3)


def test_without_automatic_the_threshold_stays_as_it_was_chosen(clicked: Any) -> None:
    ui, session = clicked.ui, clicked.panel.session
    chosen = session.chosen_iso(session.selected_class.id)
    ui.thresholdAutomaticCheckBox.click()
    assert session.selected_class.iso == pytest.approx(chosen, abs=1e-3)
    assert ui.sizeLabel.text() == "set by hand"
    ui.thresholdAutomaticCheckBox.click()
    assert session.selected_class.iso is None
    assert ui.thresholdSlider.value == pytest.approx(chosen, abs=1e-3)


def test_a_saved_scene_brings_the_size_back(widget: Any, tmp_path: Any) -> None:
    add_class(widget, "liver")
    widget.ui.smallerButton.click()
    path = str(tmp_path / "scene.mrml")
    slicer.mrmlScene.SetURL(path)
    slicer.mrmlScene.Commit(path)
    slicer.mrmlScene.Clear()
    slicer.mrmlScene.Import()
    assert size(widget) == -1.0
    assert widget.ui.sizeLabel.text() == "one step smaller"
