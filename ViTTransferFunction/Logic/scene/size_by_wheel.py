"""Ctrl and the wheel over the selected structure, in any slice view, change its size: the session's side of `SizeWheel`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .classes.class_state import ClassState
from .session import SceneSession
from .tools.size_wheel import SizeWheel
from .tools.slice_tools import MakeTool


def size_wheels(session_now: Callable[[], SceneSession | None]) -> MakeTool:
    """What makes the wheel of each slice view.

    Args:
        session_now: the session whose selected class is meant; None while there is none.
    """

    def selected() -> ClassState | None:
        session = session_now()
        return session.selected_class if session else None

    def shown_class() -> str | None:
        state = selected()
        return state.id if state is not None and state.visible else None

    def is_over(point_ras: np.ndarray) -> bool:
        session = session_now()
        return session is not None and session.shown.is_on_selected(point_ras)

    def body_scale() -> float:
        session = session_now()
        return session.body_scale if session else 1.0

    def turn(notches: int) -> None:
        session, state = session_now(), selected()
        if session is not None and state is not None:
            session.annotations.turn_size(state.id, notches)

    return lambda interactor, slice_node, draw: SizeWheel(interactor, slice_node, shown_class, is_over, body_scale, turn)
