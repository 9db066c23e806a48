"""A closer look in the panel: its buttons, its key, and the words beside them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import slicer
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QPalette
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QScrollArea

from ViTTransferFunction.Logic.core.classes import close_up_choice, vague_extent
from ViTTransferFunction.Logic.core.system.progress import WorkProgress
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.known_features import GRID
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras
from ViTTransferFunction.Testing.support.standin.host import PANEL_WIDTH, Host
from ViTTransferFunction.Testing.support.widgets import add_class, in_front, place, wait_until

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]

BOX = (1.0, -2.0, 3.0, 64.4, 79.6, 9.5)
WHOLE, CLOSER = "", "In a box of 64 × 80 × 9.5 mm"


@pytest.fixture
def clicked(ready: Any, spheres: Spheres) -> Any:
    """The module's widget with a click on a sphere, and a map of it."""
    add_class(ready, "sphere")
    place(ready, tuple(centre_ras(spheres, 1)[0]))
    wait_until(lambda: ready.panel.session.up_to_date and not ready.panel.session.busy)
    return ready


def close_up(widget: Any) -> Any:
    return widget.panel.session.selected_class.close_up


def enabled(widget: Any) -> tuple[bool, bool]:
    return widget.ui.lookCloserButton.isEnabled(), widget.ui.lookAtWholeButton.isEnabled()


def test_one_button_looks_closer_and_the_other_leads_back(clicked: Any, spheres: Spheres) -> None:
    ui = clicked.ui
    assert (enabled(clicked), ui.closeUpLabel.text()) == ((True, False), WHOLE)
    assert ui.closeUpLabel.isHidden()
    ui.lookCloserButton.click()
    assert close_up(clicked)[:3] == pytest.approx(centre_ras(spheres, 1)[0], abs=10.0)
    assert enabled(clicked) == (True, True)
    assert ui.closeUpLabel.text().startswith("In a box of ")
    assert not ui.closeUpLabel.isHidden()
    ui.lookAtWholeButton.click()
    assert (close_up(clicked), enabled(clicked), ui.closeUpLabel.text()) == (None, (True, False), WHOLE)
    assert not ui.messageFrame.isVisible()


def test_a_closer_look_is_one_step_for_undo_and_the_buttons_follow(clicked: Any) -> None:
    ui = clicked.ui
    ui.lookCloserButton.click()
    box, words = close_up(clicked), ui.closeUpLabel.text()
    ui.undoButton.click()
    assert (close_up(clicked), enabled(clicked), ui.closeUpLabel.text()) == (None, (True, False), WHOLE)
    ui.redoButton.click()
    assert (close_up(clicked), enabled(clicked), ui.closeUpLabel.text()) == (box, (True, True), words)


def test_the_words_say_how_large_the_box_is(widget: Any) -> None:
    state = add_class(widget)
    widget.panel.session.annotations.set_class(state.id, close_up=BOX)
    assert widget.ui.closeUpLabel.text() == CLOSER


def test_the_words_follow_a_point_beyond_the_box(clicked: Any, spheres: Spheres) -> None:
    clicked.ui.lookCloserButton.click()
    before = clicked.ui.closeUpLabel.text()
    place(clicked, tuple(centre_ras(spheres, 2)[0]))
    after = clicked.ui.closeUpLabel.text()
    assert after.startswith("In a box of ")
    assert after != before
    clicked.ui.undoButton.click()
    assert clicked.ui.closeUpLabel.text() == before


def test_a_closer_look_takes_a_point_inside_and_features(widget: Any, clicked: Any, spheres: Spheres) -> None:
    assert enabled(clicked) == (True, False)
    add_class(clicked, "without a point")
    assert enabled(clicked) == (False, False)
    widget.ui.pointOffButton.click()
    place(clicked, tuple(centre_ras(spheres, 2)[0]))
    assert enabled(clicked) == (False, False)
    widget.ui.classTable.setCurrentCell(0, 1)
    assert enabled(clicked) == (True, False)
    widget.ui.volumeSelector.setCurrentNode(None)
    assert enabled(clicked) == (False, False)


