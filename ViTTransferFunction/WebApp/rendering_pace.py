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
STEP_S, LONGEST_WAIT_S = 0.02, 5.0
"""How often it is asked whether nothing more urgent is under way, and after how long it does not matter any more."""


class AfterClicks(ScheduledRenderStrategy):
    """Draws a view at once while the mouse is in it, and else when `settle` says so and nothing more urgent is under way.

    Slicer has the 3D view drawn with every move of the mouse in a slice view, of a point that is about to be placed, say.

    Args:
        scheduler: of the view's pictures, at `PICTURES_PER_S` while the mouse is in the view.
        is_urgent: whether the user waits for something else.
    """

    def __init__(self, scheduler: Any, is_urgent: Callable[[], bool]) -> None:
        super().__init__()
        self._scheduler = scheduler
        self._is_urgent = is_urgent
        self._stale = False
        self._waiting: asyncio.Task[None] | None = None

    def schedule_render(self) -> None:
        """The view has changed."""
        super().schedule_render()
        self._stale = True
        if self._is_entered():
            self._draw()

    def settle(self) -> None:
        """Have the view drawn soon, if it has changed."""
        if self._stale and self._waiting is None:
            self._waiting = asyncio.create_task(self._wait())

    async def _wait(self) -> None:
        for _ in range(round(LONGEST_WAIT_S / STEP_S)):
            # At least once, so that the slice views go first.
            await asyncio.sleep(STEP_S)
            if not self._is_urgent():
                break
        self._waiting = None
        self._draw()

    def _draw(self) -> None:
        self._stale = False
        self._scheduler.schedule_render()

    def _is_entered(self) -> bool:
        return bool(self._scheduler.target_fps >= PICTURES_PER_S)


class PatientThreeDViewFactory(RemoteThreeDViewFactory):
    """Makes 3D views that wait for what is more urgent.

    Args:
        server: trame's.
        is_urgent: whether something is.
        options: see `RemoteViewFactory`.

    Attributes:
        strategies: of the views that were made.
    """

    def __init__(self, server: Any, is_urgent: Callable[[], bool], **options: Any) -> None:
        super().__init__(server, interactive_quality=STILL_QUALITY, **options)
        self._is_urgent = is_urgent
        self.strategies: list[AfterClicks] = []

    def _create_view(self, view: Any, scene: Any, app_logic: Any) -> Any:
        created = super()._create_view(view, scene, app_logic)
        self.strategies.append(AfterClicks(created.view_adapter, self._is_urgent))
        created.slicer_view.set_scheduled_render(self.strategies[-1])
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
