"""The classes in 3D, in Slicer's views: one volume of colours (`rendering.composition`), by GPU volume rendering."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPiecewiseFunction

from ..core.errors import InputError
from ..rendering.optical_properties import (
    AMBIENT,
    CODE_COMPONENT,
    DIFFUSE,
    SPECULAR,
    SPECULAR_POWER,
    SURFACE,
    UNIT_VOXELS,
    opacity_points,
)
from .derived_nodes import DerivedNodes
from .surface_smoothing import SurfaceSmoothing
from .volume import take_image

if TYPE_CHECKING:
    import slicer

VOLUME_NAME = "Structure rendering"
DISPLAY_NAME = "Structure rendering display"
PROPERTY_NAME = "Structure rendering property"
DISPLAY_CLASS = "vtkMRMLGPURayCastVolumeRenderingDisplayNode"


class ClassRendering:
    """Shows a volume of colours in all 3D views.

    Soft shadows are in the colours. Slicer's ambient shadows, a setting of its views, are left as they are: with OpenGL in
    software they cover volumes with a chequered pattern.

    Args:
        scene: where views and volumes are.
        app_logic: of the application, which knows the logic of the module Volume Rendering.
    """

    def __init__(self, scene: slicer.vtkMRMLScene, app_logic: slicer.vtkSlicerApplicationLogic) -> None:
        self._scene = scene
        self._app_logic = app_logic
        self._nodes = DerivedNodes(scene)
        self._smoothing = SurfaceSmoothing(scene)

    def show(
        self,
        volume_node: slicer.vtkMRMLScalarVolumeNode,
        image: vtkImageData,
        codes: tuple[int, int],
        ijk_to_ras: np.ndarray,
    ) -> None:
        """Show colours, or others instead, in all 3D views.

        Args:
            volume_node: the volume that they are of; they move with it.
            image: uint8, colours and codes, four numbers in each voxel. It must not be changed later.
            codes: the smallest and the largest code.
            ijk_to_ras: (4, 4), of its voxels in the volume's local frame, RAS millimetres.

        Raises:
            InputError: Slicer's module Volume Rendering is missing.
        """
        volume = self._nodes.find(VOLUME_NAME) or self._nodes.add("vtkMRMLVectorVolumeNode", VOLUME_NAME)
        if volume.GetVolumeDisplayNode() is None:
            volume.CreateDefaultDisplayNodes()
            volume.GetVolumeDisplayNode().SetSaveWithScene(False)
        display = self._nodes.find(DISPLAY_NAME) or self._add_display()
        material = self._nodes.find(PROPERTY_NAME) or self._add_property()
        take_image(volume, image, ijk_to_ras)
        _set_opacity(material, codes)
        volume.SetAndObserveTransformNodeID(volume_node.GetTransformNodeID())
        display.SetAndObserveVolumePropertyNodeID(material.GetID())
        if not volume.HasNodeReferenceID(volume.GetDisplayNodeReferenceRole(), display.GetID()):
            volume.AddAndObserveDisplayNodeID(display.GetID())
        display.SetVisibility(codes[1] > SURFACE)
        self._smoothing.switch_on()

    def hide(self) -> None:
        """Take the colours out of the views, and undo what was set in them."""
        display = self._nodes.find(DISPLAY_NAME)
        if display is not None:
            display.SetVisibility(False)
        self._smoothing.restore()

    def remove(self) -> None:
        """Hide the colours, and take their nodes out of the scene."""
        self.hide()
        self._nodes.remove()

    def _add_display(self) -> Any:
        logic = self._app_logic.GetModuleLogic("VolumeRendering")
        if logic is None:
            raise InputError(
                "3D rendering needs Slicer's module Volume Rendering, which is not loaded. Enable it under Edit, Application "
                "Settings, Modules, and restart Slicer."
            )
        display = logic.CreateVolumeRenderingDisplayNode(DISPLAY_CLASS)
        # Created for the caller to release.
        display.UnRegister(None)
        display.SetName(DISPLAY_NAME)
        self._scene.AddNode(display)
        return self._nodes.keep(display, DISPLAY_NAME)

    def _add_property(self) -> Any:
        node = self._nodes.add("vtkMRMLVolumePropertyNode", PROPERTY_NAME)
        material = node.GetVolumeProperty()
        material.IndependentComponentsOff()
        material.SetInterpolationTypeToLinear()
        material.ShadeOn()
        material.SetAmbient(AMBIENT)
        material.SetDiffuse(DIFFUSE)
        material.SetSpecular(SPECULAR)
        material.SetSpecularPower(SPECULAR_POWER)
        return node


def _set_opacity(node: Any, codes: tuple[int, int]) -> None:
    """The opacity of each code in a volume whose codes range from the one to the other."""
    opacity = vtkPiecewiseFunction()
    for position, value in opacity_points(*codes):
        opacity.AddPoint(position, value)
    was_modifying = node.StartModify()
    node.SetScalarOpacity(opacity)
    # VTK takes the function from component 0, its unit from the component that it is applied to.
    # Slicer hands it voxels that are 1 apart, and VTK measures the unit there, not in millimetres.
    node.GetVolumeProperty().SetScalarOpacityUnitDistance(CODE_COMPONENT, UNIT_VOXELS)
    node.EndModify(was_modifying)
