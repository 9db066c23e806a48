"""Volume nodes of the MRML scene, to arrays in patient space and back.

Everything numeric is done in a volume's *local* frame, its IJK-to-RAS matrix without parent transforms, so that features stay
valid when the volume is moved (`mrml/transforms.py`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonMath import vtkMatrix4x4

from ...core.system.errors import InputError
from ...core.volumes.geometry import Geometry
from ...core.volumes.volume import Volume
from ..mrml.nodes import in_text
from ..mrml.transforms import matrix_to_world, numpy_matrix, vtk_matrix


def array_from_node(node: Any) -> np.ndarray:
    """The voxels of a scalar volume node that `geometry_from_node` accepts, (K, J, I): a view on them, not a copy."""
    image = node.GetImageData()
    return vtk_to_numpy(image.GetPointData().GetScalars()).reshape(image.GetDimensions()[::-1])


def geometry_from_node(node: Any) -> Geometry:
    """The voxel grid of a scalar volume node in its local frame, whatever its voxels hold.

    Raises:
        InputError: the node has no voxels, more than one number in each, a degenerate geometry, or a parent transform
            that is not linear or leaves no volume.
    """
    name, image = in_text(node.GetName() or ""), node.GetImageData()
    scalars = image.GetPointData().GetScalars() if image else None
    if scalars is None or not scalars.GetNumberOfTuples():
        raise InputError(
            f"'{name}' has no voxels; expected a loaded volume. If its file was not found, load the scan from where it is now, "
            "choose that, and have 'Add points of another scan' bring its points along. Or choose another one."
        )
    if scalars.GetNumberOfComponents() != 1:
        raise InputError(
            f"'{name}' has {scalars.GetNumberOfComponents()} numbers in each voxel, as colour and vector volumes do; expected "
            "a scalar volume. Choose another one, or convert this one in Slicer, with the module Vector to Scalar Volume."
        )
    matrix_to_world(node)
    ijk_to_ras = vtkMatrix4x4()
    node.GetIJKToRASMatrix(ijk_to_ras)
    try:
        return Geometry(image.GetDimensions()[::-1], numpy_matrix(ijk_to_ras))
    except ValueError as error:
        raise InputError(
            f"'{name}' has a spacing of zero or axes that lie in one plane. Load the volume again, or correct it in Slicer: "
            "module Volumes, Volume Information."
        ) from error


def volume_from_node(node: Any) -> Volume:
    """A scalar volume node as the rest of the Logic knows volumes: with its own voxels, in its local frame.

    Raises:
        InputError: see `geometry_from_node`, or its voxels are nothing that can be segmented.
    """
    geometry = geometry_from_node(node)
    return Volume(array_from_node(node), geometry, node.GetName())


def set_image(node: Any, array: np.ndarray, ijk_to_ras: np.ndarray) -> None:
    """Replace voxels and geometry of a volume node, which stays the same node and reports one modification.

    Args:
        node: a scalar volume node, or a vector volume node.
        array: (K, J, I), or (K, J, I, C) with C numbers in each voxel; any real dtype. It is copied.
        ijk_to_ras: (4, 4), in the node's local frame, RAS millimetres.
    """
    take_image(node, own_copy(image_of(array)), ijk_to_ras)


def image_of(array: np.ndarray) -> vtkImageData:
    """An image whose voxels are an array itself, not a copy: (K, J, I), or (K, J, I, C) with C numbers in each voxel.

    It lives no longer than Python, and the array must not be changed meanwhile.
    """
    image = vtkImageData()
    image.SetDimensions(*array.shape[2::-1])
    image.GetPointData().SetScalars(numpy_to_vtk(_as_tuples(array)))
    return image


def own_copy(image: vtkImageData) -> vtkImageData:
    """An image with the same voxels in memory of VTK's own, which may be changed, and outlives Python."""
    copy = vtkImageData()
    copy.DeepCopy(image)
    return copy


def take_image(node: Any, image: vtkImageData, ijk_to_ras: np.ndarray) -> None:
    """Replace voxels and geometry of a volume node by an image itself; see `set_image`."""
    was_modifying = node.StartModify()
    node.SetIJKToRASMatrix(vtk_matrix(ijk_to_ras))
    node.SetAndObserveImageData(image)
    node.EndModify(was_modifying)


def _as_tuples(array: np.ndarray) -> np.ndarray:
    """One row for each voxel, in the order in which VTK stores them."""
    components = array.shape[3] if array.ndim == 4 else 1
    return np.ascontiguousarray(array).reshape(-1, components)
