"""How sharp the 3D view's pictures are where a processor draws them: coarse while something moves, sharp once all rests."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Any

from trame_rca.encoders import RcaImageEncoder

from ..Logic.core.volumes.camera import Size
from ..Logic.scene.views.view_picture import view_picture

COARSE_PIXELS = 40_000
"""Of a picture of the view as it changes, at most; the browser enlarges it."""
SHARP_S = 0.15
"""How long a picture of the view at rest may take, about: nothing else is answered meanwhile."""
WORTH_IT = 1.5
"""How many times as wide a picture has to be to be worth drawing the same again."""
REST_S = 0.5
"""How long nothing was drawn when a view rests; longer than between two steps of a slider that is dragged slowly."""


class SharpAtRest:
    """Keeps a view's pictures coarse, and sends one that is sharp when nothing was drawn for a while.

    The view itself stays as small as its coarse pictures, so that what is dragged in it, and how long it says that it takes,
    never come to be of another size.

    Args:
        view: trame-slicer's, drawn by a processor.
        adapter: sends its pictures.
        is_busy: whether something is under way that a sharp picture would delay.
        quality: of the sharp picture's JPEG, in per cent.

    Attributes:
        drawing: whether a sharp picture is being drawn: the view has another size meanwhile, which is no change.
    """

    def __init__(self, view: Any, adapter: Any, is_busy: Callable[[], bool], quality: int) -> None:
        self._window, self._adapter, self._is_busy, self._quality = view.render_window(), adapter, is_busy, quality
        self._loop = asyncio.get_running_loop()
        self._resting: asyncio.Task[None] | None = None
        self.drawing = False
        adapter.max_pixel_count = COARSE_PIXELS

    def change(self) -> None:
        """The view is about to be drawn anew."""
        # Views outlive the app, since libraries hold on to them.
        if not self._loop.is_closed():
            if self._resting is not None:
                self._resting.cancel()
            self._resting = self._loop.create_task(self._rest())

    async def _rest(self) -> None:
        await asyncio.sleep(REST_S)
        while self._is_busy():
            await asyncio.sleep(REST_S)
        width, height = self._affordable_size()
        if width >= WORTH_IT * self._window.GetSize()[0]:
            picture = self._draw((width, height))
            encode = RcaImageEncoder.JPEG.encode
            content, metadata, _ = await self._loop.run_in_executor(None, encode, picture, height, width, self._quality)
            self._adapter.push(content, metadata)

    def _draw(self, size: Size) -> Any:
        self.drawing = True
        try:
            return view_picture(self._window, size)
        finally:
            self.drawing = False

    def _affordable_size(self) -> Size:
        """Of a picture that takes no longer than it may, by how long the last one took; no larger than it is shown."""
        # VTK has -1 s where nothing was drawn yet.
        seconds = max(renderer.GetLastRenderTimeInSeconds() for renderer in self._window.GetRenderers())
        factor = min(math.sqrt(SHARP_S / max(seconds, 1e-3)), 1.0 / self._adapter.scale_factor)
        width, height = self._window.GetSize()
        return round(factor * width), round(factor * height)
