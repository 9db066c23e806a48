"""Undo and redo: the states that the annotations were in."""

from __future__ import annotations

from typing import Generic, TypeVar

State = TypeVar("State")

LIMIT = 200
"""States kept: more than anybody will step back through."""


class AnnotationHistory(Generic[State]):
    """A line of states, of which one is current.

    Args:
        first: the state to begin with. States are compared with ==, and must not change.
    """

    def __init__(self, first: State) -> None:
        self._states = [first]
        self._current = 0
        self._last_kind: str | None = None

    def record(self, state: State, kind: str | None = None) -> bool:
        """Make `state` the current one, and forget what had been undone.

        Args:
            state: the annotations as they are now.
            kind: what was done. Steps of the same kind in a row count as one, such as those of a slider being dragged or of one
                stroke of a brush; None: a step of its own. Where they lead back to where they began, there was no step.

        Returns:
            Whether it differs from the state before.
        """
        if state == self._states[self._current]:
            self.correct(state)
            return False
        del self._states[self._current + 1 :]
        if kind is not None and kind == self._last_kind:
            del self._states[-1]
        if state == self._states[-1]:
            self._states[-1] = state
            kind = None  # Or what comes next would belong to the step before this one.
        else:
            self._states.append(state)
        del self._states[:-LIMIT]
        self._current = len(self._states) - 1
        self._last_kind = kind
        return True

    def correct(self, state: State) -> None:
        """What the current state has become; it may hold more than comparisons see."""
        self._states[self._current] = state

    @property
    def can_undo(self) -> bool:
        """Whether there is a state before the current one."""
        return self._current > 0

    @property
    def can_redo(self) -> bool:
        """Whether there is a state after the current one."""
        return self._current < len(self._states) - 1

    def undo(self) -> State:
        """Go back to the state before, if there is one, and return it."""
        return self._go(-1)

    def redo(self) -> State:
        """Go forward to the state that was undone last, if there is one, and return it."""
        return self._go(+1)

    def seal(self) -> None:
        """Let the next step be one of its own, whatever its kind."""
        self._last_kind = None

    def _go(self, step: int) -> State:
        self._current = min(max(self._current + step, 0), len(self._states) - 1)
        self.seal()
        return self._states[self._current]
