"""What tests do with the module's panel, as a user does."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import slicer
import vtk
from PySide6.QtTest import QTest

from ViTTransferFunction.Testing.support.event_loop import idle_with_the_lock
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S


def wait_until(condition: Callable[[], bool]) -> None:
    """Let the application run until `condition` holds; Python's threads get as little of it as in Slicer."""
    until = time.monotonic() + LONGEST_WAIT_S
    while not condition():
        assert time.monotonic() < until, "nothing came"
        slicer.app.processEvents()
        idle_with_the_lock(0.005)


def in_front(window: Any) -> None:
    """Have keys go to a window."""
    window.activateWindow()
    QTest.qWait(10)


def add_class(widget: Any, name: str = "") -> Any:
    """Add a class by the button; returns its state."""
    widget.ui.addClassButton.click()
    selected = widget.panel.session.selected_class
    if name:
        widget.panel.session.annotations.set_class(selected.id, name=name)
    return widget.panel.session.selected_class


def place(widget: Any, *points: tuple[float, float, float]) -> None:
    """Place points in the list that Slicer's place mode is set to, as clicks in a view do."""
    selection = slicer.app.applicationLogic().GetSelectionNode()
    node = slicer.mrmlScene.GetNodeByID(selection.GetActivePlaceNodeID())
    for point in points:
        node.AddControlPointWorld(vtk.vtkVector3d(*point))


def text(table: Any, row: int, column: int) -> str:
    """What a cell of a table says."""
    return table.item(row, column).text()
