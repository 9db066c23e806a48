"""The table of structures with colour, name, visibility, numbers of points, threshold and volume."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import qt
from slicer.i18n import tr as _

from ViTTransferFunction.Logic.core.classes.colors import Color
from ViTTransferFunction.Logic.scene.classes.class_state import ClassState, Polarity
from ViTTransferFunction.Logic.scene.interface.number_texts import threshold_text, volume_text, volume_unit
from ViTTransferFunction.Widget.section import Report, Section, signals_blocked

COLOR, NAME, SHOWN, POSITIVE, NEGATIVE, THRESHOLD, VOLUME = range(7)
_SWATCH_PIXELS = 64
"""Size of the colour icons before scaling: Qt makes icons smaller, but never larger."""
_FEWEST_ROWS, _MOST_ROWS = 4, 8
"""Limits of the number of rows that are visible without scrolling, so that the widgets below neither move with each of the
first structures, nor end up far down."""
_POLARITIES: dict[int, Polarity] = {POSITIVE: "positive", NEGATIVE: "negative"}


class ClassTable(Section):
    """Shows the classes, and lets the user add, rename, recolour, hide and select them.

    Args:
        ui: the widgets of the panel, as attributes by their names.
        report: shows an error to the user.
        on_added: called after the user added a class, which is then selected.
    """

    def __init__(self, ui: Any, report: Report, on_added: Callable[[], None]) -> None:
        super().__init__(ui, report)
        self._on_added = on_added
        self._table = ui.classTable
        self._tips = _tips()
        header = self._table.horizontalHeader()
        # Sizes follow from the contents, since fonts and translations vary.
        header.setSectionResizeMode(qt.QHeaderView.ResizeToContents)
        header.setSectionResizeMode(NAME, qt.QHeaderView.Stretch)
        self._table.verticalHeader().setSectionResizeMode(qt.QHeaderView.ResizeToContents)
        self._table.verticalHeader().sectionResized.connect(self._on_row_resized)
        self._resized = qt.QTimer(self._table)
        # As a property, since Slicer's Python has a function in place of the attribute `singleShot`.
        self._resized.setProperty("singleShot", True)
        self._resized.timeout.connect(self._make_room_for_rows)
        self._table.cellChanged.connect(self._on_cell_changed)
        self._table.cellDoubleClicked.connect(self._on_double_click)
        self._table.itemSelectionChanged.connect(self._on_selection)
        ui.addClassButton.clicked.connect(self.add)

    def refresh(self) -> None:
        """Show the current state of the classes."""
        session = self.session
        classes = session.classes if session else ()
        selected = session.selected_class if session else None
        with signals_blocked(self._table):
            _set_text(self._table.horizontalHeaderItem(VOLUME), self._volume_unit)
            self._table.rowCount = len(classes)
            for row, state in enumerate(classes):
                self._fill(row, state)
            self._make_room_for_rows()
            if selected is not None:
                self._select([state.id for state in classes].index(selected.id))
        self._make_room_for_headers()
        self.ui.addClassButton.enabled = session is not None

    def add(self) -> None:
        """Add a class and select it."""
        if self.session is not None:
            self.session.select_class(self.session.annotations.add_class().id)
            self._on_added()

    def select_neighbour(self, step: int) -> None:
        """Select the class `step` rows further down; after the last row comes the first."""
        if self.session is not None:
            self.session.selection.select_neighbour(step)

    def change_color(self) -> None:
        """Ask the user for a colour for the selected class."""
        if self.selected is not None:
            self._change_color_of(self.selected)

    @property
    def _volume_unit(self) -> str:
        return volume_unit(self.session.body_scale if self.session else 1.0)

    def _select(self, row: int) -> None:
        if self._table.currentRow() != row:
            self._table.selectRow(row)
            # Qt does not scroll by itself if the rows are new, for example after a scene was opened.
            self._table.scrollToItem(self._table.item(row, NAME))

    def _make_room_for_headers(self) -> None:
        """Make the panel so wide that no header is cut off, in particular that of names, which gets the remaining width."""
        header = self._table.horizontalHeader()
        widths = [header.sectionSizeHint(column) for column in range(self._table.columnCount)]
        self._table.minimumWidth = sum(widths) + self._table.verticalScrollBar().sizeHint.width() + 2 * self._table.frameWidth

    def _make_room_for_rows(self) -> None:
        """Make the table as high as its rows, but at least `_FEWEST_ROWS` and at most `_MOST_ROWS`, beyond which it scrolls."""
        count = self._table.rowCount
        row_height = self._table.rowHeight(0) if count else self._table.verticalHeader().minimumSectionSize
        rows_height = row_height * min(max(count, _FEWEST_ROWS), _MOST_ROWS)
        height = self._table.horizontalHeader().sizeHint.height() + rows_height + 2 * self._table.frameWidth
        self._table.minimumHeight = self._table.maximumHeight = height

    def _on_row_resized(self, _row: int, _before: int, _height: int) -> None:
        """Adjust the table later, for example to a new font size: Qt sends this signal before the row has its new height."""
        self._resized.start(0)

    def _fill(self, row: int, state: ClassState) -> None:
        _set_swatch(self._item(row, COLOR), qt.QColor.fromRgbF(*state.color))
        name = self._item(row, NAME, qt.Qt.ItemIsEditable)
        _set_text(name, state.name)
        name.setToolTip(state.name)
        shown = self._item(row, SHOWN, qt.Qt.ItemIsUserCheckable)
        shown.setCheckState(qt.Qt.Checked if state.visible else qt.Qt.Unchecked)
        for column, polarity in _POLARITIES.items():
            _set_text(self._item(row, column), str(len(getattr(state, polarity))))
        chosen = self.session.chosen_iso(state.id) if self.session else None
        _set_text(self._item(row, THRESHOLD), threshold_text(state.iso, chosen))
        _set_text(
            self._item(row, VOLUME), volume_text(self.session.volume_ml(state.id) if self.session else None, self._volume_unit)
        )

    def _item(self, row: int, column: int, ability: Any = None) -> Any:
        """The cell's item, which is created if it does not exist."""
        item = self._table.item(row, column)
        if item is None:
            item = qt.QTableWidgetItem()
            flags = qt.Qt.ItemIsEnabled | qt.Qt.ItemIsSelectable
            item.setFlags(flags | ability if ability is not None else flags)
            if column in (POSITIVE, NEGATIVE, THRESHOLD, VOLUME):
                item.setTextAlignment(qt.Qt.AlignCenter)
            item.setToolTip(self._tips.get(column, ""))
            self._table.setItem(row, column, item)
        return item

    def _on_cell_changed(self, row: int, column: int) -> None:
        if self.session is None or row >= len(self.session.classes):
            return
        state, item = self.session.classes[row], self._table.item(row, column)
        if column == SHOWN:
            self.session.annotations.set_class(state.id, visible=item.checkState() == qt.Qt.Checked)
        elif column == NAME:
            annotations = self.session.annotations
            # The cell shows what was typed, even if the name is refused.
            self.attempt(lambda: annotations.set_class(state.id, name=item.text()))

    def _on_double_click(self, row: int, column: int) -> None:
        if self.session is None:
            return
        state = self.session.classes[row]
        if column == COLOR:
            self._change_color_of(state)
        elif column in _POLARITIES:
            self.session.show_next_point(state.id, [_POLARITIES[column]])

    def _change_color_of(self, state: ClassState) -> None:
        color = ask_color(state.color, state.name, self._table)
        if self.session is not None and color is not None:
            self.session.annotations.set_class(state.id, color=color)

    def _on_selection(self) -> None:
        row = self._table.currentRow()
        if self.session is not None and 0 <= row < len(self.session.classes):
            self.session.select_class(self.session.classes[row].id)
            if not self._table.item(row, NAME).isSelected():
                # Otherwise a Ctrl+click on the selected row would leave no row marked, although points still go to its class.
                with signals_blocked(self._table):
                    self._table.selectRow(row)


