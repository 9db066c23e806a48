"""Which of several DICOM series to open: asked in a dialog of the page."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from typing import Any


class SeriesQuestion:
    """The question, one at a time. To be used in a running asyncio loop.

    Args:
        state: the page's, whose `series_offered` has what can be chosen while the question stands.
    """

    def __init__(self, state: Any) -> None:
        self._state = state
        self._answer: asyncio.Future[str] | None = None
        self._offer(())

    async def ask(self, lines: Sequence[str]) -> str:
        """Have the page offer lines; returns the chosen one, or "" where none was."""
        self._answer = asyncio.get_running_loop().create_future()
        self._offer(lines)
        return await self._answer

    def answer(self, line: str) -> None:
        """The user chose one of the lines, or, by "", none. Anything else is passed over."""
        if self._answer is None or line not in ("", *self._state.series_offered):
            return
        if not self._answer.done():
            self._answer.set_result(line)
        self._answer = None
        self._offer(())

    def _offer(self, lines: Sequence[str]) -> None:
        with self._state as state:
            state.series_offered = list(lines)
