"""What 3D renderings are cut by: a box or a plane of the scene, ordinary markups, which the user moves in the views."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import slicer

from ..interface.parameters import SceneParameters
from ..mrml.added_markups import add_markups

BOX_NAME, PLANE_NAME = "Rendering box", "Rendering plane"

IN_USE = "ViTTransferFunction.cutsRendering"
"""Attribute of the one that was put into the views, and stays there or not as the user likes."""
CUTS_EXPORTED = "ViTTransferFunction.cutsExported"
"""Attribute of one that an exported rendering has for itself."""
CUT_VOLUME = "ViTTransferFunction.cutVolume"
"""Attribute with the id of the volume whose renderings were cut last; a reference would go with it."""


def shown_cut(scene: slicer.vtkMRMLScene, parameters: SceneParameters, volume: slicer.vtkMRMLScalarVolumeNode) -> Any:
    """The vtkMRMLMarkupsROINode or vtkMRMLMarkupsPlaneNode that renderings are cut by; None where they are not.

    It is made when it is first wanted, and again where the user has deleted it. What is not wanted is not in the views either,
    and none is without a rendering. What is wanted comes into the views once: the user may hide it there, for a picture say.
    Where it cut another volume before and lies beyond this one, nothing would be left to see: it is placed anew.
    """
    cut = parameters.get("renderingCut") if parameters.rendering_mode() is not None else "off"
    nodes = {"box": parameters.rendering_box, "plane": parameters.rendering_plane}
    if cut == "box" and nodes["box"] is None:
        nodes["box"] = _added(scene, "vtkMRMLMarkupsROINode", BOX_NAME)
        _place_box(nodes["box"], volume)
        parameters.set_reference("renderingBox", nodes["box"])
    if cut == "plane" and nodes["plane"] is None:
        nodes["plane"] = _added_plane(scene)
        _place_plane(nodes["plane"], volume)
        parameters.set_reference("renderingPlane", nodes["plane"])
    for name, node in nodes.items():
        if node is not None:
            _show(node, name == cut)
    if cut in nodes:
        _bring_to(volume, nodes[cut], _place_box if cut == "box" else _place_plane)
    return nodes.get(cut)


def cut_for_export(scene: slicer.vtkMRMLScene, cut: Any, name: str) -> Any:
    """One of this name that stays where a box or plane is now, out of sight: what was exported is to stay as it was seen."""
    own = _added(scene, cut.GetClassName(), name)
    own.GetDisplayNode().SetVisibility(False)
    own.CopyContent(cut)
    own.SetAndObserveTransformNodeID(cut.GetTransformNodeID())
    own.SetAttribute(CUTS_EXPORTED, "1")
    return own


def _show(node: slicer.vtkMRMLMarkupsNode, visible: bool) -> None:
    node.CreateDefaultDisplayNodes()
    if (node.GetAttribute(IN_USE) is not None) != visible:
        node.SetAttribute(IN_USE, "1" if visible else None)
        node.GetDisplayNode().SetVisibility(visible)


def _bring_to(volume: slicer.vtkMRMLScalarVolumeNode, cut: Any, place: Callable[[Any, Any], None]) -> None:
    """Place it anew where it was at another volume, and its middle lies beyond this one."""
    before = cut.GetAttribute(CUT_VOLUME)
    if before == volume.GetID():
        return
    cut.SetAttribute(CUT_VOLUME, volume.GetID())
    middle, radii = _middle_and_radii(volume)
    is_beyond = any(abs(at - centre) > radius for at, centre, radius in zip(cut.GetCenterWorld(), middle, radii, strict=True))
    if before is not None and is_beyond:
        place(cut, volume)


def _place_box(box: slicer.vtkMRMLMarkupsROINode, volume: slicer.vtkMRMLScalarVolumeNode) -> None:
    """Around the volume."""
    middle, radii = _middle_and_radii(volume)
    box.SetCenterWorld(middle)
    box.SetSizeWorld([2.0 * radius for radius in radii])


def _place_plane(plane: slicer.vtkMRMLMarkupsPlaneNode, volume: slicer.vtkMRMLScalarVolumeNode) -> None:
    """Through the volume's middle, and facing forwards, from where views look first: what lies behind it is kept."""
    middle, (right, _, up) = _middle_and_radii(volume)
    plane.SetOriginWorld(middle)
    plane.SetNormalWorld([0.0, 1.0, 0.0])
    plane.SetSize(2.0 * right, 2.0 * up)


def _added_plane(scene: slicer.vtkMRMLScene) -> slicer.vtkMRMLMarkupsPlaneNode:
    plane = _added(scene, "vtkMRMLMarkupsPlaneNode", PLANE_NAME)
    display = plane.GetDisplayNode()
    display.SetHandlesInteractive(True)
    # It is moved along its normal and tilted: all else leaves the cut as it is, and handles are in the way.
    display.SetScaleHandleVisibility(False)
    display.SetTranslationHandleVisibility(True)
    display.SetTranslationHandleComponentVisibility([False, False, True, False])
    display.SetRotationHandleVisibility(True)
    display.SetRotationHandleComponentVisibility([True, True, False, False])
    return plane


def _added(scene: slicer.vtkMRMLScene, class_name: str, name: str) -> Any:
    node = add_markups(scene, class_name, name)
    node.CreateDefaultDisplayNodes()
    # The picture is what is looked at, not what cuts it.
    node.GetDisplayNode().SetFillVisibility(False)
    node.GetDisplayNode().SetPropertiesLabelVisibility(False)
    return node


def _middle_and_radii(volume: slicer.vtkMRMLScalarVolumeNode) -> tuple[list[float], list[float]]:
    """Of the box along the scene's axes that a volume fills, RAS millimetres."""
    bounds = [0.0] * 6
    volume.GetRASBounds(bounds)
    ends = list(zip(bounds[::2], bounds[1::2], strict=True))
    return [(low + high) / 2 for low, high in ends], [(high - low) / 2 for low, high in ends]
