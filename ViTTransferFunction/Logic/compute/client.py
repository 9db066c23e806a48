"""The compute process, seen from the program that started it: requests go there, replies come back, and nothing ever waits.

PyTorch lives in a process of its own. Importing it, or one long operation, would freeze a window for as long as it holds
Python's global lock; its OpenMP would meet the host program's; and running out of memory would take the user's unsaved work
along.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from .array_files import ArrayFiles
from .codec import from_message, to_message
from .messages import ArraysNotWritten, Message, message_of, read_line, write_message
from .process import ComputeProcess
from .requests import Cancel, Started

NO_ROOM = "no room in the folder for temporary files"
"""How `last_words` begin where the arrays of a request could not be handed over."""
_PATIENCE_S = 2.0
_TURN_S = 0.001
"""How long `replies` leaves Python's lock to the threads, where nothing has come yet.

The event loop of Slicer holds the lock also while it idles: threads get on only while this program waits for something else.
"""
_WRITING_S, _READING_S = 0.002, 0.01
"""How long `request` and `replies` leave it to them at most, while a message is on its way: most are there much sooner."""


class ComputeClient:
    """Starts the compute process, and talks to it.

    Args:
        python_executable: the Python that has PyTorch; the running one unless given.

    Raises:
        InputError: the process cannot be started.
    """

    def __init__(self, python_executable: str | Path | None = None) -> None:
        self._process = ComputeProcess(python_executable)
        self._files = ArrayFiles(self._process.folder)
        self._trouble = ""
        self._unreadable = False
        self._last_request = 0
        self._outgoing: queue.Queue[Message | None] = queue.Queue()
        self._incoming: queue.Queue[Message] = queue.Queue()
        self._all_written, self._reading = threading.Event(), threading.Event()
        self._writer, self._reader = (threading.Thread(target=work, daemon=True) for work in (self._write, self._read))
        self._writer.start()
        self._reader.start()

    @property
    def pid(self) -> int:
        """The process's number."""
        return self._process.pid

    def request(self, request: Any) -> int:
        """Ask for something (`requests`); returns the request's number at once. Its arrays must not change until the reply."""
        self._last_request += 1
        self._all_written.clear()
        self._outgoing.put(to_message(self._last_request, request))
        self._all_written.wait(_WRITING_S)
        return self._last_request

    def cancel(self, numbers: Iterable[int]) -> None:
        """Give up the requests of these numbers. Each is still replied to: by `GivenUp`, if it was stopped in time."""
        self._outgoing.put(to_message(0, Cancel(tuple(numbers))))

    def replies(self) -> list[tuple[int, Any]]:
        """What has come since the last call, oldest first: the number of the request, and the reply (`requests`)."""
        received: list[tuple[int, Any]] = []
        message = self._next()
        while message is not None:
            try:
                number, reply = from_message(message)
            except ValueError as error:
                # Whatever else it says has lost its meaning with this.
                self._unreadable, self._trouble = True, _could_not_be_read(error)
                return received
            if isinstance(reply, Started):
                self._process.own_pid = reply.pid
            else:
                received.append((number, reply))
            message = self._next()
        return received

    def _next(self) -> Message | None:
        message = self._within(_TURN_S)
        if message is None and self._reading.is_set():
            message = self._within(_READING_S)
        return message

    def _within(self, seconds: float) -> Message | None:
        try:
            return self._incoming.get(timeout=seconds)
        except queue.Empty:
            return None

    @property
    def alive(self) -> bool:
        """Whether the process runs and can be talked to, or there is still something that it said."""
        if self._unreadable:
            return False
        # The threads first: what the last one says before it ends is there afterwards.
        return (self._reader.is_alive() and self._writer.is_alive()) or not self._incoming.empty()

    def last_words(self) -> str:
        """Why the process died, if it did, in one line; "" where nobody knows."""
        return self._trouble or self._process.last_words()

    def close(self) -> None:
        """End the process, whatever it is doing."""
        self._outgoing.put(None)
        self._process.end()
        for thread in (self._writer, self._reader):
            thread.join(_PATIENCE_S)
        self._process.clean_up()

    def _write(self) -> None:
        try:
            while (message := self._outgoing.get()) is not None:
                write_message(self._process.requests, message, self._files)  # type: ignore[arg-type]
                if self._outgoing.empty():
                    self._all_written.set()
        except ArraysNotWritten as error:
            self._trouble = f"{NO_ROOM}: {error}"
        except (OSError, ValueError):
            return  # The process is gone, which `alive` tells.

    def _read(self) -> None:
        try:
            while (line := read_line(self._process.replies)) is not None:  # type: ignore[arg-type]
                self._reading.set()
                self._incoming.put(message_of(line, self._files))
                self._reading.clear()
        except (OSError, ValueError, MemoryError) as error:
            self._trouble = _could_not_be_read(error)


def _could_not_be_read(error: Exception) -> str:
    return f"its answer could not be read: {str(error) or type(error).__name__}"
