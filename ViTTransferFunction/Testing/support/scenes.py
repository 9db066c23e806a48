"""Volumes, transforms, segmentations and sessions in a scene."""

from __future__ import annotations

from typing import Any

import numpy as np
import slicer
import vtk
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy

from ViTTransferFunction.Logic.core.volumes.geometry import transform_points
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.scene.mrml.transforms import matrix_to_world, numpy_matrix, vtk_matrix, world_to_local
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import geometry_from_node, set_image
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_features
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras

OBLIQUE = np.array([[0.6, -0.96, 0.0, 11.0], [0.48, 0.36, -2.4, -7.0], [0.64, 0.48, 1.8, 40.0], [0.0, 0.0, 0.0, 1.0]])
"""IJK to RAS with spacing 1.0×1.2×3.0 mm, rotated about two axes."""
MOVED = np.array([[0.0, -1.0, 0.0, 30.0], [1.0, 0.0, 0.0, 5.0], [0.0, 0.0, 1.0, -20.0], [0.0, 0.0, 0.0, 1.0]])
"""A transform to the parent: a quarter of a turn, and a shift."""


def add_volume(scene: Any, volume: Volume) -> Any:
    """A volume node with the content of `volume`."""
    node = scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", volume.name)
    set_image(node, volume.array, volume.geometry.ijk_to_ras)
    node.CreateDefaultDisplayNodes()
    return node


class FollowUp:
    """A later scan in the same scene, in which the spheres are elsewhere.

    Attributes:
        volume: its node.
        spheres: voxels and labels.
    """

    def __init__(self, scene: Any, baseline: Spheres) -> None:
        volume = Volume(baseline[0].array[::-1].copy(), baseline[0].geometry, "follow-up")
        self.spheres: Spheres = volume, baseline[1][::-1].copy()
        cache_known_features(*self.spheres)
        self.volume = add_volume(scene, volume)

    def click(self, session: SceneSession) -> None:
        """Click on each of the three spheres, for the three structures that there are."""
        for label, state in enumerate(session.classes, start=1):
            session.annotations.add_points(state.id, centre_ras(self.spheres, label), positive=True)
        session.wait()


def add_parameter_node(scene: Any) -> Any:
    """The module's parameter node, as Slicer makes it."""
    node = scene.CreateNodeByClass("vtkMRMLScriptedModuleNode")
    node.SetAttribute("ModuleName", "ViTTransferFunction")
    node.SetSingletonTag("ViTTransferFunction")
    node.SetName("ViTTransferFunction")
    added = scene.AddNode(node)
    node.UnRegister(None)
    return added


def open_spheres(app: Any, spheres: Spheres, **of_front_end: Any) -> SceneSession:
    """A session on the spheres of conftest, ready for clicks; `of_front_end`: see `SceneSession`."""
    cache_known_features(*spheres)
    session = SceneSession(app.scene, app.app_logic, add_parameter_node(app.scene), **of_front_end)
    session.parameters.set("grid", GRID)
    session.set_volume(add_volume(app.scene, spheres[0]))
    session.wait()
    assert session.phase == "ready", session.take_error()
    return session


def annotate(session: SceneSession, spheres: Spheres) -> list[str]:
    """One class with a click for each of the three spheres; returns their ids."""
    ids = []
    for label in (1, 2, 3):
        ids.append(session.annotations.add_class(f"sphere {label}").id)
        session.annotations.add_points(ids[-1], centre_ras(spheres, label), positive=True)
    session.wait()
    return ids


def write_all(session: SceneSession) -> None:
    """Have the segments of all classes written, with nothing to be asked or told."""
    session.segments.write("ask")
    session.wait()
    assert session.take_error() is None


def put_under(node: Any, matrix: np.ndarray) -> Any:
    """Put a node under a new linear transform to its parent; returns the transform."""
    transform = node.GetScene().AddNewNodeByClass("vtkMRMLLinearTransformNode", "Registration")
    transform.SetMatrixTransformToParent(vtk_matrix(matrix))
    node.SetAndObserveTransformNodeID(transform.GetID())
    return transform


def bend(node: Any) -> None:
    """Put a node under a transform that is not linear."""
    bent = node.GetScene().AddNewNodeByClass("vtkMRMLBSplineTransformNode")
    bent.SetAndObserveTransformToParent(vtk.vtkThinPlateSplineTransform())
    node.SetAndObserveTransformNodeID(bent.GetID())


def add_hanging_point(scene: Any, node: Any) -> int:
    """A point that hangs on the mouse, which Slicer's views add without a word; returns its index."""
    scene.StartState(scene.BatchProcessState)
    index: int = node.AddControlPointWorld(vtk.vtkVector3d(5.0, 0.0, 0.0))
    node.SetNthControlPointPositionWorld(index, 5.0, 0.0, 0.0, node.PositionPreview)
    scene.EndState(scene.BatchProcessState)
    return index


def add_segment(
    segmentation_node: Any, name: str, mask: np.ndarray, ijk_to_ras: np.ndarray, dtype: type[np.number[Any]] = np.uint8
) -> str:
    """Add a segment as another module would, by Slicer's own function; its id is its name.

    Args:
        mask: (K, J, I).
        ijk_to_ras: of the mask's grid, to the segmentation's local frame.
        dtype: that its voxels are kept in.
    """
    labelmap = slicer.vtkOrientedImageData()
    labelmap.SetDimensions(*mask.shape[::-1])
    labelmap.GetPointData().SetScalars(numpy_to_vtk(mask.astype(dtype).ravel(), deep=True))
    labelmap.SetGeometryFromImageToWorldMatrix(vtk_matrix(ijk_to_ras))
    segment_id = segmentation_node.GetSegmentation().AddEmptySegment(name, name)
    slicer.vtkSlicerSegmentationsModuleLogic.SetBinaryLabelmapToSegment(labelmap, segmentation_node, segment_id)
    return segment_id


def segment_points(segmentation_node: Any, segment_id: str) -> np.ndarray:
    """Where a segment's voxels are in the scene, (N, 3) RAS millimetres; by Slicer's own reading of labelmaps."""
    image = slicer.vtkOrientedImageData()
    segmentation_node.GetBinaryLabelmapRepresentation(segment_id, image)
    if image.IsEmpty():
        return np.empty((0, 3))
    labels = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(image.GetDimensions()[::-1])
    ijk = (np.argwhere(labels) + np.array(image.GetExtent()[::2])[::-1])[:, ::-1]
    matrix = vtk.vtkMatrix4x4()
    image.GetImageToWorldMatrix(matrix)
    return transform_points(matrix_to_world(segmentation_node) @ numpy_matrix(matrix), ijk)


def segment_masks(segmentation_node: Any, volume_node: Any) -> dict[str, np.ndarray]:
    """Which of a volume's voxels (K, J, I) each segment holds, by the segment's name."""
    segmentation, geometry = segmentation_node.GetSegmentation(), geometry_from_node(volume_node)
    masks = {}
    for segment_id in (segmentation.GetNthSegmentID(n) for n in range(segmentation.GetNumberOfSegments())):
        mask = np.zeros(geometry.shape, dtype=bool)
        local = world_to_local(volume_node, segment_points(segmentation_node, segment_id))
        mask[tuple(geometry.nearest_voxels(local).T)] = True
        masks[segmentation.GetSegment(segment_id).GetName()] = mask
    return masks
