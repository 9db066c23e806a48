"""What the parts of the panel have in common: a session that may come and go, and a way to tell the user of an error."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from ViTTransferFunction.Logic.scene.session import SceneSession


class Section:
    """One part of the panel.

    Args:
        ui: the widgets of the panel, by name.
        report: shows an error to the user.

    Attributes:
        session: what the part shows and changes; None while there is none, such as while the scene is being closed.
    """

    def __init__(self, ui: Any, report: Callable[[str], None]) -> None:
        self.ui = ui
        self.report = report
        self.session: SceneSession | None = None

    def refresh(self) -> None:
        """Bring the widgets to what the session is now."""
        raise NotImplementedError


@contextmanager
def signals_blocked(*widgets: Any) -> Iterator[None]:
    """Change widgets from code without their telling of it, as they tell of a user's change."""
    were_blocked = [widget.blockSignals(True) for widget in widgets]
    try:
        yield
    finally:
        for widget, was_blocked in zip(widgets, were_blocked, strict=True):
            widget.blockSignals(was_blocked)
