"""Volumes, segmentations and sessions in a scene, for tests."""

from __future__ import annotations

from typing import Any

import numpy as np
import slicer
import vtk
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy

from ViTTransferFunction.Logic.core.geometry import transform_points
from ViTTransferFunction.Logic.core.volume import Volume
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.volume import (
    geometry_from_node,
    matrix_to_world,
    numpy_matrix,
    set_image,
    vtk_matrix,
    world_to_local,
)
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_features


def add_volume(scene: Any, volume: Volume) -> Any:
    """A volume node with the content of `volume`."""
    node = scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", volume.name)
    set_image(node, volume.array, volume.geometry.ijk_to_ras)
    node.CreateDefaultDisplayNodes()
    return node


def add_parameter_node(scene: Any) -> Any:
    """The module's parameter node, as Slicer makes it."""
    node = scene.CreateNodeByClass("vtkMRMLScriptedModuleNode")
    node.SetModuleName("ViTTransferFunction")
    node.SetSingletonTag("ViTTransferFunction")
    node.SetName("ViTTransferFunction")
    added = scene.AddNode(node)
    node.UnRegister(None)
    return added


def open_spheres(app: Any, spheres: tuple[Volume, np.ndarray]) -> SceneSession:
    """A session on the spheres of conftest, ready for clicks."""
    cache_known_features(*spheres)
    session = SceneSession(app.scene, app.app_logic, add_parameter_node(app.scene))
    session.parameters.set("grid", GRID)
    session.set_volume(add_volume(app.scene, spheres[0]))
    session.wait()
    assert session.phase == "ready", session.take_error()
    return session


def add_segment(segmentation_node: Any, volume_node: Any, name: str, mask: np.ndarray) -> None:
    """A segment with a mask on the volume's grid, as Slicer adds it."""
    labelmap = slicer.vtkOrientedImageData()
    labelmap.SetDimensions(*mask.shape[::-1])
    labelmap.GetPointData().SetScalars(numpy_to_vtk(mask.astype(np.uint8).ravel(), deep=True))
    labelmap.SetGeometryFromImageToWorldMatrix(vtk_matrix(geometry_from_node(volume_node).ijk_to_ras))
    segmentation_node.AddSegmentFromBinaryLabelmapRepresentation(labelmap, name)


def segment_masks(segmentation_node: Any, volume_node: Any) -> dict[str, np.ndarray]:
    """Which of a volume's voxels (K, J, I) each segment holds, by the segment's name; by Slicer's own reading of labelmaps."""
    segmentation = segmentation_node.GetSegmentation()
    ids = [segmentation.GetNthSegmentID(n) for n in range(segmentation.GetNumberOfSegments())]
    return {segmentation.GetSegment(i).GetName(): _mask(segmentation_node, i, volume_node) for i in ids}


def _mask(segmentation_node: Any, segment_id: str, volume_node: Any) -> np.ndarray:
    geometry = geometry_from_node(volume_node)
    mask = np.zeros(geometry.shape, dtype=bool)
    image = slicer.vtkOrientedImageData()
    segmentation_node.GetBinaryLabelmapRepresentation(segment_id, image)
    if not image.IsEmpty():
        labels = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(image.GetDimensions()[::-1])
        ijk = (np.argwhere(labels) + np.array(image.GetExtent()[::2])[::-1])[:, ::-1]
        matrix = vtk.vtkMatrix4x4()
        image.GetImageToWorldMatrix(matrix)
        to_world = matrix_to_world(segmentation_node) @ numpy_matrix(matrix)
        world = transform_points(to_world, ijk)
        kji = np.rint(geometry.ras_to_ijk(world_to_local(volume_node, world))[:, ::-1]).astype(int)
        mask[tuple(kji.T)] = True
    return mask
