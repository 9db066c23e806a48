"""The volume that is taken up where the user has chosen none: the one in the views, or else the only one there is."""

from __future__ import annotations

from typing import Any

import slicer

from ViTTransferFunction.Logic.scene.session import SceneSession


class OfferedVolume:
    """Watches which volumes there are and which one is shown, also after the module was opened.

    Args:
        app_logic: the application's logic, which knows what is shown.

    Attributes:
        wanted: whether a volume may be taken up; not so after the user chose to have none.
    """

    def __init__(self, app_logic: Any) -> None:
        self.wanted = True
        self._selection = app_logic.GetSelectionNode()
        self._session: SceneSession | None = None
        scene = slicer.mrmlScene
        self._tags = [(self._selection, self._selection.AddObserver("ModifiedEvent", self._on_change))]
        for event in (scene.NodeAddedEvent, scene.EndImportEvent, scene.EndBatchProcessEvent):
            self._tags.append((scene, scene.AddObserver(event, self._on_change)))

    def offer_to(self, session: SceneSession | None) -> None:
        """From now on, this session takes a volume up while it has none."""
        if session is not self._session:
            self._session, self.wanted = session, True
            self._on_change()

    def close(self) -> None:
        """Stop watching."""
        for node, tag in self._tags:
            node.RemoveObserver(tag)
        self._tags = []

    def _on_change(self, caller: Any = None, event: str = "") -> None:
        session = self._session
        if session is None or not self.wanted or slicer.mrmlScene.IsBatchProcessing() or session.parameters.volume is not None:
            return
        volume = self._volume()
        if volume is not None:
            session.set_volume(volume)

    def _volume(self) -> slicer.vtkMRMLScalarVolumeNode | None:
        scene = slicer.mrmlScene
        shown = scene.GetNodeByID(self._selection.GetActiveVolumeID() or "")
        if shown is not None and _can_be_chosen(shown):
            return shown
        nodes = (scene.GetNthNodeByClass(n, _VOLUME) for n in range(scene.GetNumberOfNodesByClass(_VOLUME)))
        there = [node for node in nodes if _can_be_chosen(node)]
        return there[0] if len(there) == 1 else None


_VOLUME = "vtkMRMLScalarVolumeNode"


def _can_be_chosen(node: slicer.vtkMRMLNode) -> bool:
    """Whether the panel lists a node, and it has voxels: one that is being loaded gets them later."""
    return node.GetClassName() == _VOLUME and not node.GetHideFromEditors() and node.GetImageData() is not None
