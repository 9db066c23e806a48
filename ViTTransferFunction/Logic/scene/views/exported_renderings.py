"""Renderings that were left to the scene (`ClassRendering.export`), for front ends that have no list of all volumes."""

from __future__ import annotations

from typing import Any

from ..mrml.nodes import displays_of, nodes_of_class
from .rendering import DISPLAY_CLASS, can_be_cut_by_planes
from .rendering_cut import CUTS_EXPORTED


def exported_renderings(scene: Any) -> list[Any]:
    """Their volume nodes, whichever session left them there; not that of the rendering which follows clicks."""
    volumes = nodes_of_class(scene, "vtkMRMLVectorVolumeNode")
    return [volume for volume in volumes if volume.GetSaveWithScene() and _ray_casting(volume)]


def remove_exported(scene: Any, volume: Any) -> None:
    """Take one of them out of the scene, and what displays it."""
    used = [node for display in _ray_casting(volume) for node in _used_by(display)]
    for node in (*displays_of(volume), volume, *used):
        if node is not None and scene.IsNodePresent(node):
            scene.RemoveNode(node)


def _used_by(display: Any) -> list[Any]:
    """What nothing else uses."""
    clip = display.GetClipNode() if can_be_cut_by_planes(display) else None
    cuts = (display.GetROINode(), clip.GetClippingNode() if clip is not None else None)
    own = [cut for cut in cuts if cut is not None and cut.GetAttribute(CUTS_EXPORTED)]
    return [display.GetVolumePropertyNode(), display.GetShaderPropertyNode(), clip, *own]


def _ray_casting(volume: Any) -> list[Any]:
    return [display for display in displays_of(volume) if display.IsA(DISPLAY_CLASS) and display.GetShaderPropertyNode()]
