"""What the parts of the panel have in common: a session that may come and go, and a way to tell the user of an error."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.scene.classes.class_state import ClassState
from ViTTransferFunction.Logic.scene.session import SceneSession


class Report(Protocol):
    """Shows errors to the user."""

    def __call__(self, message: str, solved: Callable[[], bool] | None = None, about: str = "") -> None:
        """Show one until it is `solved`; by default until the user goes on, or what it is `about` is tried again."""

    def try_again(self, about: str) -> None:
        """Forget why something was not done that is tried once more."""


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

    def with_selected(self, act: Callable[[SceneSession, str], Any]) -> None:
        """Do something to the class that is selected in the table, by its id; nothing where none is."""
        selected = self.selected
        if self.session is not None and selected is not None:
            act(self.session, selected.id)

    def set_selected(self, **fields: Any) -> None:
        """Change fields of the class that is selected in the table."""
        self.with_selected(lambda session, id_: session.annotations.set_class(id_, **fields))

    def cancel(self) -> None:
        """Stop what runs."""
        if self.session is not None:
            self.session.cancel()

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
        # Each thing is asked for in one place of the code.
        about = action.__qualname__
        self.report.try_again(about)
        try:
            action()
        except InputError as error:
            self.report(str(error), about=about)
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
