"""The table of structures and what can be done with the selected one: by button, menu and key."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import numpy as np
import slicer
import vtk
from PySide6.QtCore import Qt
from PySide6.QtGui import QFontMetrics
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLineEdit

from ViTTransferFunction.Logic.core.classes.diameter_points import points_of_diameter
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras
from ViTTransferFunction.Testing.support.standin.host import Host
from ViTTransferFunction.Testing.support.widgets import add_class, in_front, place, text, wait_until

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]

NAME, SHOWN, POSITIVE, NEGATIVE, THRESHOLD, VOLUME = range(1, 7)


def names(widget: Any) -> list[str]:
    return [text(widget.ui.classTable, row, NAME) for row in range(widget.ui.classTable.rowCount())]


def selected_name(widget: Any) -> str:
    return text(widget.ui.classTable, widget.ui.classTable.currentRow(), NAME)


def choose(widget: Any, entry: str) -> None:
    """Choose an entry of the table's menu."""
    (action,) = (action for action in widget.ui.classTable.actions() if action.text() == entry)
    assert action.isEnabled()
    action.trigger()


def focus(widget: Any, host: Host) -> Any:
    """Give the table the keyboard; returns it."""
    table = widget.ui.classTable
    host.window.activateWindow()
    table.setFocus()
    wait_until(table.hasFocus)
    return table


def centres() -> list[tuple[float, ...]]:
    """Where the slice views look."""
    manager = slicer.app.layoutManager()
    matrices = [manager.sliceWidget(name).mrmlSliceNode().GetSliceToRAS() for name in manager.sliceViewNames()]
    return [tuple(matrix.GetElement(row, 3) for row in range(3)) for matrix in matrices]


def test_a_duplicate_is_selected_and_undone(widget: Any) -> None:
    add_class(widget, "liver")
    place(widget, (1.0, 2.0, 3.0))
    add_class(widget, "spleen")
    widget.ui.classTable.selectRow(0)
    widget.ui.duplicateClassButton.click()
    assert names(widget) == ["liver", "liver copy", "spleen"]
    assert selected_name(widget) == "liver copy"
    assert text(widget.ui.classTable, 1, POSITIVE) == "1"
    widget.ui.undoButton.click()
    assert names(widget) == ["liver", "spleen"]


def test_structures_are_reordered_and_stay_selected(widget: Any) -> None:
    for name in ("liver", "spleen", "aorta"):
        add_class(widget, name)
    widget.ui.moveClassUpButton.click()
    assert names(widget) == ["liver", "aorta", "spleen"]
    assert selected_name(widget) == "aorta"
    choose(widget, "Move up")
    assert names(widget) == ["aorta", "liver", "spleen"]
    assert not widget.ui.moveClassUpButton.isEnabled()
    widget.ui.moveClassDownButton.click()
    assert names(widget) == ["liver", "aorta", "spleen"]
    widget.ui.undoButton.click()
    assert names(widget) == ["aorta", "liver", "spleen"]


def test_after_an_undone_structure_the_one_before_is_selected_again_for_the_next_point(widget: Any) -> None:
    add_class(widget, "liver")
    spleen = add_class(widget, "spleen")
    widget.ui.addClassButton.click()
    widget.ui.addClassButton.click()
    widget.ui.undoButton.click()
    widget.ui.undoButton.click()
    assert widget.panel.session.selected_class.id == spleen.id


def test_the_next_structure_is_selected_when_one_is_removed(widget: Any) -> None:
    for name in ("liver", "spleen", "aorta", "heart"):
        add_class(widget, name)
    widget.ui.classTable.selectRow(1)
    for next_one in ("aorta", "heart", "liver"):
        choose(widget, "Remove")
        assert selected_name(widget) == widget.panel.session.selected_class.name == next_one
    choose(widget, "Remove")
    assert names(widget) == []


def test_what_cannot_be_done_to_a_structure_cannot_be_pressed(widget: Any) -> None:
    ui, table = widget.ui, widget.ui.classTable
    buttons = (ui.duplicateClassButton, ui.moveClassUpButton, ui.moveClassDownButton, ui.removeClassButton)
    assert not any(button.isEnabled() for button in buttons)
    assert not any(action.isEnabled() for action in table.actions())
    add_class(widget)
    assert [button.isEnabled() for button in buttons] == [True, False, False, True]
    enabled = {action.text() for action in table.actions() if action.isEnabled()}
    from_markups = {"Points inside from a markup", "Points outside from a markup"}
    assert enabled == {"Rename", "Change colour", "Duplicate", "Remove"} | from_markups
    assert table.contextMenuPolicy() == Qt.ContextMenuPolicy.ActionsContextMenu


