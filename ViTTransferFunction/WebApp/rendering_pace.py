"""The 3D view's pace: casting rays takes long where the processor does it, and the answer to a click comes first."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import slicer
from trame_slicer.rca_view import RemoteThreeDViewFactory
from trame_slicer.views import ScheduledRenderStrategy

PICTURES_PER_S = 30.0
"""At most, in the view that the mouse is in."""
PICTURES_PER_S_ELSEWHERE = 15.0

STILL_QUALITY = 90
"""Of the JPEG pictures, in per cent. It is the scheduler's own for what stands still: where both are equal, it draws once."""
SOFTWARE_PIXELS = 40_000
"""Drawn by a processor, at most; the browser enlarges the picture."""
SOFTWARE_NAMES = ("llvmpipe", "softpipe", "swiftshader", "software rasterizer")
STEP_S, REST_S, LONGEST_WAIT_S = 0.02, 0.12, 1.0
"""How often it is asked whether the view may be drawn, how long nothing must have changed for that, and when it is all the same."""


class AfterClicks(ScheduledRenderStrategy):
    """Draws a view once nothing more urgent is under way, and its changes have come to rest; at once where the mouse is in it.

    Args:
        scheduler: of the view's pictures, at `PICTURES_PER_S` while the mouse is in the view.
        is_urgent: whether the user waits for something else.
    """

    def __init__(self, scheduler: Any, is_urgent: Callable[[], bool]) -> None:
        super().__init__()
        self._scheduler = scheduler
        self._is_urgent = is_urgent
        self._rest_s = 0.0
        self._waiting: asyncio.Task[None] | None = None

    def schedule_render(self) -> None:
        """Have the view drawn soon."""
        super().schedule_render()
        self._rest_s = 0.0
        if self._waiting is None:
            self._waiting = asyncio.create_task(self._draw())

    async def _draw(self) -> None:
        for _ in range(round(LONGEST_WAIT_S / STEP_S)):
            # At least once, so that the slice views go first.
            await asyncio.sleep(STEP_S)
            self._rest_s += STEP_S
            if self._is_entered() or (self._rest_s >= REST_S and not self._is_urgent()):
                break
        self._waiting = None
        self._scheduler.schedule_render()

    def _is_entered(self) -> bool:
        return bool(self._scheduler.target_fps >= PICTURES_PER_S)


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
    view = created.slicer_view
    view.render_window().Render()
    if any(name in view.render_window().ReportCapabilities().lower() for name in SOFTWARE_NAMES):
        created.view_adapter.max_pixel_count = SOFTWARE_PIXELS
        view.render_window().SetMultiSamples(0)
        view.renderer().SetUseDepthPeelingForVolumes(False)
        # With a third of the steps; of our surfaces, the pictures are the same.
        view.get_view_node().SetVolumeRenderingQuality(slicer.vtkMRMLViewNode.Adaptive)
