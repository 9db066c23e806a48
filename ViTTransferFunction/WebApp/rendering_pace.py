"""The 3D view's pace: casting rays takes long where the processor does it, and the answer to a click comes first."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from trame_slicer.rca_view import RemoteThreeDViewFactory
from trame_slicer.views import ScheduledRenderStrategy

STILL_QUALITY = 90
"""Of the JPEG pictures, in per cent. It is the scheduler's own for what stands still: where both are equal, it draws once."""
SOFTWARE_PIXELS = 60_000
"""Drawn by a processor, at most; the browser enlarges the picture. On two cores, each such picture takes about 0.1 s."""
SOFTWARE_NAMES = ("llvmpipe", "softpipe", "swiftshader", "software rasterizer")
WAIT_STEP_S, LONGEST_WAIT_S = 0.02, 1.0


class AfterClicks(ScheduledRenderStrategy):
    """Draws a view once nothing more urgent is under way.

    Args:
        scheduler: of the view's pictures.
        is_urgent: whether something is.
    """

    def __init__(self, scheduler: Any, is_urgent: Callable[[], bool]) -> None:
        super().__init__()
        self._scheduler = scheduler
        self._is_urgent = is_urgent
        self._waiting: asyncio.Task[None] | None = None

    def schedule_render(self) -> None:
        """Have the view drawn soon."""
        super().schedule_render()
        if self._waiting is None:
            self._waiting = asyncio.create_task(self._draw())

    async def _draw(self) -> None:
        # At least once, so that the slice views go first.
        for _ in range(round(LONGEST_WAIT_S / WAIT_STEP_S)):
            await asyncio.sleep(WAIT_STEP_S)
            if not self._is_urgent():
                break
        self._waiting = None
        self._scheduler.schedule_render()


class PatientThreeDViewFactory(RemoteThreeDViewFactory):
    """Makes 3D views that wait for what is more urgent.

    Args:
        server: trame's.
        is_urgent: whether something is.
        options: see `RemoteViewFactory`.
    """

    def __init__(self, server: Any, is_urgent: Callable[[], bool], **options: Any) -> None:
        super().__init__(server, interactive_quality=STILL_QUALITY, **options)
        self._is_urgent = is_urgent

    def _create_view(self, view: Any, scene: Any, app_logic: Any) -> Any:
        created = super()._create_view(view, scene, app_logic)
        created.slicer_view.set_scheduled_render(AfterClicks(created.view_adapter, self._is_urgent))
        _spare_the_processor(created)
        return created


def _spare_the_processor(created: Any) -> None:
    """Draw less where no graphics card does it."""
    window = created.slicer_view.render_window()
    window.Render()
    if any(name in window.ReportCapabilities().lower() for name in SOFTWARE_NAMES):
        created.view_adapter.max_pixel_count = SOFTWARE_PIXELS
        window.SetMultiSamples(0)
        created.slicer_view.renderer().SetUseDepthPeelingForVolumes(False)
