"""A view's last picture is sent again, since the page may have dropped it.

The page decodes four pictures of a view at a time, and drops what comes meanwhile: on a busy computer, a view would go on
showing a slice that was left long ago, or nothing, until something else has it drawn.
"""

from __future__ import annotations

import asyncio
from typing import Any

AGAIN_AFTER_S = (0.5, 2.0, 5.0)
"""Pauses in which no newer picture came: by the last one, the page of a very busy computer has decoded those before."""


class LastPictureAgain:
    """A streamer of trame-rca's whose last picture is sent again.

    Args:
        streamer: sends pictures.
    """

    def __init__(self, streamer: Any) -> None:
        self._streamer = streamer
        self._again: asyncio.Task[None] | None = None

    def push_content(self, area_name: str, metadata: dict[str, Any], content: bytes) -> None:
        """Send a picture of a view, and unless another one follows, send it again."""
        if self._again is not None:
            self._again.cancel()
        self._streamer.push_content(area_name, metadata, content)
        self._again = asyncio.get_running_loop().create_task(self._send_again(area_name, metadata, content))

    async def _send_again(self, area_name: str, metadata: dict[str, Any], content: bytes) -> None:
        # The picture as it was sent, since to draw it anew may take a processor as long as all that comes before it.
        for pause in AGAIN_AFTER_S:
            await asyncio.sleep(pause)
            self._streamer.push_content(area_name, metadata, content)


def send_last_again(adapter: Any) -> None:
    """Have a view's adapter send its last picture again, whoever it gets as its streamer."""
    set_streamer = adapter.set_streamer
    adapter.set_streamer = lambda streamer: set_streamer(streamer and LastPictureAgain(streamer))
