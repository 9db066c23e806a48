"""Dragging in a slice view changes the window in which slices show the volume, as Slicer's mouse mode *Window level* does."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from vtkmodules.vtkCommonCore import vtkCommand

from ..Logic.core.system.errors import InputError
from ..Logic.scene.mrml.nodes import nodes_of_class
from ..Logic.scene.tools.view_mouse import PRESSES, ViewMouse
from ..Logic.scene.volumes.volume_window import set_window

NARROWEST = 0.001
"""Window that dragging leads to, as a share of the volume's range of intensities: a narrower one shows nothing but noise."""


class WindowDrag:
    """Listens to the left button in one slice view while active.

    To the right, the window gets wider; upwards, its middle moves to brighter intensities. The shorter side of the view is
    worth the whole range of the volume's intensities, as in Slicer.

    Args:
        interactor: of the view's render window.
        volume: the volume node that is shown, or None.
        is_free: whether the left button means nothing else now where the mouse is. With Ctrl, it never does.
        on_window: called after the window was changed.
    """

    def __init__(
        self,
        interactor: Any,
        volume: Callable[[], Any],
        is_free: Callable[[], bool],
        on_window: Callable[[], None],
    ) -> None:
        self._interactor = interactor
        self._mouse = ViewMouse(interactor)
        self._volume = volume
        self._is_free = is_free
        self._on_window = on_window
        self._last: tuple[float, float] | None = None

    def activate(self) -> None:
        """Begin to listen to the mouse."""
        self._mouse.listen({
            **dict.fromkeys(PRESSES, self._press),
            vtkCommand.MouseMoveEvent: self._move,
            vtkCommand.LeftButtonReleaseEvent: self._release,
            vtkCommand.LeaveEvent: self._leave,
        })  # fmt: skip

    def deactivate(self) -> None:
        """Leave the mouse to the view."""
        self._mouse.stop()
        self._last = None

    def _press(self) -> bool:
        keys = self._mouse.modifiers
        takes_it = _scalars(self._volume()) is not None and (keys == {"Ctrl"} or (not keys and self._is_free()))
        self._last = self._mouse.position if takes_it else None
        return takes_it

    def _move(self) -> bool:
        if self._last is None:
            return False
        (x, y), (last_x, last_y) = self._mouse.position, self._last
        self._last = x, y
        shorter_side = max(1, min(self._interactor.GetRenderWindow().GetSize()))
        self._change((x - last_x) / shorter_side, (y - last_y) / shorter_side)
        return True

    def _release(self) -> bool:
        dragging, self._last = self._last is not None, None
        return dragging

    def _leave(self) -> bool:
        """No button is held any more: whoever held it may have lost the page."""
        self._last = None
        return False

    def _change(self, wider: float, brighter: float) -> None:
        """Change width and middle of the window, both by shares of the volume's range."""
        volume = self._volume()
        scalars = _scalars(volume)
        if scalars is None:
            return
        display = volume.GetScalarVolumeDisplayNode()
        minimum, maximum = scalars.GetFiniteRange()
        span = maximum - minimum
        before = display.GetWindow()
        width = max(before + wider * span, min(NARROWEST * span, before))
        middle = min(max(display.GetLevel() + brighter * span, minimum - width / 2), maximum + width / 2)
        # Where all voxels are alike, there may be no window to begin with.
        with suppress(InputError):
            set_window(volume, middle - width / 2, middle + width / 2)
            self._on_window()


def is_on_markup(scene: Any) -> bool:
    """Whether the mouse is on a point, or on a handle, which the left button would drag."""
    return any(display.HasActiveComponent() for display in nodes_of_class(scene, "vtkMRMLMarkupsDisplayNode"))


def _scalars(volume: Any) -> Any:
    """The voxels of a volume node that is shown in a window; None where there are none."""
    if volume is None or volume.GetImageData() is None or volume.GetScalarVolumeDisplayNode() is None:
        return None
    return volume.GetImageData().GetPointData().GetScalars()
