"""What libraries print while they work: lines of ITK, MetaIO and others around the one sentence that is meant for the user."""

from __future__ import annotations

import io
import logging
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import TextIO

_ERROR_STREAM = 2


@contextmanager
def silenced_libraries(verbose: bool = False) -> Iterator[None]:
    """Let only Python's own `sys.stderr` and the log through to the console, unless `verbose`.

    Libraries in C and C++ write to the process's error stream itself, which leads nowhere meanwhile. Python's warnings are not
    shown either. Errors raised as exceptions lose nothing.
    """
    if verbose:
        yield
        return
    try:
        console = os.dup(_ERROR_STREAM)
    except OSError:  # Started without an error stream: there is nothing to silence.
        yield
        return
    python_stream = sys.stderr
    try:
        with warnings.catch_warnings(), Path(os.devnull).open("w", encoding="utf-8") as nowhere:
            warnings.simplefilter("ignore")
            _flush(python_stream)
            os.dup2(nowhere.fileno(), _ERROR_STREAM)
            if _leads_to_console(python_stream):
                sys.stderr = _text_stream(console, python_stream)
            try:
                yield
            finally:
                _flush(sys.stderr)
                sys.stderr = python_stream
                os.dup2(console, _ERROR_STREAM)
    finally:
        os.close(console)


class CurrentErrorStream(logging.StreamHandler):
    """A log handler that writes to what `sys.stderr` is at the time, in lines of their own above a progress bar."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write one record."""
        self.stream = sys.stderr
        # Not imported for this: where nobody has, there is no bar.
        bars = sys.modules.get("tqdm")
        with bars.tqdm.external_write_mode(file=self.stream) if bars else nullcontext():
            super().emit(record)


def _leads_to_console(stream: TextIO) -> bool:
    """Whether what Python writes would be silenced too; not so where a test, say, has put another stream in its place."""
    try:
        return stream.fileno() == _ERROR_STREAM
    except (AttributeError, OSError, ValueError, io.UnsupportedOperation):
        return False


def _text_stream(descriptor: int, like: TextIO) -> TextIO:
    return open(descriptor, "w", encoding=like.encoding, errors=like.errors, buffering=1, closefd=False)


def _flush(stream: TextIO) -> None:
    # A full or closed console is no reason to lose the exit code.
    with suppress(AttributeError, OSError, ValueError):
        stream.flush()
