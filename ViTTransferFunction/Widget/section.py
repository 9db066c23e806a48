"""What the parts of the panel have in common: a session that may come and go, and a way to tell the user of an error."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Logic.scene.class_state import ClassState
from ViTTransferFunction.Logic.scene.session import SceneSession

Report = Callable[..., None]
"""Shows an error to the user, `report(message)`, until they go on; `report(message, solved=…)`: until that says so."""


class Section:
    """One part of the panel.

    Args:
        ui: the widgets of the panel, by name.
        report: shows an error to the user.

    Attributes:
        session: what the part shows and changes; None while there is none, such as while the scene is being closed.
    """

    def __init__(self, ui: Any, report: Report) -> None:
        self.ui = ui
        self.report = report
        self.session: SceneSession | None = None

    @property
    def selected(self) -> ClassState | None:
        """The class that is selected in the table."""
        return self.session.selected_class if self.session else None

    def threshold(self, state: ClassState) -> float | None:
        """A class's threshold, set by the user or chosen from its map; None where the class has no map yet."""
        if state.iso is not None:
            return state.iso
        return self.session.chosen_iso(state.id) if self.session else None

    def refresh(self) -> None:
        """Bring the widgets to what the session is now."""
        raise NotImplementedError

    def attempt(self, action: Callable[[], None]) -> None:
        """Do what the user asked for, or tell why it cannot be done; then show what has become of it."""
        try:
            action()
        except InputError as error:
            self.report(str(error))
        self.refresh()


@contextmanager
def signals_blocked(*widgets: Any) -> Iterator[None]:
    """Change widgets from code without the signals that they send when a user changes them."""
    were_blocked = [widget.blockSignals(True) for widget in widgets]
    try:
        yield
    finally:
        for widget, was_blocked in zip(widgets, were_blocked, strict=True):
            widget.blockSignals(was_blocked)
