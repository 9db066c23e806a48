"""What the 3D views show around the structures, by name: bones, skin, or the scan through one of Slicer's own presets."""

from __future__ import annotations

from typing import Any

from ...rendering.structure_volume import StructureVolume
from ...rendering.surroundings import CONTEXTS, Knot, Surroundings

OFF = "off"

_NO_PRESETS = {"SubjectHierarchy"}
"""Nodes of Slicer's scene of presets that are none."""


def context_names(app_logic: Any) -> list[str]:
    """All that can be shown: nothing, our own, and Slicer's presets, if it has its module Volume Rendering."""
    return [OFF, *CONTEXTS, *(node.GetName() for node in _presets(app_logic))]


def named_surroundings(
    app_logic: Any, name: str, strength: float, cut_away: bool, rendering: StructureVolume | None
) -> Surroundings:
    """What a name means for a scan; nothing where there is no such name."""
    cutaway = 1.0 if cut_away else 0.0
    if rendering is None or name == OFF:
        return Surroundings()
    if name in CONTEXTS:
        return Surroundings(CONTEXTS[name](rendering.hounsfield, rendering.levels), strength, cutaway)
    preset = next((node for node in _presets(app_logic) if node.GetName() == name), None)
    return Surroundings(_knots(preset) if preset is not None else (), strength, cutaway)


def _presets(app_logic: Any) -> list[Any]:
    """The volume property nodes of Slicer's presets."""
    logic = app_logic.GetModuleLogic("VolumeRendering")
    scene = logic.GetPresetsScene() if logic is not None else None
    if scene is None:
        return []
    count = scene.GetNumberOfNodesByClass("vtkMRMLVolumePropertyNode")
    nodes = [scene.GetNthNodeByClass(index, "vtkMRMLVolumePropertyNode") for index in range(count)]
    return [node for node in nodes if node.GetName() not in _NO_PRESETS]


def _knots(preset: Any) -> tuple[Knot, ...]:
    """Colours and opacities of a preset, at all positions where one of them has a knot."""
    colors, opacities = preset.GetColor(0), preset.GetScalarOpacity(0)
    positions = set()
    for function, length in ((colors, 6), (opacities, 4)):
        for index in range(function.GetSize()):
            values = [0.0] * length
            function.GetNodeValue(index, values)
            positions.add(values[0])
    return tuple((at, tuple(colors.GetColor(at)), opacities.GetValue(at)) for at in sorted(positions))
