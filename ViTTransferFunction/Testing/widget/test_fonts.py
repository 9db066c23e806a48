"""Large fonts and long translations: nothing in the panel is cut off."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QApplication, QLabel, QWidget

from ViTTransferFunction.Testing.support.standin.host import PANEL_WIDTH, Host
from ViTTransferFunction.Testing.support.widgets import add_class, wait_until

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]


@pytest.fixture(params=[1.0, 1.25, 1.5, 2.0])
def in_large_letters(host: Host, request: pytest.FixtureRequest) -> Iterator[Any]:
    """The panel in larger letters, as wide as Slicer makes it: no narrower than what it holds needs."""
    before = QApplication.font()
    larger = QApplication.font()
    larger.setPointSizeF(before.pointSizeF() * request.param)
    QApplication.setFont(larger)
    widget = host.open_panel()
    add_class(widget, "left kidney")
    for name in ("shortcuts", "advanced"):
        getattr(widget.ui, f"{name}CollapsibleButton").click()
    fit(host)
    yield widget
    QApplication.setFont(before)


def fit(host: Host) -> None:
    """As Slicer's module panel does (qSlicerModulePanel)."""
    host.window.resize(max(PANEL_WIDTH, host.wanted_width + 20), 2000)
    QTest.qWait(10)


def clipped_columns(table: Any) -> list[str]:
    header = table.horizontalHeader()
    columns = [column for column in range(table.columnCount()) if not table.isColumnHidden(column)]
    return [
        table.horizontalHeaderItem(column).text()
        for column in columns
        if header.sectionSize(column) < header.sectionSizeHint(column)
    ]


def test_the_table_is_as_high_as_its_rows_when_letters_become_larger_and_small_again(widget: Any) -> None:
    add_class(widget, "left kidney")
    table, before = widget.ui.classTable, QApplication.font()
    row = table.rowHeight(0)
    larger = QApplication.font()
    larger.setPointSizeF(before.pointSizeF() * 2.0)
    QApplication.setFont(larger)
    wait_until(lambda: table.rowHeight(0) > row and table.viewport().height() == 4 * table.rowHeight(0))
    QApplication.setFont(before)
    wait_until(lambda: table.rowHeight(0) == row and table.viewport().height() == 4 * row)


def test_the_tables_headers_and_rows_are_as_large_as_their_letters(in_large_letters: Any, host: Host) -> None:
    table = in_large_letters.ui.classTable
    assert clipped_columns(table) == []
    assert table.rowHeight(0) >= table.fontMetrics().height()
    for column, text in enumerate(("", "Name der Struktur", "Anzeigen", "+", "−", "Schwellenwert")):
        table.horizontalHeaderItem(column).setText(text)
    in_large_letters.panel.refresh()
    fit(host)
    assert clipped_columns(table) == []


def test_no_label_and_no_button_is_cut_off(in_large_letters: Any) -> None:
    shown = [child for child in vars(in_large_letters.ui).values() if isinstance(child, QWidget) and child.isVisible()]
    written = [
        child
        for child in shown
        if (isinstance(child, QAbstractButton) or (isinstance(child, QLabel) and not child.wordWrap())) and child.text()
    ]
    assert len(written) > 30
    assert [child.objectName() for child in written if child.width() < child.minimumSizeHint().width()] == []
    assert [child.objectName() for child in written if child.height() < child.fontMetrics().height()] == []
