"""What can be done with the selected structure: by buttons below the table, and by the menu and keys of the table."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import qt
from slicer.i18n import tr as _

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.scene.interface.shortcuts import TABLE_KEYS, WHILE_HELD
from ViTTransferFunction.Widget.class_table import NAME
from ViTTransferFunction.Widget.section import Report, Section
from ViTTransferFunction.Widget.wording import in_menu


class ClassActions(Section):
    """Rename, recolour, begin anew, duplicate, move, remove, and a look at the points. Undo takes back all but the look.

    The keys work only while the table has the focus: neither elsewhere, nor while a name is typed.

    Args:
        ui: the widgets of the panel, by name.
        report: shows an error to the user.
        change_color: has the user choose a colour for the selected structure.
    """

    def __init__(self, ui: Any, report: Report, change_color: Callable[[], None]) -> None:
        super().__init__(ui, report)
        ui.duplicateClassButton.clicked.connect(self.duplicate)
        ui.moveClassUpButton.clicked.connect(self.move_up)
        ui.moveClassDownButton.clicked.connect(self.move_down)
        ui.removeClassButton.clicked.connect(self.remove)
        ui.classTable.contextMenuPolicy = qt.Qt.ActionsContextMenu
        self._rename = self._add(_("Rename"), self.rename, "rename")
        self._change_color = self._add(_("Change colour"), change_color)
        self._show_next_point = self._add(_("Show next point"), self.show_next_point)
        self._points_inside = self._add_markup_menu(_("Points inside from a markup"), positive=True)
        self._points_outside = self._add_markup_menu(_("Points outside from a markup"), positive=False)
        self._remove_points = self._add(_("Remove points"), self.remove_points)
        self._duplicate = self._add(_("Duplicate"), self.duplicate)
        self._move_up = self._add(_("Move up"), self.move_up, "moveUp")
        self._move_down = self._add(_("Move down"), self.move_down, "moveDown")
        self._remove = self._add(_("Remove"), self.remove, "remove")

    def refresh(self) -> None:
        """Enable what can be done now."""
        ui, selected, ids = self.ui, self.selected, [state.id for state in self.session.classes] if self.session else []
        for button, action, possible in (
            (ui.duplicateClassButton, self._duplicate, selected is not None),
            (ui.moveClassUpButton, self._move_up, selected is not None and selected.id != ids[0]),
            (ui.moveClassDownButton, self._move_down, selected is not None and selected.id != ids[-1]),
            (ui.removeClassButton, self._remove, selected is not None),
        ):
            button.enabled = action.enabled = possible
        for action in (self._rename, self._change_color, self._points_inside.menuAction(), self._points_outside.menuAction()):
            action.enabled = selected is not None
        for action in (self._show_next_point, self._remove_points):
            action.enabled = selected is not None and bool(selected.positive or selected.negative)

    def rename(self) -> None:
        """Have the user type a name."""
        table = self.ui.classTable
        item = table.item(table.currentRow(), NAME)
        if item is not None:
            table.editItem(item)

    def show_next_point(self) -> None:
        """Centre the slice views on the next point, inside or outside."""
        self.with_selected(lambda session, id_: session.show_next_point(id_))

    def remove_points(self) -> None:
        """Begin the structure anew, under its name and in its colour."""
        self.with_selected(lambda session, id_: session.annotations.remove_points(id_))

    def duplicate(self) -> None:
        """Add a structure with the same settings and points, and select it."""
        self.with_selected(lambda session, id_: session.selection.duplicate(id_))

    def move_up(self) -> None:
        """Swap the structure with the one above."""
        self._move(-1)

    def move_down(self) -> None:
        """Swap the structure with the one below."""
        self._move(+1)

    def remove(self) -> None:
        """Remove the structure and its points, and select the next one."""
        self.with_selected(lambda session, id_: session.selection.remove(id_))

    def _add_markup_menu(self, text: str, positive: bool) -> Any:
        """A menu within the table's, of the markups in the scene that can: the chosen one gives the points."""
        menu = qt.QMenu(text, self.ui.classTable)
        menu.aboutToShow.connect(lambda: self._list_markups(menu, positive))
        self.ui.classTable.addAction(menu.menuAction())
        return menu

    def _list_markups(self, menu: Any, positive: bool) -> None:
        menu.clear()
        markups = self.session.regions.markups(positive) if self.session is not None else {}
        for node_id, name in markups.items():
            self._list_markup(menu, positive, node_id, name)
        if not markups:
            of_either = _("Draw a closed curve or an ROI in Slicer's module Markups first")
            of_inside = _("Draw a closed curve, an ROI, or a line across the structure in Slicer's module Markups first")
            menu.addAction(of_inside if positive else of_either).enabled = False

    def _list_markup(self, menu: Any, positive: bool, node_id: str, name: str) -> None:
        menu.addAction(in_menu(name)).triggered.connect(lambda: self._add_markup(node_id, positive))

    def _add_markup(self, node_id: str, positive: bool) -> None:
        try:
            self.with_selected(lambda session, id_: session.regions.add_markup(id_, node_id, positive))
        except InputError as error:
            self.report(str(error))

    def _move(self, step: int) -> None:
        self.with_selected(lambda session, id_: session.annotations.move_class(id_, step))

    def _add(self, text: str, react: Callable[[], None], name: str = "") -> Any:
        """An action of the table's menu; one of that name in `TABLE_KEYS` has a key."""
        action = qt.QAction(text, self.ui.classTable)
        action.shortcutContext = qt.Qt.WidgetShortcut
        action.shortcut = qt.QKeySequence(TABLE_KEYS.get(name, ""))
        action.autoRepeat = name in WHILE_HELD
        action.triggered.connect(react)
        self.ui.classTable.addAction(action)
        return action
