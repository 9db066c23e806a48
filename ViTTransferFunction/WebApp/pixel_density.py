"""How dense pixels are on the screen that shows a view: what VTK draws in points, texts above all, has its size there."""

from __future__ import annotations

from typing import Any

from vtkmodules.vtkCommonCore import vtkCommand

from ..Logic.scene.tools.drawn_outline import POINTS_PER_INCH


def follow_density(view: Any, adapter: Any) -> None:
    """Have a view's window know how dense its pixels are, from now on whenever the page tells of its size.

    Args:
        view: trame-slicer's.
        adapter: gets the size from the page, and has a `scale_factor`: pixels of the view's per pixel of the page's.
    """
    window = view.render_window()
    window.AddObserver(
        vtkCommand.WindowResizeEvent, lambda caller, event: caller.SetDPI(round(POINTS_PER_INCH * adapter.scale_factor))
    )