def _tips() -> dict[int, str]:
    """The tool tips of the cells by column; to be called once, since Slicer's translation is slow."""
    tour = _("Double-click to go from point to point in the slice views.")
    return {
        COLOR: _("Double-click to change the colour."),
        POSITIVE: tour,
        NEGATIVE: tour,
        VOLUME: _(
            "Volume in millilitres, or in mm³ where the scan is small, by the points as they are: roughly at once, exactly a "
            "moment later. What the segment leaves to other segments is not taken off."
        ),
    }


def ask_color(color: Color, name: str, parent: Any) -> Color | None:
    """Ask the user for a colour; None if the user cancels."""
    title = _("Colour of {name}").format(name=name)
    chosen = qt.QColorDialog.getColor(qt.QColor.fromRgbF(*color), parent, title)
    return (chosen.redF(), chosen.greenF(), chosen.blueF()) if chosen.isValid() else None


def _set_swatch(item: Any, color: Any) -> None:
    """Show a colour in an item by an icon, since Qt would blend a plain colour with the selection's in the selected row."""
    if item.data(qt.Qt.UserRole) == color.name():
        return
    item.setData(qt.Qt.UserRole, color.name())
    pixmap = qt.QPixmap(_SWATCH_PIXELS, _SWATCH_PIXELS)
    pixmap.fill(color)
    icon = qt.QIcon()
    for mode in (qt.QIcon.Normal, qt.QIcon.Selected):
        icon.addPixmap(pixmap, mode)
    item.setIcon(icon)


def _set_text(item: Any, text: str) -> None:
    if item.text() != text:
        item.setText(text)
