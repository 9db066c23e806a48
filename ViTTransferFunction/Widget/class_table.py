"""The table of structures: colour, name, visibility, numbers of points, threshold, volume."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import qt
from slicer.i18n import tr as _

from ViTTransferFunction.Logic.core.classes.colors import Color
from ViTTransferFunction.Logic.scene.classes.class_state import ClassState, Polarity
from ViTTransferFunction.Logic.scene.interface.wording import threshold_text, volume_text, volume_unit
from ViTTransferFunction.Widget.section import Report, Section, signals_blocked

COLOR, NAME, SHOWN, POSITIVE, NEGATIVE, THRESHOLD, VOLUME = range(7)
_SWATCH_PIXELS = 64
"""Qt makes icons smaller, but never larger."""
_FEWEST_ROWS, _MOST_ROWS = 4, 8
"""That the table has room for: what lies below it is not to move with each of the first structures, nor to be far away."""
_POLARITIES: dict[int, Polarity] = {POSITIVE: "positive", NEGATIVE: "negative"}


class ClassTable(Section):
    """Shows the classes, has them renamed, recoloured, hidden and selected, and adds them.

    Args:
        ui: the widgets of the panel, by name.
        report: shows an error to the user.
        on_added: called after a class was added and selected.
    """

    def __init__(self, ui: Any, report: Report, on_added: Callable[[], None]) -> None:
        super().__init__(ui, report)
        self._on_added = on_added
        self._table = ui.classTable
        self._tips = _tips()
        header = self._table.horizontalHeader()
        # Fonts and translations vary.
        header.setSectionResizeMode(qt.QHeaderView.ResizeToContents)
        header.setSectionResizeMode(NAME, qt.QHeaderView.Stretch)
        self._table.verticalHeader().setSectionResizeMode(qt.QHeaderView.ResizeToContents)
        self._table.verticalHeader().sectionResized.connect(self._on_row_resized)
        self._resized = qt.QTimer(self._table)
        # Not by its name, which Slicer has given to a function of its own.
        self._resized.setProperty("singleShot", True)
        self._resized.timeout.connect(self._make_room_for_rows)
        self._table.cellChanged.connect(self._on_cell_changed)
        self._table.cellDoubleClicked.connect(self._on_double_click)
        self._table.itemSelectionChanged.connect(self._on_selection)
        ui.addClassButton.clicked.connect(self.add)

    def refresh(self) -> None:
        """Show the classes as they are."""
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
        """Select the class `step` rows further down; the table's ends meet."""
        if self.session is not None:
            self.session.selection.select_neighbour(step)

    def change_color(self) -> None:
        """Have the user choose a colour for the selected class."""
        if self.selected is not None:
            self._change_color_of(self.selected)

    @property
    def _volume_unit(self) -> str:
        return volume_unit(self.session.body_scale if self.session else 1.0)

    def _select(self, row: int) -> None:
        if self._table.currentRow() != row:
            self._table.selectRow(row)
            # Where its rows are new, as in a scene that was opened, Qt does not.
            self._table.scrollToItem(self._table.item(row, NAME))

    def _make_room_for_headers(self) -> None:
        """Have the panel at least so wide that no header is cut off; the one of names would, which takes what is left."""
        header = self._table.horizontalHeader()
        widths = [header.sectionSizeHint(column) for column in range(self._table.columnCount)]
        self._table.minimumWidth = sum(widths) + self._table.verticalScrollBar().sizeHint.width() + 2 * self._table.frameWidth

    def _make_room_for_rows(self) -> None:
        """Have the table as high as its rows, from `_FEWEST_ROWS` to `_MOST_ROWS`, beyond which it is scrolled."""
        count = self._table.rowCount
        row_height = self._table.rowHeight(0) if count else self._table.verticalHeader().minimumSectionSize
        rows_height = row_height * min(max(count, _FEWEST_ROWS), _MOST_ROWS)
        height = self._table.horizontalHeader().sizeHint.height() + rows_height + 2 * self._table.frameWidth
        self._table.minimumHeight = self._table.maximumHeight = height

    def _on_row_resized(self, _row: int, _before: int, _height: int) -> None:
        """Letters have another size, say. Qt tells of it before the row has its new height."""
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
        """The cell's item, which is made the first time."""
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
            # The cell has what was typed, also where the name stays as it was.
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
                # A click with Ctrl on the selected row would leave none marked, and points would go to it all the same.
                with signals_blocked(self._table):
                    self._table.selectRow(row)


def _tips() -> dict[int, str]:
    """What the tool tip of each column's cells says: once, since Slicer takes its time to look for a translation."""
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
    """Have the user choose a colour; None where the user cancels."""
    title = _("Colour of {name}").format(name=name)
    chosen = qt.QColorDialog.getColor(qt.QColor.fromRgbF(*color), parent, title)
    return (chosen.redF(), chosen.greenF(), chosen.blueF()) if chosen.isValid() else None


def _set_swatch(item: Any, color: Any) -> None:
    """Have an item show a colour as it is. A colour by itself, Qt would mix with that of the selection in the selected row."""
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
