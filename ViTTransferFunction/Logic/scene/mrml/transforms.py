"""Parent transforms of nodes as matrices, and conversion of VTK's matrices.

Only linear transforms can be inverted exactly, so others are refused.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from vtkmodules.vtkCommonMath import vtkMatrix4x4

from ...core.system.errors import InputError
from ...core.volumes.geometry import transform_points
from .nodes import in_text


def world_to_local(node: Any, points_ras: np.ndarray) -> np.ndarray:
    """Convert points (N, 3), RAS millimetres, from the scene's frame to the local frame of `node`.

    Raises:
        InputError: as `matrix_to_world`.
    """
    return transform_points(np.linalg.inv(matrix_to_world(node)), points_ras)


def matrix_to_world(node: Any) -> np.ndarray:
    """All parent transforms of `node` in one (4, 4) float64 matrix, from its local frame to the scene's.

    Raises:
        InputError: one of them is not linear, or makes the node flat.
    """
    matrix, parent = vtkMatrix4x4(), node.GetParentTransformNode()
    name, above = (in_text(one.GetName() or "") if one is not None else "" for one in (node, parent))
    # Checked first, because VTK prints an error if it is asked for a matrix that does not exist.
    if parent is not None and not parent.IsTransformToWorldLinear():
        raise InputError(
            f"'{name}' is under a non-linear transform ('{above}' or one above it), such as Slicer gives "
            "scans whose slices lie at uneven distances. Harden it in Slicer, in the module Data: right-click the transform "
            f"icon of '{name}', Harden transform."
        )
    if parent is not None:
        parent.GetMatrixTransformToWorld(matrix)
        if not matrix.Determinant():
            raise InputError(
                f"'{name}' is under a transform ('{above}' or one above it) that makes it flat. Correct "
                "its matrix in Slicer, in the module Transforms."
            )
    return numpy_matrix(matrix)


def numpy_matrix(matrix: vtkMatrix4x4) -> np.ndarray:
    """A VTK matrix as a (4, 4) float64 array."""
    return np.array([[matrix.GetElement(row, column) for column in range(4)] for row in range(4)])


def vtk_matrix(matrix: np.ndarray) -> vtkMatrix4x4:
    """A (4, 4) array as a VTK matrix."""
    converted = vtkMatrix4x4()
    converted.DeepCopy(np.asarray(matrix, dtype=np.float64).ravel().tolist())
    return converted
