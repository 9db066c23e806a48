"""The mouse in the hands of no tool of Slicer's, for as long as one of ours takes it in the slice views."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import slicer

from ..mrml.observers import SceneObservers


class FreeMouse:
    """Ends what Slicer's own tools do with the mouse, and tells when the user takes one of them up again.

    Slicer's tool bar has such ones: the window of the views, and the placing of markups. Two tools would share each click.

    Args:
        app_logic: the application's logic, which knows the node that decides what the mouse does.
        on_taken: called when the user has taken a tool of Slicer's.
    """

    def __init__(self, app_logic: Any, on_taken: Callable[[], None]) -> None:
        self._interaction = app_logic.GetInteractionNode()
        self._on_taken = on_taken
        self._observers = SceneObservers()

    def start(self) -> None:
        """Have Slicer's tools put down, and watch."""
        if not self._is_free:
            self._interaction.SwitchToViewTransformMode()
        mode_changed = slicer.vtkMRMLInteractionNode.InteractionModeChangedEvent
        self._observers.observe(self._interaction, [(mode_changed, self._on_mode)])

    def stop(self) -> None:
        """Let the user take what they like."""
        self._observers.remove_all()

    @property
    def _is_free(self) -> bool:
        mode: int = self._interaction.GetCurrentInteractionMode()
        return mode == slicer.vtkMRMLInteractionNode.ViewTransform

    def _on_mode(self, caller: Any, event: str) -> None:
        if not self._is_free:
            self._on_taken()
