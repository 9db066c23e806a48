"""The process that computes: reads requests from its standard input, and answers on its standard output.

Requests are served one after the other, by `segmentation_service`. While one is being served, only "cancel" is heard, and
while features are extracted also "maps", which coarser features can answer.
"""

from __future__ import annotations

import collections
import os
import sys
import threading
from typing import BinaryIO

from ..core.errors import Cancelled, InputError
from .messages import Message, read_message, write_message
from .service import SegmentationService


def main() -> None:
    """Serve until the input ends, as it does when the parent process ends, however it ends."""
    replies = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    # What libraries print must not end up between the replies.
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    ComputeProcess(sys.stdin.buffer, replies).serve()


class ComputeProcess:
    """Requests in, replies out.

    Args:
        requests: stream of messages with "request", their number, and "what", a method of `SegmentationService`.
        replies: stream that gets, for each request, any number of messages whose "reply" is "progress" and whose "what" is the
            work in words, or "coarse" where results can be had of what is there so far; then one whose "reply" is "done",
            "cancelled", or "failed" (with a "message" for the user).
    """

    def __init__(self, requests: BinaryIO, replies: BinaryIO) -> None:
        self._requests = requests
        self._replies = replies
        self._waiting: collections.deque[Message] = collections.deque()
        self._arrived = threading.Semaphore(0)
        self._cancelled: set[int] = set()
        self._serving = 0
        self._service = SegmentationService(self._progress, on_coarse=lambda: self._reply("coarse", "extract", Message({})))

    def serve(self) -> None:
        """Answer requests until they end."""
        threading.Thread(target=self._listen, daemon=True).start()
        while True:
            self._arrived.acquire()
            # It may have been served meanwhile, while another one was.
            if self._waiting:
                self._serve(self._waiting.popleft())

    def _serve(self, message: Message) -> None:
        content = dict(message.content)
        outer, self._serving, what = self._serving, content.pop("request"), content.pop("what")
        try:
            if self._serving in self._cancelled:
                raise Cancelled
            self._reply("done", what, getattr(self._service, what)(*message.arrays, **content))
        except Cancelled:
            self._reply("cancelled", what, Message({}))
        except InputError as error:
            self._reply("failed", what, Message({"message": str(error)}))
        self._serving = outer

    def _listen(self) -> None:
        while (message := read_message(self._requests)) is not None:
            if message.content["what"] == "cancel":
                self._cancelled |= set(message.content["requests"])
            else:
                self._waiting.append(message)
                self._arrived.release()
        # Nobody is left to compute for, not even what is being computed.
        os._exit(0)

    def _progress(self, done: int, total: int, what: str) -> None:
        if self._serving in self._cancelled:
            raise Cancelled
        self._reply("progress", what, Message({"done": done, "total": total}))
        # Clicks are answered from coarse features while the fine ones are computed.
        while self._service.answers_meanwhile and self._waiting and self._waiting[0].content["what"] == "maps":
            self._serve(self._waiting.popleft())

    def _reply(self, kind: str, what: str, message: Message) -> None:
        content = {"request": self._serving, "reply": kind, "what": what, **message.content}
        write_message(self._replies, Message(content, message.arrays))
