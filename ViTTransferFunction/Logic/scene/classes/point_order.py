"""In which order the points of classes were placed, over both lists that each class has."""

from __future__ import annotations

from collections.abc import Iterable
from typing import get_args

from .class_state import ClassState, Polarity


class PointOrder:
    """Keeps in mind to which of a class's lists each point was added; within a list, they are in order anyway."""

    def __init__(self) -> None:
        self._added: dict[str, list[Polarity]] = {}

    def note(self, before: Iterable[ClassState], now: Iterable[ClassState]) -> None:
        """Classes have changed. Of points that came at once, the negative ones count as later."""
        known = {state.id: state for state in before}
        for state in now:
            was, added = known.get(state.id), self._added.setdefault(state.id, [])
            if was is None:
                added.clear()
            for polarity in get_args(Polarity):
                more = len(getattr(state, polarity)) - len(getattr(was, polarity, ()))
                added.extend([polarity] * more)
                for _ in range(-more):
                    _remove_last(added, polarity)

    def last(self, state: ClassState) -> Polarity | None:
        """In which list the point is that was placed last; None where a class has none."""
        candidates = (*get_args(Polarity), *self._added.get(state.id, ()))
        return next((polarity for polarity in reversed(candidates) if getattr(state, polarity)), None)


def _remove_last(added: list[Polarity], polarity: Polarity) -> None:
    if polarity in added:
        del added[len(added) - 1 - added[::-1].index(polarity)]