def test_delete_removes_the_selected_structure_where_the_table_has_the_keyboard(widget: Any, host: Host) -> None:
    add_class(widget, "liver")
    add_class(widget, "spleen")
    host.window.activateWindow()
    widget.ui.volumeSelector.setFocus()
    QTest.keyClick(widget.ui.volumeSelector, Qt.Key.Key_Delete)
    assert names(widget) == ["liver", "spleen"]
    QTest.keyClick(focus(widget, host), Qt.Key.Key_Delete)
    assert names(widget) == ["liver"]
    widget.ui.undoButton.click()
    assert names(widget) == ["liver", "spleen"]


@pytest.mark.parametrize("key", ["Up", "Down", "Left", "Right"])
def test_arrows_at_the_ends_of_the_table_leave_it_the_keyboard(widget: Any, host: Host, key: str) -> None:
    """To Qt, the section around it is a button, which gives the keyboard to the header of another section."""
    add_class(widget, "liver")
    table = focus(widget, host)
    for _ in range(table.columnCount() + 1):
        assert table.hasFocus()
        QTest.keyClick(table, Qt.Key[f"Key_{key}"])
    assert table.hasFocus()
    assert selected_name(widget) == "liver"


def test_the_header_of_a_section_has_its_keys(widget: Any, host: Host) -> None:
    header = widget.ui.classesCollapsibleButton
    host.window.activateWindow()
    header.setFocus()
    wait_until(header.hasFocus)
    QTest.keyClick(header, Qt.Key.Key_Space)
    assert widget.ui.classTable.isHidden()
    QTest.keyClick(header, Qt.Key.Key_Space)
    assert not widget.ui.classTable.isHidden()


