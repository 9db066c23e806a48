"""The process that computes: reads requests from its standard input, and answers on its standard output.

Requests are served one after the other, by `service`. While one is being served, only `Cancel` is heard, and while features
are extracted also `ComputeMaps`, which coarser features can answer.
"""

from __future__ import annotations

import collections
import os
import sys
import threading
from typing import Any, BinaryIO

from ..core.errors import Cancelled, InputError
from .codec import from_message, holds, to_message
from .messages import Message, read_message, write_message
from .requests import Cancel, CoarseFeatures, ComputeMaps, Failed, GivenUp, Progressed
from .service import SegmentationService


def main() -> None:
    """Serve until the input ends, as it does when the parent process ends, however it ends."""
    replies = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    # What libraries print must not end up between the replies.
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    Server(sys.stdin.buffer, replies).serve()


class Server:
    """Requests in, replies out.

    Args:
        requests: stream of messages, each a request of `requests`.
        replies: stream that gets, for each request, any number of `Progressed` and `CoarseFeatures`, then the request's own
            reply, `GivenUp` or `Failed`.
    """

    def __init__(self, requests: BinaryIO, replies: BinaryIO) -> None:
        self._requests = requests
        self._replies = replies
        self._waiting: collections.deque[Message] = collections.deque()
        self._arrived = threading.Semaphore(0)
        self._cancelled: set[int] = set()
        self._serving = 0
        self._service = SegmentationService(self._progress, on_coarse=lambda: self._reply(CoarseFeatures()))

    def serve(self) -> None:
        """Answer requests until they end."""
        threading.Thread(target=self._listen, daemon=True).start()
        while True:
            self._arrived.acquire()
            # It may have been served meanwhile, while another one was.
            if self._waiting:
                self._serve(self._waiting.popleft())

    def _serve(self, message: Message) -> None:
        outer, self._serving = self._serving, message.content["number"]
        try:
            if self._serving in self._cancelled:
                raise Cancelled
            _, request = from_message(message)
            self._reply(self._service.serve(request))
        except Cancelled:
            self._reply(GivenUp())
        except InputError as error:
            self._reply(Failed(str(error)))
        self._serving = outer

    def _listen(self) -> None:
        while (message := read_message(self._requests)) is not None:
            if holds(message, Cancel):
                _, cancel = from_message(message)
                self._cancelled |= set(cancel.numbers)
            else:
                self._waiting.append(message)
                self._arrived.release()
        # Nobody is left to compute for, not even what is being computed.
        os._exit(0)

    def _progress(self, done: int, total: int, what: str) -> None:
        if self._serving in self._cancelled:
            raise Cancelled
        self._reply(Progressed(done, total, what))
        # Clicks are answered from coarse features while the fine ones are computed.
        while self._service.answers_meanwhile and self._waiting and holds(self._waiting[0], ComputeMaps):
            self._serve(self._waiting.popleft())

    def _reply(self, reply: Any) -> None:
        write_message(self._replies, to_message(self._serving, reply))
