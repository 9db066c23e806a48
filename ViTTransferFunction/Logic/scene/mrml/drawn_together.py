"""Changes of several nodes, drawn by the views in one picture."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import slicer


@contextmanager
def drawn_together(app_logic: slicer.vtkMRMLApplicationLogic) -> Iterator[None]:
    """Have views drawn after what is changed meanwhile, and not in the midst of it.

    Slicer draws a view a sixtieth of a second after its first change, by a timer. Where that has not come to it by then, the
    next change has the view drawn at once: new colours on the old map, say, which also delays what is waited for.

    Args:
        app_logic: the application's logic, whose views these are.
    """
    app_logic.PauseRender()
    try:
        yield
    finally:
        app_logic.ResumeRender()
