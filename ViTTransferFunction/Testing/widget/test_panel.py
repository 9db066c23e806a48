"""The panel as a user has it: its own .ui file and code, on PySide6 in the place of Slicer's PythonQt, with a real scene."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import slicer
from PySide6.QtCore import QLocale, QObject, Qt
from PySide6.QtGui import QAccessible, QColor, QKeySequence, QPalette
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QDialog,
    QDoubleSpinBox,
    QLabel,
    QLineEdit,
    QListView,
    QProgressBar,
    QScrollArea,
    QWidget,
)

from ViTTransferFunction.Logic.core.classes.diameter_points import points_of_diameter
from ViTTransferFunction.Logic.core.system.progress import WorkProgress
from ViTTransferFunction.Logic.scene.tools.brush_size import STEP_MM
from ViTTransferFunction.Logic.scene.tools.points_in_3d import MARKUPS_MANAGER
from ViTTransferFunction.Testing.support.scenes import add_volume
from ViTTransferFunction.Testing.support.spheres import Spheres
from ViTTransferFunction.Testing.support.standin import ctk
from ViTTransferFunction.Testing.support.standin.host import PANEL_WIDTH, Host
from ViTTransferFunction.Testing.support.standin.node_combo_box import qMRMLNodeComboBox
from ViTTransferFunction.Testing.support.widgets import add_class, in_front, place, text, wait_until
from ViTTransferFunction.Widget.progress_row import ProgressRow

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]

# Keys of the main window, of slice and 3D views, of points under the mouse, and of the markups tool bar, from Slicer's files
# qSlicerMainWindow.{ui,cxx}, qSlicerModuleSelectorToolBar.cxx, vtkMRML{SliceIntersection,Camera,Markups}Widget.cxx,
# vtkMRMLModelDisplayableManager.cxx and qMRMLMarkupsToolBar.cxx.
MAIN_WINDOW = "O S W Z Y X C V H F B 0 1 2 3 4 5 6 ` Left Right Shift+A Shift+T Shift+Space"
VIEWS = "G T F B V Shift+V R S I [ ] { } + - Left Right Up Down Home End PgUp PgDown Ins Del Backspace"
KEYS_OF_SLICER = {f"Ctrl+{key}" for key in MAIN_WINDOW.split()} | set(VIEWS.split())


def is_user_widget(child: QObject) -> bool:
    kinds = (QAbstractButton, QComboBox, QAbstractSpinBox, QLineEdit, QProgressBar, ctk.ctkSliderWidget, qMRMLNodeComboBox)
    return isinstance(child, (*kinds, ctk.ctkPathLineEdit)) or child.inherits("QTableWidget") or child.inherits("QLabel")


def test_everything_that_the_user_sees_has_a_tool_tip(widget: Any) -> None:
    named = [child for child in vars(widget.ui).values() if isinstance(child, QWidget) and is_user_widget(child)]
    named = [child for child in named if not child.objectName().startswith("qt_")]
    assert len(named) > 60
    assert [child.objectName() for child in named if not child.toolTip()] == []


def test_nothing_can_be_pressed_that_cannot_work_yet(widget: Any) -> None:
    waiting = (
        "extract",
        "writeSegments",
        "removeClass",
        "undo",
        "redo",
        "removeLast",
        "pointOn",
        "pointOff",
        "brushOn",
        "outline",
        "diameter",
        "eraser",
    )
    assert not any(getattr(widget.ui, f"{name}Button").isEnabled() for name in waiting)
    assert widget.ui.addClassButton.isEnabled()
    assert widget.ui.extractButton.toolTip() == "Select a volume first."


def test_a_chosen_volume_reaches_the_session_and_one_chosen_there_is_shown(widget: Any, volume: Any) -> None:
    session = widget.panel.session
    widget.ui.volumeSelector.setCurrentNode(volume)
    assert session.parameters.volume is volume
    session.set_volume(None)
    assert widget.ui.volumeSelector.currentNode() is None


def test_a_name_typed_in_the_table_is_the_class_s(widget: Any) -> None:
    add_class(widget)
    widget.ui.classTable.item(0, 1).setText("liver")
    assert widget.panel.session.classes[0].name == "liver"


def test_an_empty_name_is_refused_and_the_old_one_stays(widget: Any) -> None:
    add_class(widget, "liver")
    widget.ui.classTable.item(0, 1).setText(" ")
    assert widget.panel.session.classes[0].name == "liver"
    assert text(widget.ui.classTable, 0, 1) == "liver"
    assert "needs a name" in widget.ui.messageLabel.text()
    widget.panel.refresh()
    assert widget.ui.messageFrame.isVisible()
    widget.ui.classTable.item(0, 1).setText("liver ")
    assert text(widget.ui.classTable, 0, 1) == "liver"
    widget.ui.classTable.item(0, 1).setText("spleen")
    assert not widget.ui.messageFrame.isVisible()


def test_a_long_message_squeezes_nothing_when_the_module_was_left_before(host: Host, widget: Any) -> None:
    host.window.resize(PANEL_WIDTH, 700)
    slicer.app.processEvents()
    host.representation.exit()
    host.representation.enter()
    slicer.app.processEvents()
    widget.panel._messages.show("A message of so many words that they need several lines of the panel. " * 4, lambda: False)
    section = widget.ui.classesCollapsibleButton
    wait_until(lambda: section.height() >= section.minimumSizeHint().height())


def test_a_section_that_was_open_when_the_module_was_entered_again_leaves_no_gap_when_it_is_closed(
    host: Host, widget: Any
) -> None:
    host.window.resize(PANEL_WIDTH, 700)
    slicer.app.processEvents()
    high = host.representation.height()
    widget.ui.advancedCollapsibleButton.collapsed = False
    wait_until(lambda: host.representation.height() > high)
    host.representation.exit()
    host.representation.enter()
    slicer.app.processEvents()
    widget.ui.advancedCollapsibleButton.collapsed = True
    wait_until(lambda: host.representation.height() == high)


def test_a_message_is_seen_where_the_panel_is_scrolled_down(host: Host, widget: Any) -> None:
    host.window.resize(host.window.width(), 400)
    slicer.app.processEvents()
    area = host.window.centralWidget()
    assert isinstance(area, QScrollArea)
    bar = area.verticalScrollBar()
    bar.setValue(bar.maximum())
    assert bar.value() > 400
    add_class(widget, "liver")
    widget.ui.classTable.item(0, 1).setText(" ")
    slicer.app.processEvents()
    assert "needs a name" in widget.ui.messageLabel.text()
    assert not widget.ui.messageLabel.visibleRegion().isEmpty()


def test_a_long_message_is_seen_from_its_beginning_where_the_panel_is_scrolled_down(host: Host, widget: Any) -> None:
    host.window.resize(PANEL_WIDTH, 500)
    slicer.app.processEvents()
    area = host.window.centralWidget()
    assert isinstance(area, QScrollArea)
    area.verticalScrollBar().setValue(area.verticalScrollBar().maximum())
    widget.panel.session._problems.put("computing", "This may be another patient's. " * 12)
    widget.panel.refresh()
    slicer.app.processEvents()
    frame = widget.ui.messageFrame
    assert frame.visibleRegion().boundingRect() == frame.rect()


def test_a_message_is_seen_where_the_button_that_had_the_keyboard_can_no_longer_be_pressed(host: Host, widget: Any) -> None:
    host.window.resize(host.window.width(), 400)
    host.window.activateWindow()
    button = widget.ui.writeSegmentsButton
    button.setEnabled(True)
    button.setFocus()
    wait_until(lambda: QApplication.focusWidget() is button)
    area = host.window.centralWidget()
    assert isinstance(area, QScrollArea)
    area.ensureWidgetVisible(button)
    widget.panel.session._problems.put("computing", "The process ended.")
    widget.panel.refresh()
    slicer.app.processEvents()
    assert not button.isEnabled()
    assert QApplication.focusWidget() is not button
    assert not widget.ui.messageLabel.visibleRegion().isEmpty()


def test_problems_that_come_together_are_all_shown(widget: Any) -> None:
    for cause, message in (("computing", "The process ended."), ("views", "Nothing can be shown.")):
        widget.panel.session._problems.put(cause, message)
    widget.panel.refresh()
    assert widget.ui.messageLabel.text() == "⚠ The process ended.\n\n⚠ Nothing can be shown."


def test_progress_over_more_voxels_than_qt_can_count_is_shown(widget: Any) -> None:
    ProgressRow(widget.ui, "segmentation").show(WorkProgress(3 * 2**30, 2**32, "Writing segments", None))
    bar = widget.ui.segmentationProgressBar
    assert bar.value() / bar.maximum() == pytest.approx(0.75, abs=0.01)


def test_names_in_messages_are_shown_letter_by_letter(widget: Any) -> None:
    """A label that finds markup in its text would swallow it."""
    for label in (widget.ui.messageLabel, widget.ui.pointWarningsLabel):
        assert label.textFormat() == Qt.TextFormat.PlainText


def test_a_class_is_hidden_by_its_box(widget: Any) -> None:
    add_class(widget)
    widget.ui.classTable.item(0, 2).setCheckState(Qt.CheckState.Unchecked)
    assert not widget.panel.session.classes[0].visible


def test_a_double_click_on_the_colour_asks_for_another(widget: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from ViTTransferFunction.Widget import class_table

    monkeypatch.setattr(class_table, "ask_color", lambda color, name, parent: (0.0, 0.5, 1.0))
    add_class(widget)
    widget.ui.classTable.cellDoubleClicked.emit(0, class_table.COLOR)
    assert widget.panel.session.classes[0].color == (0.0, 0.5, 1.0)
    assert swatch(widget, 0).blue() == 255


@pytest.mark.parametrize("chosen", [QColor.fromRgbF(0.0, 0.5, 1.0), QColor()], ids=["chosen", "cancelled"])
def test_a_colour_is_chosen_beginning_with_the_one_before(widget: Any, monkeypatch: pytest.MonkeyPatch, chosen: QColor) -> None:
    from ViTTransferFunction.Widget import class_table

    state, asked = add_class(widget, "liver"), []

    def ask(*arguments: Any) -> QColor:
        asked.append(arguments)
        return chosen

    dialogs = SimpleNamespace(getColor=ask)
    monkeypatch.setattr(class_table, "qt", SimpleNamespace(QColor=QColor, QColorDialog=dialogs))
    color = class_table.ask_color(state.color, state.name, widget.ui.classTable)
    (shown, parent, title) = asked[0]
    assert shown.getRgbF()[:3] == pytest.approx(state.color, abs=1e-4)
    assert (parent, title) == (widget.ui.classTable, "Colour of liver")
    assert color == (pytest.approx((0.0, 0.5, 1.0), abs=1e-4) if chosen.isValid() else None)


def test_the_selected_row_shows_its_colour_as_it_is(widget: Any) -> None:
    for _ in range(2):
        add_class(widget)
    for row, state in enumerate(widget.panel.session.classes):
        widget.ui.classTable.selectRow(row)
        assert swatch(widget, row).getRgbF()[:3] == pytest.approx(state.color, abs=0.01)


def swatch(widget: Any, row: int) -> Any:
    """The colour that the table shows of a row."""
    table = widget.ui.classTable
    image = table.viewport().grab().toImage()
    return image.pixelColor(table.visualItemRect(table.item(row, 0)).center() * image.devicePixelRatio())


def test_the_selected_row_is_the_selected_class(widget: Any) -> None:
    first, second = add_class(widget, "liver"), add_class(widget, "spleen")
    assert widget.ui.classTable.currentRow() == 1
    widget.ui.classTable.selectRow(0)
    assert widget.panel.session.selected_class.id == first.id
    widget.panel.session.select_class(second.id)
    assert widget.ui.classTable.currentRow() == 1


def test_removing_a_class_is_undone_with_its_points(widget: Any) -> None:
    add_class(widget, "liver")
    place(widget, (1.0, 2.0, 3.0))
    widget.ui.removeClassButton.click()
    assert widget.ui.classTable.rowCount() == 0
    widget.ui.undoButton.click()
    assert text(widget.ui.classTable, 0, 1) == "liver"
    assert text(widget.ui.classTable, 0, 3) == "1"


def test_points_placed_in_a_view_are_counted_undone_and_redone(widget: Any) -> None:
    add_class(widget)
    widget.ui.pointOffButton.click()
    place(widget, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    assert text(widget.ui.classTable, 0, 4) == "2"
    widget.ui.undoButton.click()
    assert text(widget.ui.classTable, 0, 4) == "1"
    widget.ui.redoButton.click()
    assert text(widget.ui.classTable, 0, 4) == "2"
    widget.ui.removeLastButton.click()
    assert len(widget.panel.session.classes[0].negative) == 1


def test_sliders_set_the_selected_class_and_no_other(widget: Any) -> None:
    add_class(widget)
    add_class(widget)
    widget.ui.opacitySlider.value = 0.25
    widget.ui.proximitySlider.value = 0.5
    widget.ui.refineCheckBox.click()
    first, second = widget.panel.session.classes
    assert (second.look.opacity, second.proximity, second.refine) == (0.25, 0.5, False)
    assert (first.look.opacity, first.proximity, first.refine) == (1.0, 0.0, True)
    widget.ui.classTable.selectRow(0)
    assert (widget.ui.opacitySlider.value, widget.ui.proximitySlider.value, widget.ui.refineCheckBox.isChecked()) == (
        1,
        0,
        True,
    )


def drag(view: str, *path: tuple[int, int]) -> None:
    """Draw a line in a slice view with the left button."""
    interactor = slicer.app.layoutManager().sliceWidget(view).sliceView().interactor()
    interactor.SetEventInformation(*path[0])
    interactor.InvokeEvent("LeftButtonPressEvent")
    for x, y in path[1:]:
        interactor.SetEventInformation(x, y)
        interactor.InvokeEvent("MouseMoveEvent")
    interactor.InvokeEvent("LeftButtonReleaseEvent")


def test_strokes_in_any_slice_view_leave_points_and_the_eraser_takes_them(widget: Any) -> None:
    add_class(widget)
    widget.ui.brushSizeSlider.value = 10.0
    widget.ui.brushOnButton.click()
    drag("Red", (50, 100), (60, 100), (70, 100))
    widget.ui.brushOffButton.click()
    drag("Yellow", (50, 100), (60, 100))
    state = widget.panel.session.classes[0]
    assert (len(state.positive), len(state.negative)) == (3, 2)
    steps = np.diff(np.array(state.positive), axis=0)
    np.testing.assert_allclose(np.abs(steps), [[10.0, 0.0, 0.0]] * 2, atol=1e-6)
    widget.ui.undoButton.click()
    assert widget.panel.session.classes[0].negative == ()
    widget.ui.eraserButton.click()
    drag("Red", (50, 100), (55, 100))
    assert len(widget.panel.session.classes[0].positive) == 1
    widget.ui.eraserButton.click()
    drag("Red", (70, 100), (70, 100))
    assert len(widget.panel.session.classes[0].positive) == 1


@pytest.mark.parametrize(("kind", "path"), [("lasso", [(60, 60), (140, 60), (100, 140)]), ("box", [(60, 60), (140, 140)])])
def test_regions_in_any_slice_view_become_a_few_points_in_one_step(widget: Any, kind: str, path: list[tuple[int, int]]) -> None:
    add_class(widget)
    getattr(widget.ui, f"{kind}OnButton").click()
    drag("Red", *path)
    getattr(widget.ui, f"{kind}OffButton").click()
    drag("Green", *path)
    state = widget.panel.session.classes[0]
    for points in (state.positive, state.negative):
        assert 4 <= len(points) <= 8
        # Within 40 pixels of 1 mm about the middle of the view.
        assert np.abs(points).max() < 40.0
    widget.ui.undoButton.click()
    assert widget.panel.session.classes[0].negative == ()
    widget.ui.undoButton.click()
    assert widget.panel.session.classes[0].positive == ()


def test_a_line_across_a_structure_in_any_slice_view_becomes_points_inside_and_outside_in_one_step(
    widget: Any, host: Host
) -> None:
    add_class(widget)
    in_front(host.window)
    QTest.keyClick(host.window, Qt.Key.Key_M)
    assert widget.ui.diameterButton.isChecked()
    drag("Red", (60, 100), (90, 120), (140, 100))
    state = widget.panel.session.classes[0]
    # The view has pixels of 1 mm.
    inside, outside = points_of_diameter(np.array([[40.0, 0.0, 0.0], [-40.0, 0.0, 0.0]]), 1.0)
    np.testing.assert_allclose(np.abs(state.positive), np.abs(inside), atol=1.0)
    np.testing.assert_allclose(np.abs(state.negative), np.abs(outside), atol=1.0)
    drag("Green", (100, 60), (100, 140))
    assert len(widget.panel.session.classes[0].positive) == 2 * len(inside)
    widget.ui.undoButton.click()
    assert widget.panel.session.classes[0] == state
    widget.ui.undoButton.click()
    assert widget.panel.session.classes[0].negative == widget.panel.session.classes[0].positive == ()
    QTest.keyClick(host.window, Qt.Key.Key_M)
    assert not widget.ui.diameterButton.isChecked()
    drag("Red", (60, 100), (140, 100))
    assert widget.panel.session.classes[0].positive == ()


def test_an_outline_drawn_in_any_slice_view_becomes_points_inside_and_around_in_one_step(widget: Any, host: Host) -> None:
    add_class(widget)
    in_front(host.window)
    QTest.keyClick(host.window, Qt.Key.Key_O)
    assert widget.ui.outlineButton.isChecked()
    # The view has pixels of 1 mm, and its middle is the patient's.
    drag("Red", (60, 60), (140, 60), (140, 140), (60, 140))
    state = widget.panel.session.classes[0]
    inside, outside = (np.abs(points)[:, :2].max(axis=1) for points in (np.array(state.positive), np.array(state.negative)))
    assert inside.max() < 40.0 < outside.min()
    assert len(outside) >= 4
    widget.ui.undoButton.click()
    assert widget.panel.session.classes[0].negative == widget.panel.session.classes[0].positive == ()
    drag("Red", (60, 100), (140, 100))
    assert "encloses nothing" in widget.ui.messageLabel.text()
    assert widget.panel.session.classes[0].positive == ()


def test_a_click_with_a_tool_that_draws_tells_to_drag_until_something_is_drawn(widget: Any) -> None:
    add_class(widget)
    for button in (widget.ui.diameterButton, widget.ui.lassoOnButton):
        button.click()
        before = widget.panel.session.classes
        drag("Red", (60, 100), (61, 100))
        assert "Hold the left button down" in widget.ui.messageLabel.text()
        assert widget.panel.session.classes == before
        drag("Red", (60, 100), (140, 100), (100, 140))
        assert not widget.ui.messageFrame.isVisible()


def test_a_diameter_beside_the_volume_is_said_to_be_there_and_adds_nothing(ready: Any) -> None:
    add_class(ready)
    ready.ui.diameterButton.click()
    drag("Red", (5, 5), (40, 40))
    assert "no points were added" in ready.ui.messageLabel.text()
    assert ready.panel.session.classes[0].negative == ()


def test_a_region_beside_the_volume_is_said_to_be_there_and_adds_nothing(ready: Any) -> None:
    add_class(ready)
    ready.ui.boxOffButton.click()
    drag("Red", (5, 5), (40, 40))
    assert "no points were added" in ready.ui.messageLabel.text()
    assert ready.panel.session.classes[0].negative == ()


def test_the_list_of_keys_opens_and_closes_and_leaves_the_keyboard_to_the_main_window(widget: Any, host: Host) -> None:
    add_class(widget)
    in_front(host.window)
    QTest.keyClick(host.window, Qt.Key.Key_Question)
    (shown,) = (window for window in host.window.findChildren(QDialog) if window.isVisible())
    told = "".join(label.text() for label in shown.findChildren(QLabel))
    assert all(f"<b>{key}</b>" in told for key in ("A", "Shift+L", "J", "?", "F2", "Del"))
    assert not shown.isModal()
    QTest.keyClick(host.window, Qt.Key.Key_N)
    assert widget.panel.tools.tool == "pointOff"
    QTest.keyClick(host.window, Qt.Key.Key_Question)
    assert not shown.isVisible()
    QTest.keyClick(host.window, Qt.Key.Key_Question)
    QTest.keyClick(host.window, Qt.Key.Key_Escape)
    assert not shown.isVisible()
    assert widget.panel.tools.tool == "pointOff"
    QTest.keyClick(host.window, Qt.Key.Key_Escape)
    assert widget.panel.tools.tool is None
    for key in (Qt.Key.Key_Escape, Qt.Key.Key_Question):
        QTest.keyClick(host.window, Qt.Key.Key_Question)
        in_front(shown)
        QTest.keyClick(shown, key)
        assert not shown.isVisible()


def test_the_list_of_keys_goes_with_the_module(widget: Any, host: Host) -> None:
    widget.panel.shortcut_help.toggle()
    host.representation.exit()
    assert not any(window.isVisible() for window in host.window.findChildren(QDialog))
    host.representation.enter()


def test_the_keys_listed_are_the_keys_installed_and_only_brackets_are_slicer_s(widget: Any) -> None:
    from ViTTransferFunction.Logic.scene.interface.shortcuts import SHORTCUTS
    from ViTTransferFunction.Widget.shortcuts import OF_OTHER_PROGRAMS

    installed = [shortcut.key().toString() for shortcut in widget.panel.shortcuts.installed]
    own, of_other_programs = installed[: len(SHORTCUTS)], installed[len(SHORTCUTS) :]
    assert own == [QKeySequence(shortcut.key).toString() for shortcut in SHORTCUTS]
    assert of_other_programs == list(OF_OTHER_PROGRAMS)
    assert all(f"<b>{shortcut.key}</b>" in widget.ui.shortcutsLabel.text() for shortcut in SHORTCUTS)
    assert KEYS_OF_SLICER.intersection(own) == {"[", "]"}
    for shortcut in SHORTCUTS:
        if shortcut.button:
            assert getattr(widget.ui, shortcut.button).toolTip().endswith(f"Key: {shortcut.key}")


def test_keys_do_what_the_buttons_do_while_the_module_is_open(widget: Any, host: Host) -> None:
    add_class(widget)
    in_front(host.window)
    QTest.keyClick(host.window, Qt.Key.Key_N)
    assert widget.panel.tools.tool == "pointOff"
    QTest.keyClick(host.window, Qt.Key.Key_E)
    assert widget.panel.tools.tool == "eraser"
    QTest.keyClick(host.window, Qt.Key.Key_Escape)
    assert widget.panel.tools.tool is None
    QTest.keyClick(host.window, Qt.Key.Key_Z)
    assert widget.panel.session.classes == ()
    QTest.keyClick(host.window, Qt.Key.Key_Y)
    assert len(widget.panel.session.classes) == 1
    host.representation.exit()
    QTest.keyClick(host.window, Qt.Key.Key_A)
    assert widget.panel.tools.tool is None
    host.representation.enter()
    QTest.keyClick(host.window, Qt.Key.Key_A)
    assert widget.panel.tools.tool == "pointOn"


def test_a_key_that_is_held_down_takes_up_no_tool_again_and_removes_one_structure(widget: Any) -> None:
    again = {shortcut.key().toString() for shortcut in widget.panel.shortcuts.installed if shortcut.autoRepeat()}
    assert again == {"Z", "Y", "X", "[", "]", "Q", "W", "J", "Ctrl+Z", "Ctrl+Y", "Ctrl+Shift+Z"}
    in_table = {action.shortcut().toString(): action.autoRepeat() for action in widget.ui.classTable.actions()}
    assert {key for key, repeated in in_table.items() if key and repeated} == {"Alt+Up", "Alt+Down"}


def test_undo_and_redo_are_on_the_keys_of_other_programs_too(widget: Any, host: Host) -> None:
    add_class(widget)
    in_front(host.window)
    ctrl, shift = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.ShiftModifier
    for key, held, count in (
        (Qt.Key.Key_Z, ctrl, 0),
        (Qt.Key.Key_Y, ctrl, 1),
        (Qt.Key.Key_Z, ctrl, 0),
        (Qt.Key.Key_Z, ctrl | shift, 1),
    ):
        QTest.keyClick(host.window, key, held)
        assert len(widget.panel.session.classes) == count


def test_keys_without_a_structure_do_nothing(widget: Any) -> None:
    for shortcut in widget.panel.shortcuts.installed:
        shortcut.activated.emit()
    assert widget.panel.session.classes == ()
    assert widget.panel.tools.tool is None


def test_keys_work_in_a_window_with_views_on_a_second_monitor(widget: Any, host: Host) -> None:
    add_class(widget)
    monitor = slicer.app.layoutManager().add_detached_view("Compare", host.window)
    for window, key, tool in (
        (monitor, Qt.Key.Key_N, "pointOff"),
        (host.window, Qt.Key.Key_A, "pointOn"),
        (monitor, Qt.Key.Key_Escape, None),
    ):
        in_front(window)
        QTest.keyClick(window, key)
        assert widget.panel.tools.tool == tool
    host.representation.exit()
    in_front(monitor)
    QTest.keyClick(monitor, Qt.Key.Key_A)
    assert widget.panel.tools.tool is None


def test_keys_do_nothing_in_a_dialog(widget: Any, host: Host) -> None:
    add_class(widget)
    for modal in (False, True):
        dialog = QDialog(host.window)
        dialog.setModal(modal)
        dialog.show()
        in_front(dialog)
        before = widget.panel.tools.tool
        QTest.keyClick(dialog, Qt.Key.Key_N)
        assert widget.panel.tools.tool == before
        dialog.close()


def test_keys_work_in_a_dock_whether_it_floats_or_not(widget: Any, host: Host) -> None:
    add_class(widget)
    dock = slicer.app.layoutManager().add_floating_view("Compare", host.window)
    for floating, window, key, tool in ((True, dock, Qt.Key.Key_N, "pointOff"), (False, host.window, Qt.Key.Key_A, "pointOn")):
        dock.setFloating(floating)
        in_front(window)
        QTest.keyClick(window, key)
        assert widget.panel.tools.tool == tool


def test_the_brush_works_in_views_that_appear_while_it_is_in_hand_and_ends_with_views_that_go(widget: Any, host: Host) -> None:
    add_class(widget)
    widget.ui.brushOnButton.click()
    slicer.app.layoutManager().add_detached_view("Compare", host.window)
    drag("Compare", (50, 100), (60, 100))
    drag("Red", (50, 120), (60, 120))
    assert len(widget.panel.session.classes[0].positive) == 4
    slicer.app.layoutManager().remove_view("Compare")
    drag("Red", (50, 140), (60, 140))
    assert len(widget.panel.session.classes[0].positive) == 6


def circle_is_in(view: str) -> bool:
    window = slicer.app.layoutManager().sliceWidget(view).sliceView().interactor().GetRenderWindow()
    return any(actor.GetVisibility() for actor in window.GetRenderers().GetFirstRenderer().GetActors2D())


def move(view: str) -> None:
    interactor = slicer.app.layoutManager().sliceWidget(view).sliceView().interactor()
    interactor.SetEventInformation(80, 80)
    interactor.InvokeEvent("MouseMoveEvent")


def test_a_circle_follows_the_mouse_while_a_brush_or_the_eraser_is_in_hand(widget: Any, host: Host) -> None:
    add_class(widget)
    for button in (widget.ui.brushOnButton, widget.ui.brushOffButton, widget.ui.eraserButton):
        button.click()
        move("Green")
        assert circle_is_in("Green")
        assert not circle_is_in("Red")
        button.click()
        assert not circle_is_in("Green")
    widget.ui.pointOnButton.click()
    move("Green")
    assert not circle_is_in("Green")
    widget.ui.eraserButton.click()
    move("Green")
    slicer.app.layoutManager().add_detached_view("Compare", host.window)
    assert not circle_is_in("Green")


def circle_width(view: str) -> float:
    """In pixels, of which one is a millimetre."""
    window = slicer.app.layoutManager().sliceWidget(view).sliceView().interactor().GetRenderWindow()
    circle, *_ = (actor for actor in window.GetRenderers().GetFirstRenderer().GetActors2D() if actor.GetVisibility())
    circle.GetMapper().GetInputAlgorithm().Update()
    left, right, *_ = circle.GetMapper().GetInput().GetBounds()
    return float(right - left)


def test_the_circle_is_as_wide_as_what_is_painted_and_twice_as_wide_for_the_eraser(widget: Any) -> None:
    add_class(widget)
    widget.ui.brushSizeSlider.value = 10.0
    for button, width in ((widget.ui.brushOnButton, 10.0), (widget.ui.eraserButton, 20.0)):
        button.click()
        move("Green")
        assert circle_width("Green") == pytest.approx(width, rel=0.1)


def test_a_stroke_of_the_eraser_takes_what_lies_in_its_circle_and_is_one_step(widget: Any) -> None:
    add_class(widget)
    widget.ui.brushSizeSlider.value = 10.0
    widget.ui.brushOnButton.click()
    drag("Red", (50, 100), (60, 100), (70, 100))
    widget.ui.eraserButton.click()
    drag("Red", (50, 109), (60, 109), (70, 109))
    assert widget.panel.session.classes[0].positive == ()
    widget.ui.undoButton.click()
    assert len(widget.panel.session.classes[0].positive) == 3


def test_of_a_brush_that_is_put_down_for_points_nothing_stays_in_the_views(widget: Any) -> None:
    add_class(widget)
    widget.ui.brushOnButton.click()
    move("Green")
    widget.ui.pointOnButton.click()
    move("Green")
    assert not circle_is_in("Green")
    assert widget.panel.tools.tool == "pointOn"


def test_a_tool_is_put_down_with_the_last_structure(widget: Any) -> None:
    add_class(widget)
    widget.ui.brushOnButton.click()
    widget.ui.removeClassButton.click()
    move("Green")
    assert not circle_is_in("Green")
    assert not widget.ui.brushOnButton.isChecked()


def test_a_key_typed_into_a_name_is_a_letter(widget: Any, host: Host) -> None:
    add_class(widget)
    widget.ui.pointOnButton.click()
    host.window.activateWindow()
    table = widget.ui.classTable
    table.editItem(table.item(0, 1))
    editor = table.findChild(QLineEdit)
    QTest.keyClicks(editor, "aorta")
    QTest.keyClick(editor, Qt.Key.Key_Return)
    QTest.qWait(10)
    assert widget.panel.session.classes[0].name == "aorta"
    assert widget.panel.tools.tool is None


def focused() -> QWidget:
    widget = QApplication.focusWidget()
    assert widget is not None
    return widget


def reached_by_tab(host: Host, start: QWidget) -> list[QWidget]:
    """What has the keyboard after each Tab, once around the window."""
    host.window.activateWindow()
    start.setFocus()
    wait_until(start.hasFocus)
    reached: list[QWidget] = []
    while focused() not in reached:
        reached.append(focused())
        QTest.keyClick(focused(), Qt.Key.Key_Tab)
    return reached


def test_tab_leads_through_the_whole_panel_and_out_of_the_table_of_structures(widget: Any, host: Host) -> None:
    add_class(widget)
    add_class(widget)
    ui = widget.ui
    reached = reached_by_tab(host, ui.volumeCollapsibleButton)
    places = [reached.index(each) for each in (ui.classTable, ui.addClassButton, ui.undoButton, ui.renderingComboBox)]
    assert places == sorted(places)
    assert ui.respectOtherSegmentsCheckBox in reached


def test_the_keyboard_reaches_the_lists_of_scans_and_of_segmentations(widget: Any, host: Host) -> None:
    """Slicer's own are passed by, and Space closes the section around one that was clicked."""
    reached = reached_by_tab(host, widget.ui.volumeCollapsibleButton)
    for selector in (widget.ui.volumeSelector, widget.ui.segmentationSelector):
        assert selector.findChild(QComboBox) in reached


