"""The views' pace: all are drawn in one thread, by a processor often, and the view that the user looks at comes first."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import slicer
from trame_slicer.rca_view import RemoteSliceViewFactory, RemoteThreeDViewFactory
from trame_slicer.views import ScheduledRenderStrategy

from ..Logic.scene.mrml.software_drawing import draws_in_software
from .picture_delivery import send_last_again
from .pixel_density import follow_density
from .sharpness import SharpAtRest

PICTURES_PER_S = 30.0
"""At most, in the view that the mouse is in."""
PICTURES_PER_S_ELSEWHERE = 15.0

QUALITY = 90
"""Of the JPEG pictures, in per cent. It is the schedulers' own for what stands still: where both are equal, they draw once, and
`send_last_again` does for what was lost."""
STEP_S = 0.02
"""How often a view asks whether nothing more urgent is under way; longer than a picture takes to be compressed and sent."""
LONGEST_WAIT_S, LONGEST_WAIT_3D_S = 0.3, 5.0
"""After how long it does not matter any more."""


class EnteredFirst(ScheduledRenderStrategy):
    """Draws a view at once while the mouse is in it, and else when nothing more urgent is under way.

    A point that is placed in one slice view is to be seen in the others as well, but they would delay the answer to the click.

    Args:
        scheduler: of the view's pictures, at `PICTURES_PER_S` while the mouse is in the view.
        is_urgent: whether the user waits for something else.
        longest_wait_s: after how long that does not matter any more.
    """

    def __init__(self, scheduler: Any, is_urgent: Callable[[], bool], longest_wait_s: float = LONGEST_WAIT_S) -> None:
        super().__init__()
        self._scheduler = scheduler
        self._is_urgent = is_urgent
        self._longest_wait_s = longest_wait_s
        self._loop = asyncio.get_running_loop()
        self._stale = False
        self._waiting: asyncio.Task[None] | None = None

    def schedule_render(self) -> None:
        """The view has changed."""
        super().schedule_render()
        self._stale = True
        if self._scheduler.target_fps >= PICTURES_PER_S:
            self.draw()
        else:
            self._on_changed_elsewhere()

    def settle(self) -> None:
        """Have the view drawn soon, if it has changed."""
        # Views outlive the app, since libraries hold on to them.
        if self._stale and self._waiting is None and not self._loop.is_closed():
            self._waiting = self._loop.create_task(self._wait())

    def _on_changed_elsewhere(self) -> None:
        self.settle()

    async def _wait(self) -> None:
        # Also where nothing is urgent, so that the view with the mouse goes first; and once more after something was, since
        # its picture has to be sent.
        was_urgent, waited_s = True, 0.0
        while was_urgent and waited_s < self._longest_wait_s:
            was_urgent = self._is_urgent()
            await asyncio.sleep(STEP_S)
            waited_s += STEP_S
        self._waiting = None
        if self._stale:
            self.draw()

    def draw(self) -> None:
        """Have the view drawn at once."""
        self._stale = False
        self._scheduler.schedule_render()


class AfterClicks(EnteredFirst):
    """For the 3D view: draws elsewhere than at the mouse only when `settle` says so.

    Slicer has the 3D view drawn with every move of the mouse in a slice view, of a point that is about to be placed, say.

    Args:
        scheduler: see `EnteredFirst`.
        is_urgent: see there.
        sharpness: of its pictures; None: they are always sharp.
    """

    def __init__(self, scheduler: Any, is_urgent: Callable[[], bool], sharpness: SharpAtRest | None = None) -> None:
        super().__init__(scheduler, is_urgent, LONGEST_WAIT_3D_S)
        self._sharpness = sharpness

    def schedule_render(self) -> None:
        """The view has changed."""
        if self._sharpness is None or not self._sharpness.drawing:
            super().schedule_render()

    def draw(self) -> None:
        """Have the view drawn at once."""
        if self._sharpness is not None:
            self._sharpness.change()
        super().draw()

    def _on_changed_elsewhere(self) -> None:
        pass


class PatientSliceViewFactory(RemoteSliceViewFactory):
    """Makes slice views that wait for what is more urgent, unless the mouse is in them.

    Args:
        server: trame's.
        is_urgent: whether something is.
        options: see `RemoteViewFactory`.
    """

    def __init__(self, server: Any, is_urgent: Callable[[], bool], **options: Any) -> None:
        super().__init__(server, interactive_quality=QUALITY, **options)
        self._is_urgent = is_urgent

    def _create_view(self, view: Any, scene: Any, app_logic: Any) -> Any:
        created = super()._create_view(view, scene, app_logic)
        created.slicer_view.set_scheduled_render(EnteredFirst(created.view_adapter, self._is_urgent))
        follow_density(created.slicer_view, created.view_adapter)
        send_last_again(created.view_adapter)
        return created


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
        super().__init__(server, interactive_quality=QUALITY, **options)
        self._is_urgent = is_urgent
        self.strategies: list[AfterClicks] = []

    def _create_view(self, view: Any, scene: Any, app_logic: Any) -> Any:
        created = super()._create_view(view, scene, app_logic)
        # As in Slicer. What is translucent would divide a volume's rays, of which structures and surroundings need the whole.
        created.slicer_view.renderer().SetUseDepthPeelingForVolumes(False)
        self.strategies.append(AfterClicks(created.view_adapter, self._is_urgent, self._sharpness(created)))
        created.slicer_view.set_scheduled_render(self.strategies[-1])
        send_last_again(created.view_adapter)
        return created

    def _sharpness(self, created: Any) -> SharpAtRest | None:
        """Draw less where no graphics card does it."""
        view = created.slicer_view
        view.render_window().Render()
        if not draws_in_software(view.render_window()):
            return None
        view.render_window().SetMultiSamples(0)
        # With a third of the steps; of our surfaces, the pictures are the same.
        view.get_view_node().SetVolumeRenderingQuality(slicer.vtkMRMLViewNode.Adaptive)
        return SharpAtRest(view, created.view_adapter, self._is_urgent, QUALITY)
