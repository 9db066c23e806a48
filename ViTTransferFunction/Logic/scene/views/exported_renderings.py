"""Renderings that were left to the scene (`ClassRendering.export`), for front ends that have no list of all volumes."""

from __future__ import annotations

from typing import Any

from ..mrml.nodes import displays_of, nodes_of_class
from .rendering import DISPLAY_CLASS


def exported_renderings(scene: Any) -> list[Any]:
    """Their volume nodes, whichever session left them there; not that of the rendering which follows clicks."""
    volumes = nodes_of_class(scene, "vtkMRMLVectorVolumeNode")
    return [volume for volume in volumes if volume.GetSaveWithScene() and _ray_casting(volume)]


def remove_exported(scene: Any, volume: Any) -> None:
    """Take one of them out of the scene, and what displays it."""
    casting = _ray_casting(volume)
    materials = [node for display in casting for node in (display.GetVolumePropertyNode(), display.GetShaderPropertyNode())]
    for node in (*displays_of(volume), volume, *materials):
        if node is not None and scene.IsNodePresent(node):
            scene.RemoveNode(node)


def _ray_casting(volume: Any) -> list[Any]:
    return [display for display in displays_of(volume) if display.IsA(DISPLAY_CLASS) and display.GetShaderPropertyNode()]
