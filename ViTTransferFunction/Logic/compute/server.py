"""The process that computes: reads requests from its standard input, and answers on its standard output.

Requests are served one after the other, by `service`, but for maps, which answer clicks: those are computed at once, beside
whatever else is.
"""

from __future__ import annotations

import faulthandler
import io
import os
import queue
import sys
import threading
import traceback
from collections.abc import Callable
from contextlib import redirect_stderr, suppress
from pathlib import Path
from typing import Any, BinaryIO

from ..core.system.errors import Cancelled, InputError
from ..core.system.out_of_memory import OUT_OF_MEMORY, is_out_of_memory
from .array_files import ArrayFiles
from .codec import from_message, holds, to_message
from .messages import ArraysNotWritten, Message, read_message, write_message
from .requests import Cancel, CoarseFeatures, ComputeMaps, Failed, FirstMap, GivenUp, Progressed, Started
from .service import SegmentationService

LOCK_TURN_S = 0.0005
"""After how long a thread that wants Python's lock gets it from one that computes: the answer to a click asks for it a hundred
times, and Python's own 5 ms would be most of what it takes. On Windows, Python counts whole milliseconds: such a thread asks at
once, and again and again until it has the lock."""
LOWER_PRIORITY = 10
"""What takes long leaves the processor to the answers to clicks, and to the window."""


def main(folder: str) -> None:
    """Serve until the input ends, as it does when the parent process ends, however it ends.

    Args:
        folder: where arrays lie that come and go.
    """
    # A library that stops the process, as by SIGABRT, says little or nothing by itself.
    faulthandler.enable()
    sys.setswitchinterval(LOCK_TURN_S)
    replies = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    # What libraries print must not end up between the replies.
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    Server(sys.stdin.buffer, replies, ArrayFiles(Path(folder))).serve()


class Server:
    """Requests in, replies out.

    Args:
        requests: stream of messages, each a request of `requests`.
        replies: stream that gets `Started`; then, for each request but `Cancel`, any number of `UNFINISHED` replies, and then
            the request's own reply, `GivenUp` or `Failed`.
        files: hands over the arrays of both.
    """

    def __init__(self, requests: BinaryIO, replies: BinaryIO, files: ArrayFiles) -> None:
        self._requests = requests
        self._replies = replies
        self._files = files
        self._replying = threading.Lock()
        # None: to prepare for clicks.
        self._clicks: queue.Queue[Message | None] = queue.Queue()
        self._others: queue.Queue[Message | None] = queue.Queue()
        self._cancelled: set[int] = set()
        self._serving = self._answering = 0
        self._told: tuple[int, Progressed] | None = None
        self._service = SegmentationService(
            self._progress,
            on_coarse=lambda: self._reply(self._serving, CoarseFeatures()),
            between_points=self._end_if_overtaken,
            on_preparable=lambda: self._clicks.put(None),
            on_first_map=lambda first: self._reply(self._answering, FirstMap(first)),
        )

    def serve(self) -> None:
        """Answer requests until they end."""
        self._reply(0, Started(os.getpid()))
        # Threads that start later have this one's priority.
        for work in (self._listen, self._answer_clicks):
            threading.Thread(target=_fatal_if_it_fails, args=(work,), daemon=True).start()
        _fatal_if_it_fails(self._answer_others)

    def _listen(self) -> None:
        while (message := read_message(self._requests, self._files)) is not None:
            if holds(message, Cancel):
                _, cancel = from_message(message)
                self._cancelled |= set(cancel.numbers)
            else:
                (self._clicks if holds(message, ComputeMaps) else self._others).put(message)
        self._leave()

    def _leave(self) -> None:
        """Nobody is left to compute for, not even what is being computed; and maybe nobody to tidy up."""
        self._files.remove_folder()
        os._exit(0)

    def _answer_clicks(self) -> None:
        _import_torch()
        self._answer(self._clicks)

    def _answer_others(self) -> None:
        _lower_priority()
        self._answer(self._others)

    def _answer(self, messages: queue.Queue[Message | None]) -> None:
        while True:
            message = messages.get()
            if message is None:
                self._service.prepare_clicks()
                continue
            number = message.content.get("number", 0)
            if messages is self._others:
                self._serving = number
            else:
                self._answering = number
            self._reply(number, self._reply_to(message, number))

    def _reply_to(self, message: Message, number: int) -> Any:
        try:
            if number in self._cancelled:
                raise Cancelled
            _, request = from_message(message)
            return self._service.serve(request)
        except Cancelled:
            return GivenUp()
        except InputError as error:
            return Failed(str(error))
        except Exception as error:
            if number in self._cancelled:
                return GivenUp()  # It may have been begun late, when another volume was already being opened.
            if not is_out_of_memory(error):
                raise
            return Failed(OUT_OF_MEMORY)

    def _end_if_overtaken(self) -> None:
        if self._answering in self._cancelled:
            raise Cancelled

    def _progress(self, done: int, total: int, what: str) -> None:
        if self._serving in self._cancelled:
            raise Cancelled
        progress = Progressed(done, total, what)
        # It is called more often than there is something to tell, so that what was cancelled ends soon.
        if (self._serving, progress) != self._told:
            self._told = self._serving, progress
            self._reply(self._serving, progress)

    def _reply(self, number: int, reply: Any) -> None:
        with self._replying:
            try:
                write_message(self._replies, to_message(number, reply), self._files)
            except ArraysNotWritten as error:
                failed = Failed(
                    f"The result could not be handed over: {error}. Free some space on the disk with the temporary files, and "
                    "try again."
                )
                write_message(self._replies, to_message(number, failed), self._files)
            except OSError:  # Nobody reads any more: a broken pipe, or in Windows' words an invalid argument.
                self._leave()


def _fatal_if_it_fails(work: Callable[[], None]) -> None:
    """Whatever thread fails, the process ends, and its last words are why: it must not go on with half of itself."""
    try:
        work()
    except BaseException:
        # Also where the reason cannot be written, on a full disk say.
        try:
            errors = sys.__stderr__ or sys.stderr
            traceback.print_exc(file=errors)
            errors.flush()
        finally:
            os._exit(1)


def _import_torch() -> None:
    """Takes a second or two, in which the volume may be handed over, or still be chosen.

    The calling thread keeps the number of PyTorch's threads that there is before others work with fewer (`UndividedThreads`).
    """
    # Where it fails, who needs it says so. What it says of another NumPy than its own is not why the process dies one day.
    with suppress(Exception), redirect_stderr(io.StringIO()):
        import torch

        torch.get_num_threads()


def _lower_priority() -> None:
    """Of the calling thread and those that it starts; only Linux has priorities by thread, and lets anybody lower them."""
    if sys.platform == "linux":
        thread = threading.get_native_id()
        # Whoever started it may have given it an even lower one, and few may raise that.
        os.setpriority(os.PRIO_PROCESS, thread, max(LOWER_PRIORITY, os.getpriority(os.PRIO_PROCESS, thread)))
