"""Standard output and error as they may be: of another code page, closed, a pipe that nobody reads, a full device."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO, cast


class Unfailing:
    """A text stream that takes whatever is written. Once something cannot be delivered, nothing more is.

    Args:
        stream: to write to. None: there is none, as in a program without a console.

    Attributes:
        trouble: why something was not delivered; None where all was.
    """

    def __init__(self, stream: TextIO | None) -> None:
        self._stream = stream if stream is not None else Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115
        self.trouble: OSError | None = None
        # A name that a code page does not have must not cost the work that it is the name of.
        if isinstance(self._stream, io.TextIOWrapper):
            self._stream.reconfigure(errors="backslashreplace")

    def write(self, text: str) -> int:
        """Write, as far as that can be done."""
        if self.trouble is None:
            try:
                self._stream.write(text)
            except OSError as error:
                self._give_up(error)
        return len(text)

    def flush(self) -> None:
        """Flush, as far as that can be done."""
        if self.trouble is None:
            try:
                self._stream.flush()
            except OSError as error:
                self._give_up(error)

    def __getattr__(self, name: str) -> Any:
        """Whatever else the stream has."""
        return getattr(self._stream, name)

    def _give_up(self, error: OSError) -> None:
        self.trouble = error
        # The stream still holds what it could not deliver, and Python would try again on its way out.
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self._stream.fileno())
        os.close(nowhere)


@contextmanager
def unfailing_console() -> Iterator[Unfailing]:
    """Let nothing that is printed end the work; gives the standard output, which knows whether all of it was delivered."""
    _take_standard_descriptors()
    before = sys.stdout, sys.stderr
    output, errors = Unfailing(sys.stdout), Unfailing(sys.stderr)
    sys.stdout, sys.stderr = cast(TextIO, output), cast(TextIO, errors)
    try:
        yield output
    finally:
        output.flush()
        errors.flush()
        sys.stdout, sys.stderr = before


def _take_standard_descriptors() -> None:
    """Where the program was started with a closed stream, the next file to be opened would take its place, and its output."""
    descriptor = os.open(os.devnull, os.O_RDWR)
    while descriptor <= 2:
        descriptor = os.dup(descriptor)
    os.close(descriptor)
