"""Volume nodes and arrays: real MRML nodes, with Slicer's own geometry as the reference."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import vtk
from hypothesis import given
from hypothesis import strategies as st
from vtkmodules.util.numpy_support import vtk_to_numpy

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.geometry import transform_points
from ViTTransferFunction.Logic.scene.mrml.transforms import matrix_to_world, numpy_matrix, world_to_local
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import (
    array_from_node,
    geometry_from_node,
    image_of,
    own_copy,
    set_image,
)
from ViTTransferFunction.Testing.support.scenes import OBLIQUE, put_under

slicer = pytest.importorskip("slicer")


@pytest.fixture
def a_volume(slicer_app: Any) -> Callable[..., Any]:
    """Makes volume nodes in a scene of their own."""

    def make(array: np.ndarray, ijk_to_ras: np.ndarray = OBLIQUE, kind: str = "vtkMRMLScalarVolumeNode") -> Any:
        node = slicer_app.scene.AddNewNodeByClass(kind, "CT chest")
        set_image(node, array, ijk_to_ras)
        return node

    return make


def ramp(dtype: type = np.int16, shape: tuple[int, ...] = (4, 5, 6)) -> np.ndarray:
    return np.arange(np.prod(shape), dtype=dtype).reshape(shape)


def put_under_a_warp(node: Any) -> Any:
    transform = node.GetScene().AddNewNodeByClass("vtkMRMLTransformNode", "Breathing")
    spline = vtk.vtkThinPlateSplineTransform()
    points, moved = vtk.vtkPoints(), vtk.vtkPoints()
    for corner in np.vstack([np.zeros(3), np.eye(3), np.ones(3)]) * 100.0:
        points.InsertNextPoint(corner)
        moved.InsertNextPoint(corner[0], corner[1] + 0.001 * corner[0] * corner[1], corner[2])
    spline.SetSourceLandmarks(points)
    spline.SetTargetLandmarks(moved)
    transform.SetAndObserveTransformToParent(spline)
    node.SetAndObserveTransformNodeID(transform.GetID())
    return transform


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.uint16, np.int32, np.float32, np.float64])
def test_voxels_come_as_they_are_stored(a_volume: Callable[..., Any], dtype: type) -> None:
    array = array_from_node(a_volume(ramp(dtype)))
    assert array.dtype == dtype
    np.testing.assert_array_equal(array, ramp(dtype))


def test_the_array_is_a_view_on_the_nodes_voxels(a_volume: Callable[..., Any]) -> None:
    node = a_volume(ramp())
    array = array_from_node(node)
    node.GetImageData().SetScalarComponentFromDouble(3, 2, 1, 0, -1000.0)
    assert array[1, 2, 3] == -1000


def test_the_array_outlives_the_node(slicer_app: Any, a_volume: Callable[..., Any]) -> None:
    node = a_volume(ramp())
    array = array_from_node(node)
    slicer_app.scene.RemoveNode(node)
    del node
    np.testing.assert_array_equal(array, ramp())


def test_parent_transforms_do_not_change_the_local_geometry(a_volume: Callable[..., Any]) -> None:
    node = a_volume(ramp())
    put_under(node, np.diag([1.0, 1.0, -2.0, 1.0]))
    np.testing.assert_allclose(geometry_from_node(node).ijk_to_ras, OBLIQUE, atol=1e-12)


angles = st.floats(-3.0, 3.0)
millimetres = st.floats(-500.0, 500.0)


def placed(angle_1: float, angle_2: float, spacing: tuple[float, ...], origin: tuple[float, ...]) -> np.ndarray:
    """A matrix of two rotations, a spacing and an origin."""
    transform = vtk.vtkTransform()
    transform.Translate(*origin)
    transform.RotateX(np.degrees(angle_1))
    transform.RotateZ(np.degrees(angle_2))
    transform.Scale(*spacing)
    return numpy_matrix(transform.GetMatrix())


matrices = st.builds(placed, angles, angles, st.tuples(*[st.floats(0.2, 5.0)] * 3), st.tuples(*[millimetres] * 3))


@given(own=matrices, inner=matrices, outer=matrices, ijk=st.tuples(*[st.floats(-3.0, 8.0)] * 3))
def test_geometry_agrees_with_slicers(own: np.ndarray, inner: np.ndarray, outer: np.ndarray, ijk: tuple[float, ...]) -> None:
    """From voxel to scene and back, through two nested transforms."""
    scene = slicer.vtkMRMLScene()
    node = scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode")
    set_image(node, ramp(), own)
    put_under(put_under(node, inner), outer)

    to_world, to_ras = vtk.vtkGeneralTransform(), vtk.vtkMatrix4x4()
    slicer.vtkMRMLTransformNode.GetTransformBetweenNodes(node.GetParentTransformNode(), None, to_world)
    node.GetIJKToRASMatrix(to_ras)
    expected = to_world.TransformPoint(to_ras.MultiplyPoint([*ijk, 1.0])[:3])

    geometry = geometry_from_node(node)
    world = transform_points(matrix_to_world(node), geometry.ijk_to_ras_points(np.array([ijk])))
    np.testing.assert_allclose(world[0], expected, atol=1e-6)
    np.testing.assert_allclose(geometry.ras_to_ijk(world_to_local(node, world))[0], ijk, atol=1e-6)


def test_a_node_without_transform_is_in_the_scenes_frame(a_volume: Callable[..., Any]) -> None:
    node = a_volume(ramp())
    np.testing.assert_array_equal(matrix_to_world(node), np.eye(4))


def test_no_points_stay_no_points(a_volume: Callable[..., Any]) -> None:
    assert world_to_local(a_volume(ramp()), np.empty((0, 3))).shape == (0, 3)


def test_a_non_linear_transform_is_refused_with_the_way_out(a_volume: Callable[..., Any]) -> None:
    node = a_volume(ramp())
    put_under_a_warp(put_under(node, np.eye(4)))
    for use in (geometry_from_node, lambda node: world_to_local(node, np.zeros((1, 3)))):
        with pytest.raises(InputError, match=r"'CT chest' is under a non-linear transform .* Harden"):
            use(node)


def test_a_non_linear_transform_is_refused_without_an_error_of_vtk(a_volume: Callable[..., Any]) -> None:
    node, printed = a_volume(ramp()), []
    transform = put_under_a_warp(node)
    transform.AddObserver("ErrorEvent", lambda *_: printed.append("error"))
    with pytest.raises(InputError, match="non-linear"):
        matrix_to_world(node)
    assert printed == []


def test_a_transform_that_makes_a_volume_flat_is_refused(a_volume: Callable[..., Any]) -> None:
    node = a_volume(ramp())
    put_under(node, np.diag([1.0, 1.0, 0.0, 1.0]))
    for use in (geometry_from_node, lambda node: world_to_local(node, np.zeros((1, 3)))):
        with pytest.raises(
            InputError, match=r"'CT chest' is under a transform \('Registration' or one above it\) that makes it flat"
        ):
            use(node)


def test_a_hardened_warp_is_accepted(a_volume: Callable[..., Any]) -> None:
    node = a_volume(ramp(np.float32, (8, 8, 8)))
    put_under_a_warp(node)
    node.HardenTransform()
    assert array_from_node(node).dtype == np.float32


def test_a_colour_volume_is_refused(a_volume: Callable[..., Any]) -> None:
    node = a_volume(ramp(np.uint8, (2, 3, 4, 3)), kind="vtkMRMLVectorVolumeNode")
    with pytest.raises(InputError, match=r"3 numbers in each voxel.*expected a scalar volume"):
        geometry_from_node(node)


def test_a_node_without_voxels_is_refused(slicer_app: Any) -> None:
    node = slicer_app.scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "Empty")
    for image in (None, vtk.vtkImageData()):
        node.SetAndObserveImageData(image)
        with pytest.raises(InputError, match=r"'Empty' has no voxels.* 'Add points of another scan'"):
            geometry_from_node(node)


def test_axes_in_one_plane_are_refused(a_volume: Callable[..., Any]) -> None:
    node = a_volume(ramp())
    node.SetIJKToRASDirections(1, 0, 1, 0, 1, 0, 0, 0, 0)
    with pytest.raises(InputError, match="'CT chest' has a spacing of zero or axes that lie in one plane"):
        geometry_from_node(node)


def test_setting_an_image_is_one_modification_of_the_same_node(a_volume: Callable[..., Any]) -> None:
    node = a_volume(ramp())
    events: list[str] = []
    node.AddObserver(vtk.vtkCommand.ModifiedEvent, lambda *_: events.append("modified"))
    identity = node.GetID()
    set_image(node, ramp(np.float32, (2, 3, 7)), np.diag([2.0, 2.0, 2.0, 1.0]))
    assert events == ["modified"]
    assert node.GetID() == identity


@pytest.mark.parametrize(
    ("kind", "array"),
    [
        ("vtkMRMLScalarVolumeNode", ramp(np.float32, (3, 2, 5))),
        ("vtkMRMLScalarVolumeNode", ramp(np.uint8)[::-1, :, ::2]),
        ("vtkMRMLVectorVolumeNode", ramp(np.uint8, (3, 2, 5, 4))),
        ("vtkMRMLVectorVolumeNode", ramp(np.uint8, (3, 2, 5, 1))),
    ],
    ids=["another shape and type", "strided", "four components", "one component"],
)
def test_an_image_arrives_whole(a_volume: Callable[..., Any], kind: str, array: np.ndarray) -> None:
    """Judged by VTK's own access to single voxels."""
    node = a_volume(ramp(np.int16, (2, 2, 2)), kind=kind)
    geometry = np.diag([2.0, 3.0, 4.0, 1.0])
    set_image(node, array, geometry)
    image = node.GetImageData()
    assert image.GetDimensions() == array.shape[2::-1]
    assert image.GetNumberOfScalarComponents() == (array.shape[3] if array.ndim == 4 else 1)
    for index in [(0, 0, 0), (1, 1, 1), (0, 1, array.shape[2] - 1)]:
        for component in range(image.GetNumberOfScalarComponents()):
            expected = array[index][component] if array.ndim == 4 else array[index]
            assert image.GetScalarComponentAsDouble(*index[::-1], component) == expected
    ijk_to_ras = vtk.vtkMatrix4x4()
    node.GetIJKToRASMatrix(ijk_to_ras)
    np.testing.assert_allclose(numpy_matrix(ijk_to_ras), geometry)