def test_the_colour_is_changed_by_the_menu_as_well(widget: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Which a key opens."""
    from ViTTransferFunction.Widget import class_table

    add_class(widget, "liver")
    monkeypatch.setattr(class_table, "ask_color", lambda color, name, parent: (0.0, 0.5, 1.0))
    choose(widget, "Change colour")
    assert widget.panel.session.classes[0].color == (0.0, 0.5, 1.0)
    monkeypatch.setattr(class_table, "ask_color", lambda color, name, parent: None)
    choose(widget, "Change colour")
    assert widget.panel.session.classes[0].color == (0.0, 0.5, 1.0)


def test_keys_select_the_structure_above_and_below_and_the_tables_ends_meet(widget: Any, host: Host) -> None:
    in_front(host.window)
    QTest.keyClick(host.window, Qt.Key.Key_W)
    for name in ("liver", "spleen", "aorta"):
        add_class(widget, name)
    for key, name in (("Q", "spleen"), ("Q", "liver"), ("Q", "aorta"), ("W", "liver"), ("W", "spleen")):
        QTest.keyClick(host.window, Qt.Key[f"Key_{key}"])
        assert widget.panel.session.selected_class.name == selected_name(widget) == name


def test_f2_renames_and_delete_then_deletes_a_letter(widget: Any, host: Host) -> None:
    add_class(widget, "liver")
    table = focus(widget, host)
    QTest.keyClick(table, Qt.Key.Key_F2)
    editor = table.findChild(QLineEdit)
    QTest.keyClick(editor, Qt.Key.Key_Home)
    QTest.keyClick(editor, Qt.Key.Key_Delete)
    QTest.keyClick(editor, Qt.Key.Key_Return)
    wait_until(lambda: names(widget) == ["iver"])


def test_a_key_after_a_click_on_the_selected_structure_is_no_new_name(widget: Any, host: Host) -> None:
    add_class(widget, "liver")
    table = focus(widget, host)
    middle = table.visualItemRect(table.item(0, NAME)).center()
    QTest.mouseClick(table.viewport(), Qt.MouseButton.LeftButton, pos=middle)
    # Qt waits that long for a second click before it has a name edited.
    QTest.qWait(QApplication.doubleClickInterval() + 200)
    assert table.findChild(QLineEdit) is None
    QTest.mouseDClick(table.viewport(), Qt.MouseButton.LeftButton, pos=middle)
    # Qt's double click leaves the button held, for all tests that follow.
    QTest.mouseRelease(table.viewport(), Qt.MouseButton.LeftButton, pos=middle)
    assert table.findChild(QLineEdit) is not None


def test_a_click_with_ctrl_leaves_the_selected_structure_marked(widget: Any) -> None:
    """The next point is still its own."""
    add_class(widget, "liver")
    add_class(widget, "spleen")
    table = widget.ui.classTable
    for row, name in ((1, "spleen"), (0, "liver"), (0, "liver")):
        middle = table.visualItemRect(table.item(row, POSITIVE)).center()
        QTest.mouseClick(table.viewport(), Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ControlModifier, middle)
        assert widget.panel.session.selected_class.name == name
        assert {index.row() for index in table.selectedIndexes()} == {row}


@pytest.mark.parametrize(("structures", "rows"), [(0, 4), (2, 4), (5, 5), (8, 8), (9, 8)])
def test_the_table_is_as_high_as_its_rows_from_four_to_eight(widget: Any, structures: int, rows: int) -> None:
    table = widget.ui.classTable
    for _ in range(structures):
        add_class(widget)
    row_height = table.rowHeight(0) or table.verticalHeader().minimumSectionSize()
    wait_until(lambda: table.viewport().height() == rows * row_height)
    assert (table.verticalScrollBar().maximum() > 0) == (structures > rows)


def test_the_selected_structure_is_in_sight_when_a_scene_of_many_is_opened(
    widget: Any, slicer_app: Any, tmp_path: Path
) -> None:
    table = widget.ui.classTable
    for _ in range(20):
        add_class(widget)
    widget.panel.session.select_class(widget.panel.session.classes[12].id)
    scene = tmp_path / "scene.mrml"
    slicer_app.scene.Commit(str(scene))
    slicer_app.scene.Clear(False)
    QTest.qWait(10)
    assert table.rowCount() == 0
    slicer_app.scene.SetURL(str(scene))
    slicer_app.scene.Import()
    QTest.qWait(10)
    assert table.currentRow() == 12
    assert table.viewport().rect().contains(table.visualItemRect(table.item(12, NAME)))


def test_a_double_click_on_a_count_goes_from_point_to_point_of_that_kind(widget: Any) -> None:
    first, second, outside = (1.0, 2.0, 3.0), (-4.0, 5.0, 6.0), (7.0, -8.0, 9.0)
    add_class(widget)
    place(widget, first, second)
    widget.ui.pointOffButton.click()
    place(widget, outside)
    for column, expected in ((POSITIVE, first), (POSITIVE, second), (POSITIVE, first), (NEGATIVE, outside)):
        widget.ui.classTable.cellDoubleClicked.emit(0, column)
        assert centres() == [pytest.approx(expected)] * 3
    choose(widget, "Show next point")
    assert centres() == [pytest.approx(first)] * 3


def test_a_structure_is_begun_anew_by_the_menu_and_has_the_next_click(widget: Any) -> None:
    add_class(widget, "liver")
    place(widget, (1.0, 2.0, 3.0), (-4.0, 5.0, 6.0))
    choose(widget, "Remove points")
    assert [(state.name, state.positive) for state in widget.panel.session.classes] == [("liver", ())]
    place(widget, (0.0, 0.0, 0.0))
    assert [len(state.positive) for state in widget.panel.session.classes] == [1]


def test_points_come_from_a_markup_that_is_chosen_in_the_menu(widget: Any) -> None:
    add_class(widget)
    inside, outside = (action.menu() for action in widget.ui.classTable.actions() if action.menu())
    inside.aboutToShow.emit()
    (hint,) = inside.actions()
    assert not hint.isEnabled()
    assert "closed curve, an ROI, or a line" in hint.text()
    for name, size_mm in (("liver & lung", 30.0), ("beside it", 60.0)):
        box = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLMarkupsROINode", name)
        box.SetCenter(0.0, 0.0, 0.0)
        box.SetSize(size_mm, size_mm, size_mm)
    for menu, entry in ((inside, 0), (outside, 1)):
        menu.aboutToShow.emit()
        # To Qt, a single & marks the key of an entry, and is not shown.
        assert [action.text() for action in menu.actions()] == ["liver && lung", "beside it"]
        menu.actions()[entry].trigger()
    state = widget.panel.session.classes[0]
    assert (len(state.positive), len(state.negative)) == (8, 8)
    assert np.abs(np.array(state.positive)).max() < 15.0 < np.abs(np.array(state.negative)).max()


def test_a_line_of_markups_gives_the_points_of_a_diameter_and_is_none_of_what_lies_outside(widget: Any) -> None:
    add_class(widget)
    line = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLMarkupsLineNode", "longest")
    for x in (-20.0, 20.0):
        line.AddControlPointWorld(vtk.vtkVector3d(x, 1.0, 2.0))
    menus = [action.menu() for action in widget.ui.classTable.actions() if action.menu()]
    for menu in menus:
        menu.aboutToShow.emit()
    (entry,), (hint,) = (menu.actions() for menu in menus)
    assert not hint.isEnabled()
    assert "line" not in hint.text()
    assert entry.text() == "longest"
    entry.trigger()
    state = widget.panel.session.classes[0]
    inside, outside = points_of_diameter(np.array([[-20.0, 1.0, 2.0], [20.0, 1.0, 2.0]]), 1.0)
    np.testing.assert_allclose(state.positive, inside)
    np.testing.assert_allclose(state.negative, outside)


def test_why_a_markup_gives_no_points_is_told(widget: Any, volume: Any) -> None:
    widget.ui.volumeSelector.setCurrentNode(volume)
    add_class(widget)
    box = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLMarkupsROINode", "elsewhere")
    box.SetCenter(1000.0, 0.0, 0.0)
    box.SetSize(30.0, 30.0, 30.0)
    menu = next(action.menu() for action in widget.ui.classTable.actions() if action.menu())
    menu.aboutToShow.emit()
    (entry,) = menu.actions()
    entry.trigger()
    assert "no points were added" in widget.ui.messageLabel.text()
    assert widget.panel.session.classes[0].positive == ()


def test_a_structure_that_is_hidden_has_no_tick_and_one_whose_name_is_cut_off_is_told_under_the_mouse(widget: Any) -> None:
    name = "Left kidney without the cyst at its lower pole"
    add_class(widget, name)
    table, session = widget.ui.classTable, widget.panel.session
    assert table.item(0, NAME).toolTip() == name
    session.annotations.set_class(session.classes[0].id, visible=False)
    widget.panel.refresh()
    assert table.item(0, SHOWN).checkState() == Qt.CheckState.Unchecked
    widget.ui.undoButton.click()
    assert table.item(0, SHOWN).checkState() == Qt.CheckState.Checked


def test_threshold_and_volume_in_millilitres_are_shown_as_soon_as_there_is_a_map(ready: Any, spheres: Spheres) -> None:
    add_class(ready)
    table, session = ready.ui.classTable, ready.panel.session
    assert (text(table, 0, THRESHOLD), text(table, 0, VOLUME)) == ("–", "–")
    place(ready, tuple(centre_ras(spheres, 1)[0]))
    wait_until(lambda: text(table, 0, VOLUME) != "–" and not ready.panel.session.busy)
    sphere_ml = 4.0 / 3.0 * 3.1416 * 1.6**3
    assert float(text(table, 0, VOLUME)) == pytest.approx(sphere_ml, rel=0.1)
    assert text(table, 0, THRESHOLD) == f"({session.chosen_iso(session.classes[0].id):.2f})"


def test_all_columns_fit_into_the_panel_and_leave_room_for_a_name(widget: Any) -> None:
    add_class(widget, "Left adrenal gland")
    table = widget.ui.classTable
    assert table.horizontalHeader().length() <= table.viewport().width()
    assert table.columnWidth(NAME) >= QFontMetrics(table.font()).horizontalAdvance("Left adrenal gland")


def test_a_click_looks_for_no_translation_for_each_structure(widget: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """In Slicer each takes some hundredth of a millisecond, in the way of the answer to the click."""
    from ViTTransferFunction.Widget import class_table

    for _ in range(3):
        add_class(widget)
    looked_for: list[str] = []

    def look_for(words: str) -> str:
        looked_for.append(words)
        return words

    monkeypatch.setattr(class_table, "_", look_for)
    widget.panel.refresh()
    assert looked_for == []
    assert "colour" in widget.ui.classTable.item(2, 0).toolTip()
    assert "millilitres" in widget.ui.classTable.item(2, VOLUME).toolTip()