def test_arrows_choose_another_scan(widget: Any, host: Host) -> None:
    selector = widget.ui.volumeSelector
    first, second = (slicer.mrmlScene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", name) for name in ("first", "second"))
    selector.setCurrentNode(first)
    host.window.activateWindow()
    QTest.mouseClick(selector.findChild(QComboBox), Qt.MouseButton.LeftButton)
    QTest.keyClick(focused(), Qt.Key.Key_Escape)
    QTest.keyClick(focused(), Qt.Key.Key_Down)
    assert widget.panel.session.parameters.volume is second


def keys_work_in(box: QDoubleSpinBox, widget: Any, host: Host) -> bool:
    """Whether those of tools and of undo do while a box for a number has the keyboard, and digits are digits all the same."""
    add_class(widget)
    host.window.activateWindow()
    box.setFocus()
    box.selectAll()
    QTest.keyClicks(box, "17")
    tools = []
    for shifted in ("NoModifier", "ShiftModifier"):
        QTest.keyClick(box, Qt.Key.Key_N, Qt.KeyboardModifier[shifted])
        tools.append(widget.panel.tools.tool)
    QTest.keyClick(box, Qt.Key.Key_Z)
    return tools == ["pointOff", "brushOff"] and widget.panel.session.classes == () and box.value() == 17


def test_the_keys_work_while_a_number_of_the_panel_has_the_keyboard(widget: Any, host: Host) -> None:
    """As after its arrows were pressed."""
    assert keys_work_in(widget.ui.brushSizeSlider.findChild(QDoubleSpinBox), widget, host)


def test_the_keys_work_while_the_place_of_a_slice_has_the_keyboard(widget: Any, host: Host) -> None:
    """Above its slice, Slicer has a box for it: after a change of the layout, another one."""
    box = QDoubleSpinBox(host.window)
    box.show()
    slicer.app.layoutManager().add_detached_view("Compare", host.window)
    assert keys_work_in(box, widget, host)


def test_a_decimal_comma_is_a_point(widget: Any, host: Host) -> None:
    add_class(widget)
    box = widget.ui.brushSizeSlider.findChild(QDoubleSpinBox)
    box.setLocale(QLocale.c())  # Slicer's, in every language.
    box.setMaximum(3000.0)  # As that of intensities, where a comma would be one between thousands.
    host.window.activateWindow()
    box.selectAll()
    QTest.keyClicks(box, "12,5")
    assert box.value() == 12.5


def test_the_layout_s_3d_views_are_asked_to_hold_the_points_of_structures(ready: Any) -> None:
    manager = slicer.app.layoutManager().threeDWidget(0).managers[MARKUPS_MANAGER] = Mock()
    add_class(ready)
    session = ready.panel.session
    manager.GetWidget.assert_any_call(session.annotations.points_node(session.classes[0].id, positive=True).GetDisplayNode())


@pytest.fixture
def in_dark_colours(host: Host) -> Iterator[Any]:
    """The panel in Slicer's dark colours (qSlicerStyle), as far as the buttons have them."""
    before, dark = QApplication.palette(), QPalette(QColor("#323232"), QColor("#323232"))
    dark.setColor(QPalette.ColorRole.Highlight, QColor("#3ca4ff"))
    QApplication.setPalette(dark)
    yield host.open_panel()
    QApplication.setPalette(before)


def test_the_tool_in_hand_is_seen_in_dark_colours_as_well(in_dark_colours: Any) -> None:
    add_class(in_dark_colours)
    buttons = in_dark_colours.ui.brushOnButton, in_dark_colours.ui.brushOffButton
    height = buttons[0].sizeHint().height()

    assert [is_framed(button) for button in buttons] == [False, False]
    buttons[0].click()
    assert [is_framed(button) for button in buttons] == [True, False]
    assert buttons[0].sizeHint().height() == height
    buttons[1].click()
    assert [is_framed(button) for button in buttons] == [False, True]


def is_framed(button: QAbstractButton) -> bool:
    image = button.grab().toImage()
    return image.pixelColor(0, image.height() // 2) == QApplication.palette().highlight().color()


def test_the_tools_follow_when_slicer_goes_from_its_light_style_to_its_dark_one(widget: Any) -> None:
    light, dark = QApplication.palette(), QApplication.palette()
    dark.setColor(QPalette.ColorRole.ButtonText, QColor("white"))
    ui = widget.ui
    add_class(widget)
    buttons = (ui.pointOffButton, ui.lassoOnButton, ui.eraserButton)
    for button in buttons:
        button.click()
    assert widget.panel.tools.tool == "eraser"
    QApplication.setPalette(dark)
    QApplication.processEvents()
    try:
        assert ui.undoButton.palette().buttonText().color().name() == "#ffffff"
        assert [button.palette().buttonText().color().name() for button in buttons] == 3 * ["#ffffff"]
        assert [is_framed(button) for button in buttons] == [False, False, True]
    finally:
        QApplication.setPalette(light)


def test_a_panel_that_was_left_does_not_follow_slicers_style(widget: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    signal = slicer.app.paletteChanged
    told: list[str] = []
    monkeypatch.setattr(widget.panel.tools, "_take_up_colours", lambda: told.append("colours"))

    def change_style() -> None:
        signal.emit(QApplication.palette())
        QApplication.processEvents()

    change_style()
    widget.exit()
    change_style()
    assert told == ["colours"]
    widget.enter()
    change_style()
    assert told == 2 * ["colours"]


def test_after_a_closed_scene_the_session_is_asked_for_news_again(widget: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    slicer.mrmlScene.Clear(False)
    asked: list[bool] = []
    monkeypatch.setattr(widget.panel.session, "poll", lambda: asked.append(True))
    wait_until(lambda: bool(asked))


def test_brushes_and_the_unit_of_volumes_suit_the_size_of_the_scan(widget: Any, slicer_app: Any, spheres: Spheres) -> None:
    brush, body = widget.ui.brushSizeSlider, add_volume(slicer_app.scene, spheres[0])
    specimen = add_volume(slicer_app.scene, spheres[0])
    specimen.SetSpacing(*(0.05 * np.array(specimen.GetSpacing())))

    def offered() -> list[float]:
        return [brush.minimum, brush.maximum, brush.singleStep, brush.value, brush.decimals]

    widget.ui.volumeSelector.setCurrentNode(body)
    add_class(widget)
    before = offered()
    assert before[2] == STEP_MM, "as the form says it"
    brush.value = 10.0
    widget.ui.volumeSelector.setCurrentNode(specimen)
    wait_until(lambda: brush.maximum < before[1])
    assert offered() == pytest.approx([0.02, 1.6, 0.02, 0.4, 2])
    assert widget.ui.classTable.horizontalHeaderItem(6).text() == "mm³"
    add_class(widget)
    widget.ui.brushOnButton.click()
    brush.value = 0.2
    drag("Red", (50, 100), (150, 100))
    assert len(widget.panel.session.selected_class.positive) > 1, "the next point is a brush's size away"
    widget.ui.volumeSelector.setCurrentNode(body)
    wait_until(lambda: brush.maximum == before[1])
    assert offered() == pytest.approx(before)
    assert widget.ui.classTable.horizontalHeaderItem(6).text() == "ml"


def test_screen_readers_and_dictation_know_what_each_slider_list_box_and_button_is_called(widget: Any) -> None:
    fields = [field for field in vars(widget.ui).values() if isinstance(field, QWidget)]
    parts = {part for field in fields for part in (field, *field.findChildren(QWidget)) if is_told_of_by_its_name(part)}
    said = {part: QAccessible.queryAccessibleInterface(part).text(QAccessible.Text.Name) for part in parts}
    assert [part.objectName() for part, name in said.items() if not any(map(str.isalnum, name))] == []
    brush, volume = widget.ui.brushSizeSlider.findChild(QDoubleSpinBox), widget.ui.volumeSelector.findChild(QComboBox)
    assert said[brush] == "Brush size"
    assert volume.accessibleName() == "Volume", "which Qt says, but on Linux, where it says what is chosen"


def is_told_of_by_its_name(field: QWidget) -> bool:
    """Whether Tab leads there, though not to the list that a box opens, of which entries are told."""
    reached = field.focusPolicy() & Qt.FocusPolicy.TabFocus and field.focusProxy() is None
    return bool(reached) and not isinstance(field, QListView)
