"""Slicer's views, and the order in which they are drawn."""

from __future__ import annotations

from typing import Any

import qt
import slicer
import vtk

from ViTTransferFunction.Logic.scene.mrml.software_drawing import draws_in_software
from ViTTransferFunction.Logic.scene.tools.points_in_3d import MARKUPS_MANAGER
from ViTTransferFunction.Logic.scene.views.awaited_answer import Waiting

SLOW_S = 0.02
"""3D views whose last picture took longer wait; with a graphics card, none does."""
LONGEST_WAIT_MS, LONGEST_WAIT_3D_MS = 100, 500
"""After how long slice and 3D views are drawn all the same: about as late as is felt; and so that they are seen to follow."""
SLICES_FIRST_MS = 20
"""How long 3D views wait for the drawing of slices, which begins within a sixtieth of a second."""


def view_windows() -> list[Any]:
    """The vtkRenderWindows of the 3D views that are shown."""
    return [widget.threeDView().renderWindow() for widget in _widgets_3d() if widget.visible]


def points_of_3d_views() -> list[Any]:
    """What shows and moves points in the 3D views, of each that does, shown or not."""
    managers = (widget.threeDView().displayableManagerByClassName(MARKUPS_MANAGER) for widget in _widgets_3d())
    return [manager for manager in managers if manager is not None]


def tell_of_resting_mouse() -> None:
    """Have the view that the mouse is in hear of it, as if it had just come there.

    Slicer places a point where the mouse has been moved since it began to place points. Who takes a tool by its key, with the
    mouse on the structure already, may click without another move.
    """
    for view in (*_slice_views(), *_views_3d()):
        if view.underMouse():
            view.interactor().InvokeEvent(vtk.vtkCommand.MouseMoveEvent)


class DrawingOrder:
    """All views are drawn in one thread: slices when the answer to a click is there, and 3D views after them.

    Otherwise the point that was placed would be drawn in all views before the answer is taken in, and again with what follows
    from it; and where the same processor draws and computes, the answer itself would come later.
    """

    def __init__(self) -> None:
        self._told: Waiting = "none"
        self._slices = _WaitingViews(LONGEST_WAIT_MS)
        self._views_3d = _WaitingViews(LONGEST_WAIT_3D_MS)
        self._soon = qt.QTimer()
        self._soon.interval = SLICES_FIRST_MS
        self._soon.timeout.connect(self._draw_3d)

    def have_wait(self, which: Waiting) -> None:
        """Have views wait from now on, if drawing them takes its time; those that are not meant are drawn, slices first."""
        before, self._told = self._told, which
        if which != "all":
            self._slices.draw_at_once()
        elif before != "all":
            self._slices.begin(_slices_that_can_wait())
        if which != "none":
            self._soon.stop()
            self._views_3d.begin(_views_3d_that_can_wait())
        elif self._views_3d.wait and not self._soon.active:
            self._soon.start()

    def draw(self) -> None:
        """Have all views drawn that wait, if they have changed."""
        self._told = "none"
        self._slices.draw()
        self._draw_3d()

    def _draw_3d(self) -> None:
        self._soon.stop()
        self._views_3d.draw()


class _WaitingViews:
    """Views that are not drawn for the moment.

    Args:
        longest_ms: after which they are drawn.
    """

    def __init__(self, longest_ms: int) -> None:
        self._views: list[Any] = []
        self._timer = qt.QTimer()
        self._timer.interval = longest_ms
        self._timer.timeout.connect(self.draw)

    @property
    def wait(self) -> bool:
        """Whether there are some."""
        return bool(self._views)

    def begin(self, views: list[Any]) -> None:
        """Have these wait, unless some do."""
        if views and not self._views:
            self._views = views
            for view in views:
                view.pauseRender()
            self._timer.start()

    def draw(self) -> None:
        """Have them drawn, if they have changed."""
        for view in self._end():
            view.resumeRender()

    def draw_at_once(self) -> None:
        """Have them drawn, changed or not: `resumeRender` may forget what was to be drawn right before."""
        for view in self._end():
            view.forceRender()
            view.resumeRender()

    def _end(self) -> list[Any]:
        """Those that waited, first the one that the mouse is in; one that is not there any more has gone with its layout."""
        self._timer.stop()
        waited, self._views = self._views, []
        present = [view for view in (*_slice_views(), *_views_3d()) if view in waited]
        return sorted(present, key=lambda view: not view.underMouse())


def _slices_that_can_wait() -> list[Any]:
    """All, where a processor draws them; none while the mouse drags something."""
    views = _slice_views()
    in_software = any(draws_in_software(view.renderWindow()) for view in views)
    return views if in_software and qt.QApplication.mouseButtons() == qt.Qt.NoButton else []


def _views_3d_that_can_wait() -> list[Any]:
    """Those whose last picture took long, but for one that the mouse is in: the user is turning it."""
    return [view for view in _views_3d() if _is_slow(view) and not view.underMouse()]


def _is_slow(view: Any) -> bool:
    return any(renderer.GetLastRenderTimeInSeconds() > SLOW_S for renderer in view.renderWindow().GetRenderers())


def _slice_views() -> list[Any]:
    manager = slicer.app.layoutManager()
    return [manager.sliceWidget(name).sliceView() for name in manager.sliceViewNames()] if manager else []


def _views_3d() -> list[Any]:
    return [widget.threeDView() for widget in _widgets_3d()]


def _widgets_3d() -> list[Any]:
    manager = slicer.app.layoutManager()
    widgets = [manager.threeDWidget(index) for index in range(manager.threeDViewCount)] if manager else []
    return [widget for widget in widgets if widget is not None]
