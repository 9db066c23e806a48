"""The volume that is taken up where nobody has chosen one: the one that is shown, or else the only one there is."""

from __future__ import annotations

from typing import Any

_VOLUME = "vtkMRMLScalarVolumeNode"


def offered_volume(scene: Any, shown: str | None) -> Any | None:
    """The volume to take up, of those that can be chosen; None where nothing tells it from others.

    Args:
        scene: the scene.
        shown: ID of the volume node that is shown, of any kind; None or "": none is.
    """
    there = choosable_volumes(scene)
    in_view = [node for node in there if node.GetID() == shown]
    return next(iter(in_view or there), None) if in_view or len(there) == 1 else None


def choosable_volumes(scene: Any) -> list[Any]:
    """What can be chosen. A volume that is being loaded has no voxels yet; what is not saved is a picture of ours."""
    nodes = (scene.GetNthNodeByClass(n, _VOLUME) for n in range(scene.GetNumberOfNodesByClass(_VOLUME)))
    return [
        node
        for node in nodes
        if node.GetClassName() == _VOLUME
        and node.GetImageData() is not None
        and node.GetSaveWithScene()
        and not node.GetHideFromEditors()
    ]