def test_the_array_is_copied_into_the_node(a_volume: Callable[..., Any]) -> None:
    array = ramp()
    node = a_volume(array)
    array[:] = 0
    np.testing.assert_array_equal(array_from_node(node), ramp())


def test_a_read_only_array_can_be_set(a_volume: Callable[..., Any]) -> None:
    array = ramp()
    array.setflags(write=False)
    np.testing.assert_array_equal(array_from_node(a_volume(array)), array)


def test_an_image_of_an_array_is_that_array_and_keeps_it_as_long_as_a_node_has_it(slicer_app: Any) -> None:
    node = slicer_app.scene.AddNewNodeByClass("vtkMRMLVectorVolumeNode")
    array = ramp(np.uint8, (3, 4, 5, 4)).copy()
    kept = weakref.ref(array)
    node.SetAndObserveImageData(image_of(array))
    del array
    gc.collect()
    still = kept()
    assert still is not None
    voxels = vtk_to_numpy(node.GetImageData().GetPointData().GetScalars())
    assert np.shares_memory(voxels, still)
    np.testing.assert_array_equal(voxels.reshape(3, 4, 5, 4), still)


def test_a_copy_of_an_image_does_not_change_with_it() -> None:
    array = ramp(np.uint8, (3, 4, 5, 4))
    copy = own_copy(image_of(array))
    array += 1
    np.testing.assert_array_equal(vtk_to_numpy(copy.GetPointData().GetScalars()).reshape(array.shape), array - 1)
