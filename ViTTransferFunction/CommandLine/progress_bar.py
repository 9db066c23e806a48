"""Progress of the Logic in the terminal: as a bar, or in a log, which nobody watches, as a line for each kind of work."""

from __future__ import annotations

import sys
from types import TracebackType

from tqdm import tqdm


class ProgressBar:
    """A `Progress` callback that draws one tqdm bar for each kind of work; to be used in a `with` statement.

    Where the error stream is no terminal, each kind of work is named once, as it begins.
    """

    def __init__(self) -> None:
        self._bar: tqdm | None = None
        self._named = ""

    def __enter__(self) -> ProgressBar:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._close()

    def __call__(self, done: int, total: int, what: str) -> None:
        """Show that `done` of `total` steps of `what` are done."""
        if sys.stderr.isatty():
            self._draw(done, total, what)
        elif what != self._named:
            self._named = what
            print(f"{what}...", file=sys.stderr, flush=True)

    def _draw(self, done: int, total: int, what: str) -> None:
        if self._bar is None or self._bar.desc != what or self._bar.total != total:
            self._close()
            # Byte counts read better as kB and MB; other work has far fewer steps.
            self._bar = tqdm(total=total, desc=what, unit_scale=total > 100_000, dynamic_ncols=True)
            self._bar.desc = what
        self._bar.update(done - self._bar.n)

    def _close(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None
