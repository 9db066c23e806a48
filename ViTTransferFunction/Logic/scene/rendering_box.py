"""The box that 3D renderings are cut to: an ordinary ROI of the scene, which the user moves in the views."""

from __future__ import annotations

import slicer

from .parameters import SceneParameters

NAME = "Rendering box"


def shown_box(
    scene: slicer.vtkMRMLScene, parameters: SceneParameters, volume: slicer.vtkMRMLScalarVolumeNode
) -> slicer.vtkMRMLMarkupsROINode | None:
    """The box, where renderings are to be cut; None where not, and then it is not in the views either.

    It is made around the volume when it is first wanted, and again where the user has deleted it.
    """
    box, cut = parameters.rendering_box, parameters.get("renderingCut")
    if box is None and cut:
        box = _added_box(scene, volume)
        parameters.set_reference("renderingBox", box)
    if box is not None and bool(box.GetDisplayNode().GetVisibility()) != cut:
        box.GetDisplayNode().SetVisibility(cut)
    return box if cut else None


def _added_box(scene: slicer.vtkMRMLScene, volume: slicer.vtkMRMLScalarVolumeNode) -> slicer.vtkMRMLMarkupsROINode:
    bounds = [0.0] * 6
    volume.GetRASBounds(bounds)
    box = scene.AddNewNodeByClass("vtkMRMLMarkupsROINode", NAME)
    box.CreateDefaultDisplayNodes()
    display = box.GetDisplayNode()
    # The picture is what is looked at, not the box.
    display.SetFillVisibility(False)
    display.SetPropertiesLabelVisibility(False)
    box.SetXYZ([(bounds[2 * axis] + bounds[2 * axis + 1]) / 2 for axis in range(3)])
    box.SetRadiusXYZ([(bounds[2 * axis + 1] - bounds[2 * axis]) / 2 for axis in range(3)])
    return box
