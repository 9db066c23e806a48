"""The classes in 3D, in Slicer's views: one volume of structures (`rendering.composition`), by GPU volume rendering."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import slicer
import vtk
from vtkmodules.vtkCommonDataModel import vtkImageData

from ...core.system.errors import InputError
from ..mrml.derived_nodes import DerivedNodes
from ..mrml.nodes import displays_of
from ..mrml.observers import SceneObservers
from ..volumes.volume_nodes import own_copy, take_image
from .quick_pictures import QuickPictures
from .rendering_cut import cut_for_export
from .structure_material import set_material, set_shader, set_uniforms
from .surface_smoothing import SurfaceSmoothing
from .view_sight import keep_whole, look_at, sees, shows_large_enough

VOLUME_NAME = "Structure rendering"
DISPLAY_NAME = "Structure rendering display"
PROPERTY_NAME = "Structure rendering property"
SHADER_NAME = "Structure rendering shader"
CLIP_NAME = "Structure rendering clipping"
DISPLAY_CLASS = "vtkMRMLGPURayCastVolumeRenderingDisplayNode"


class ClassRendering:
    """Shows a volume of structures in all 3D views.

    Soft shadows are in the volume. Slicer's ambient shadows, a setting of its views, are left as they are: with OpenGL in
    software they cover volumes with a chequered pattern.

    Args:
        scene: where views and volumes are.
        app_logic: the application's logic, which has the logic of the module Volume Rendering.
        windows: returns the vtkRenderWindows of the 3D views that are shown. They are drawn quickly while the look is changed,
            and are turned to a scan whose first structures would be out of sight.
    """

    def __init__(
        self,
        scene: slicer.vtkMRMLScene,
        app_logic: slicer.vtkSlicerApplicationLogic,
        windows: Callable[[], Iterable[Any]] = tuple,
    ) -> None:
        self._scene = scene
        self._app_logic = app_logic
        self._nodes = DerivedNodes(scene)
        self._smoothing = SurfaceSmoothing(scene)
        self._windows = windows
        self._quick = QuickPictures(windows)
        self._observers = SceneObservers()
        self._cut_by: Any = None
        self._looked_at = vtk.vtkWeakReference()  # Weak, so that a scan that is removed from the scene is freed.
        self._looked_in: set[str] = set()  # Addresses of the windows.

    def show(
        self,
        volume_node: slicer.vtkMRMLScalarVolumeNode,
        image: vtkImageData,
        structures: int,
        uniforms: Mapping[str, np.ndarray],
        ijk_to_ras: np.ndarray,
    ) -> None:
        """Show structures in all 3D views, in place of those that were shown before.

        Args:
            volume_node: the volume that was segmented; structures move with it.
            image: the voxels of a `StructureVolume`, uint8 with four components. It must not be changed while it is shown.
            structures: the number of structures.
            uniforms: their look (`StructureVolume.uniforms`).
            ijk_to_ras: (4, 4), from the image's voxels to the volume's local frame, RAS millimetres.

        Raises:
            InputError: Slicer's module Volume Rendering is missing.
        """
        volume = self._nodes.find(VOLUME_NAME) or self._nodes.add("vtkMRMLVectorVolumeNode", VOLUME_NAME)
        if volume.GetVolumeDisplayNode() is None:
            volume.CreateDefaultDisplayNodes()
            volume.GetVolumeDisplayNode().SetSaveWithScene(False)
            # Slice views do not show this volume, and an automatic window would read all voxels of each image.
            volume.GetVolumeDisplayNode().SetAutoWindowLevel(False)
        display = self._nodes.find(DISPLAY_NAME) or self._add_display()
        material = self._nodes.find(PROPERTY_NAME) or self._add_property()
        shader = self._nodes.find(SHADER_NAME) or self._nodes.add("vtkMRMLShaderPropertyNode", SHADER_NAME)
        take_image(volume, image, ijk_to_ras)
        set_shader(shader.GetShaderProperty(), structures)
        set_uniforms(shader.GetShaderProperty(), uniforms)
        volume.SetAndObserveTransformNodeID(volume_node.GetTransformNodeID())
        self._display_by(display, volume, material, shader)
        self._observers.observe(self._scene, [(slicer.vtkMRMLScene.EndBatchProcessEvent, self._on_batch_end)])
        self._smoothing.switch_on()
        self._bring_into_sight(volume_node, volume)

    def look_in_new_views(self) -> None:
        """Turn 3D views that were not shown before, such as those of a new layout, to the scan if there are structures."""
        volume, display = self._nodes.find(VOLUME_NAME), self._nodes.find(DISPLAY_NAME)
        if volume is not None and display is not None and display.GetVisibility() and self._looked_at.Get() is not None:
            self._bring_into_sight(self._looked_at.Get(), volume)

    def _bring_into_sight(self, volume_node: Any, volume: Any) -> None:
        """Turn the 3D views to the scan in which its first structures would be out of sight or too small.

        This is done once for each scan and view; after that, views stay as the user leaves them.
        """
        if self._looked_at.Get() is not volume_node:
            self._looked_at.Set(volume_node)
            self._looked_in = set()
        structures, scan = [0.0] * 6, [0.0] * 6
        volume.GetRASBounds(structures)
        volume_node.GetRASBounds(scan)
        middle = [(low + high) / 2.0 for low, high in zip(structures[::2], structures[1::2], strict=True)]
        for window in self._windows():
            renderer, address = window.GetRenderers().GetFirstRenderer(), window.GetAddressAsString("vtkRenderWindow")
            first = address not in self._looked_in
            self._looked_in.add(address)
            if first and not (sees(renderer, middle) and shows_large_enough(renderer, scan)):
                look_at(renderer, scan)
            keep_whole(renderer, structures)

    def _display_by(self, display: Any, volume: Any, material: Any, shader: Any) -> None:
        """Render the structures by this display node alone."""
        for other in _renderings_of(volume):
            if other is not display:
                self._scene.RemoveNode(other)
        display.SetAndObserveVolumePropertyNodeID(material.GetID())
        display.SetAndObserveShaderPropertyNodeID(shader.GetID())
        if not volume.HasNodeReferenceID(volume.GetDisplayNodeReferenceRole(), display.GetID()):
            volume.AddAndObserveDisplayNodeID(display.GetID())
        display.SetVisibility(True)

    def _on_batch_end(self, caller: vtk.vtkObject, event: str) -> None:
        """Put our display node back if Slicer replaced it because the user chose another method, which lacks our shader."""
        volume, display, material, shader = map(self._nodes.find, (VOLUME_NAME, DISPLAY_NAME, PROPERTY_NAME, SHADER_NAME))
        if volume is not None and display is None and material is not None and shader is not None and _renderings_of(volume):
            self._display_by(self._add_display(), volume, material, shader)
            self.cut(self._cut_by if self._scene.IsNodePresent(self._cut_by) else None)

    def change(self, uniforms: Mapping[str, np.ndarray]) -> None:
        """Change the look of the structures at once; where drawing is slow, with fewer rays until `draw_in_full_at_rest`."""
        shader, volume = self._nodes.find(SHADER_NAME), self._nodes.find(VOLUME_NAME)
        if shader is not None:
            if volume is not None:
                self._quick.begin(volume.GetImageData())
            set_uniforms(shader.GetShaderProperty(), uniforms)

    @property
    def drawing_quickly(self) -> bool:
        """Whether views are drawn with fewer rays at the moment, and must still be drawn in full."""
        return self._quick.drawing

    def draw_in_full_at_rest(self) -> None:
        """Draw the views in full if the look has not been changed for a moment."""
        display = self._nodes.find(DISPLAY_NAME)
        if self._quick.end_at_rest() and display is not None:
            # Views redraw when one of their nodes is modified.
            display.Modified()

    def cut(self, by: Any) -> None:
        """Show only the part inside a vtkMRMLMarkupsROINode or behind a vtkMRMLMarkupsPlaneNode; None shows all.

        Raises:
            InputError: this version of Slicer cannot cut renderings by planes.
        """
        self._cut_by = by
        display = self._nodes.find(DISPLAY_NAME)
        if display is None:
            return
        plane = by if by is not None and by.IsA("vtkMRMLMarkupsPlaneNode") else None
        box = by if plane is None else None
        if (display.GetROINode(), bool(display.GetCroppingEnabled())) != (box, box is not None):
            display.SetAndObserveROINodeID(box.GetID() if box is not None else None)
            display.SetCroppingEnabled(box is not None)
        if can_be_cut_by_planes(display):
            self._cut_behind(display, plane)
        elif plane is not None:
            raise InputError("This Slicer cuts 3D renderings by boxes only. Choose the box, or update Slicer.")

    def _cut_behind(self, display: Any, plane: Any) -> None:
        clip = self._nodes.find(CLIP_NAME)
        if plane is not None and clip is None:
            clip = self._nodes.add("vtkMRMLClipNode", CLIP_NAME)
            # For a union of planes, the renderer clips by itself; for an intersection, Slicer would copy the volume.
            clip.SetClipType(clip.ClipUnion)
        if plane is not None and clip.GetClippingNode() is not plane:
            clip.SetAndObserveClippingNodeID(plane.GetID())
            clip.SetClippingNodeState(plane, clip.ClipNegativeSpace)
        if (display.GetClipNode(), bool(display.GetClipping())) != (clip, plane is not None):
            display.SetAndObserveClipNodeID(clip.GetID() if clip is not None else None)
            display.SetClipping(plane is not None)

    def export(self, name: str) -> Any:
        """Leave the present rendering, with its cut, to the scene: it is saved, and any Slicer shows it without this extension.

        Args:
            name: name of the volume node, for users.

        Returns:
            The volume node; None if nothing is shown. The next `show` makes new nodes.
        """
        volume, display = self._nodes.find(VOLUME_NAME), self._nodes.find(DISPLAY_NAME)
        if volume is None or display is None or not display.GetVisibility():
            return None
        self._quick.end()
        if self._scene.IsNodePresent(self._cut_by):
            self.cut(cut_for_export(self._scene, self._cut_by, f"{name} {self._cut_by.GetName()}"))
            self._cut_by = None
        # A copy, since from now on others may change it, show it in slices, and keep it after Python has ended.
        volume.SetAndObserveImageData(own_copy(volume.GetImageData()))
        if (in_slices := volume.GetVolumeDisplayNode()) is not None:
            in_slices.SetAutoWindowLevel(True)
        for shown_by in displays_of(volume):
            shown_by.SetSaveWithScene(True)
        for node in self._nodes.release():
            node.SetName(node.GetName().replace(VOLUME_NAME, name))
        self._observers.remove_all()
        self._smoothing.restore()
        return volume

    def hide(self) -> None:
        """Hide the structures in all views, and restore the views' settings."""
        self._quick.end()
        display = self._nodes.find(DISPLAY_NAME)
        if display is not None:
            display.SetVisibility(False)
        self._cut_by = None
        self._observers.remove_all()
        self._smoothing.restore()

    def remove(self) -> None:
        """Hide the structures, and remove their nodes from the scene."""
        self.hide()
        self._nodes.remove()
        self._looked_at.Set(None)

    def _add_display(self) -> Any:
        logic = self._app_logic.GetModuleLogic("VolumeRendering")
        if logic is None:
            raise InputError(
                "3D rendering needs Slicer's module Volume Rendering, which is not loaded. In Slicer, enable it under Edit, "
                "Application Settings, Modules, and restart; outside of it, install the app anew."
            )
        display = logic.CreateVolumeRenderingDisplayNode(DISPLAY_CLASS)
        # The caller owns the reference that this method returns.
        display.UnRegister(None)
        display.SetName(DISPLAY_NAME)
        self._scene.AddNode(display)
        return self._nodes.keep(display, DISPLAY_NAME)

    def _add_property(self) -> Any:
        node = self._nodes.add("vtkMRMLVolumePropertyNode", PROPERTY_NAME)
        set_material(node.GetVolumeProperty())
        return node


def _renderings_of(volume: Any) -> list[Any]:
    return [display for display in displays_of(volume) if display.IsA("vtkMRMLVolumeRenderingDisplayNode")]


def can_be_cut_by_planes(display: Any) -> bool:
    """Whether this Slicer can cut volume renderings by planes; older versions only cut models."""
    return hasattr(display, "SetClipping")