def test_without_features_only_the_way_back_is_open(widget: Any) -> None:
    assert (enabled(widget), widget.ui.closeUpLabel.text()) == ((False, False), "")
    state = add_class(widget)
    place(widget, (1.0, 2.0, 3.0))
    assert enabled(widget) == (False, False)
    widget.panel.session.annotations.set_class(state.id, close_up=BOX)
    assert enabled(widget) == (False, True)
    widget.ui.lookAtWholeButton.click()
    assert close_up(widget) is None


def test_the_key_looks_closer_and_says_why_where_it_cannot(clicked: Any, host: Host) -> None:
    in_front(host.window)
    QTest.keyClick(host.window, Qt.Key.Key_C)
    assert close_up(clicked) is not None
    add_class(clicked, "liver")
    QTest.keyClick(host.window, Qt.Key.Key_C)
    assert close_up(clicked) is None
    assert "Place a point on liver first" in clicked.ui.messageLabel.text()


def test_a_closer_look_is_suggested_below_its_button_while_the_structure_is_selected(
    clicked: Any, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(close_up_choice, "LARGEST_SHARE", 1.0)
    ui = clicked.ui
    assert suggestion(clicked) == ""
    monkeypatch.setattr(vague_extent, "MUCH_LARGER", 1.0)
    if not ui.pointOnButton.isChecked():
        ui.pointOnButton.click()
    place(clicked, tuple(centre_ras(spheres, 2)[0]))
    wait_until(lambda: clicked.panel.session.up_to_date and not clicked.panel.session.busy)
    assert '"Look closer" (C) may help' in suggestion(clicked)
    assert ui.lookCloserButton.font().bold()
    assert not ui.messageFrame.isVisible()
    ui.classTable.setCurrentCell(add_row(clicked), 1)
    assert (suggestion(clicked), ui.lookCloserButton.font().bold()) == ("", False)
    ui.classTable.setCurrentCell(0, 1)
    assert suggestion(clicked) != ""
    ui.lookCloserButton.click()
    assert (suggestion(clicked), ui.lookCloserButton.font().bold()) == ("", False)
    assert ui.closeUpLabel.text().startswith("In a box of ")


def test_a_diameter_that_is_short_for_the_cells_suggests_a_closer_look_until_it_is_undone(
    clicked: Any, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(close_up_choice, "LARGEST_SHARE", 1.0)
    session = clicked.panel.session
    half = np.array([0.0, 1.5 * spheres[0].geometry.extent_mm.max() / GRID, 0.0])
    session.regions.add_diameter(session.selected_class.id, centre_ras(spheres, 1) + np.stack([-half, half]))
    wait_until(lambda: session.up_to_date and not session.busy)
    assert "What you drew is smaller than four cells" in suggestion(clicked)
    assert clicked.ui.lookCloserButton.font().bold()
    clicked.ui.undoButton.click()
    assert (suggestion(clicked), clicked.ui.lookCloserButton.font().bold()) == ("", False)


def test_a_close_up_that_began_unasked_says_so_and_one_press_leads_back(
    clicked: Any, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(close_up_choice, "LARGEST_SHARE", 1.0)
    ui, session = clicked.ui, clicked.panel.session
    add_class(clicked, "half a sphere")
    angles = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    circle = 0.5 * spheres[0].geometry.extent_mm.max() / GRID * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    session.regions.add_outline(session.selected_class.id, centre_ras(spheres, 1) + circle)
    wait_until(lambda: close_up(clicked) is not None)
    assert suggestion(clicked).startswith("Small, and in the whole scan unlike your outline")
    assert not ui.lookCloserButton.font().bold()
    assert enabled(clicked) == (True, True)
    ui.lookAtWholeButton.click()
    assert (close_up(clicked), suggestion(clicked), ui.closeUpLabel.text()) == (None, "", WHOLE)


def test_the_suggested_button_follows_when_slicer_goes_from_its_light_style_to_its_dark_one(
    clicked: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Text under a style sheet would stay black."""
    monkeypatch.setattr(type(clicked.panel.session.close_up_hints), "of", lambda hints, state: "vague extent")
    clicked.panel.refresh()
    button, light, dark = clicked.ui.lookCloserButton, QApplication.palette(), QApplication.palette()
    assert button.font().bold()
    dark.setColor(QPalette.ColorRole.ButtonText, QColor("white"))
    QApplication.setPalette(dark)
    QApplication.processEvents()
    try:
        assert button.palette().buttonText().color().name() == "#ffffff"
        assert button.font().bold()
    finally:
        QApplication.setPalette(light)


def add_row(widget: Any) -> int:
    """Add a class; returns its row."""
    add_class(widget, "other")
    return len(widget.panel.session.classes) - 1


def suggestion(widget: Any) -> str:
    """The line that suggests a closer look; "" where it is not shown."""
    label = widget.ui.closeUpHintLabel
    assert label.isHidden() == (not label.text())
    return str(label.text())


def test_how_far_a_closer_look_is_shows_below_its_button_and_can_be_stopped_there(
    clicked: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    ui, stopped = clicked.ui, []
    assert ui.closeUpProgressRow.isHidden()
    monkeypatch.setattr(SceneSession, "looks_closer", True)
    monkeypatch.setattr(SceneSession, "progress", WorkProgress(1, 4, "Looking closer at sphere", None))
    monkeypatch.setattr(SceneSession, "cancel", lambda self: stopped.append(self))
    clicked.panel.refresh()
    assert not ui.closeUpProgressRow.isHidden()
    assert ui.closeUpProgressLabel.text() == "Looking closer at sphere…"
    assert (ui.closeUpProgressBar.value(), ui.closeUpProgressBar.maximum()) == (1, 4)
    assert (ui.segmentationProgressRow.isHidden(), ui.writeSegmentsButton.isHidden()) == (True, False)
    ui.closeUpCancelButton.click()
    assert stopped == [clicked.panel.session]
    monkeypatch.setattr(SceneSession, "looks_closer", False)
    clicked.panel.refresh()
    assert (ui.closeUpProgressRow.isHidden(), ui.segmentationProgressRow.isHidden()) == (True, False)


@pytest.mark.parametrize("told", ["closeUpHintLabel", "closeUpProgressRow"])
def test_on_a_small_screen_what_is_told_of_closer_looks_comes_into_sight_but_not_under_the_mouse(
    clicked: Any, host: Host, monkeypatch: pytest.MonkeyPatch, told: str
) -> None:
    session, label = clicked.panel.session, getattr(clicked.ui, told)
    host.window.resize(PANEL_WIDTH, 400)
    area = host.window.centralWidget()
    assert isinstance(area, QScrollArea)

    def tell(is_told: bool) -> None:
        if told == "closeUpHintLabel":
            monkeypatch.setattr(session.close_up_hints, "of", lambda state: "vague extent" if is_told else None)
        else:
            monkeypatch.setattr(SceneSession, "looks_closer", is_told)
            monkeypatch.setattr(SceneSession, "progress", WorkProgress(1, 4, "Looking closer at sphere", None))
        clicked.panel.refresh()
        QApplication.processEvents()

    for is_in_panel in (True, False):
        tell(False)
        area.verticalScrollBar().setValue(0)
        area.setAttribute(Qt.WidgetAttribute.WA_UnderMouse, is_in_panel)
        tell(True)
        assert label.visibleRegion().isEmpty() == is_in_panel


def test_a_box_that_could_not_be_looked_at_is_not_said_to_be(clicked: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    session = clicked.panel.session
    session.annotations.set_class(session.classes[0].id, close_up=BOX)
    assert clicked.ui.closeUpLabel.text().startswith("In a box")
    monkeypatch.setattr(session.close_ups, "failed", lambda state: True)
    clicked.panel.refresh()
    assert "could not be looked at" in clicked.ui.closeUpLabel.text()
    assert clicked.ui.lookAtWholeButton.isEnabled()


def test_without_a_structure_nothing_happens(widget: Any) -> None:
    widget.panel.close_up.look_closer()
    widget.panel.close_up.look_at_whole()
    assert widget.panel.session.classes == ()


def test_a_saved_scene_brings_the_close_up_back(widget: Any, tmp_path: Any) -> None:
    state = add_class(widget, "gland")
    widget.panel.session.annotations.set_class(state.id, close_up=BOX)
    path = str(tmp_path / "scene.mrml")
    slicer.mrmlScene.SetURL(path)
    slicer.mrmlScene.Commit(path)
    slicer.mrmlScene.Clear()
    slicer.mrmlScene.Import()
    assert widget.ui.closeUpLabel.text() == CLOSER
