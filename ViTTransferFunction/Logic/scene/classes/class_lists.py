"""The point lists of all classes as nodes of the scene: which are seen, which have lost their class, which were moved."""

from __future__ import annotations

from collections.abc import Sequence

import slicer

from ...core.system.errors import InputError
from ..mrml.transforms import matrix_to_world
from .class_nodes import class_nodes_of_all, keep_from_other_volumes, lists_of, remove_widowed_lists
from .of_volume import bring_back, put_away


class ClassLists:
    """Looks after the lists that classes lie in.

    Args:
        scene: the scene.
        parameter_node: refers to the classes of all volumes.
    """

    def __init__(self, scene: slicer.vtkMRMLScene, parameter_node: slicer.vtkMRMLScriptedModuleNode) -> None:
        self._scene = scene
        self._parameter_node = parameter_node
        self._negative: set[slicer.vtkMRMLMarkupsFiducialNode] = set()
        self._transforms: dict[slicer.vtkMRMLMarkupsFiducialNode, bytes | None] = {}
        self._gone_volumes: dict[str, str] = {}  # What those were called whose classes are still there, by the class's id.

    def forget(self) -> None:
        """The scene is another one."""
        self._negative.clear()
        self._transforms.clear()
        self._gone_volumes.clear()

    def show_only(self, lists: Sequence[slicer.vtkMRMLMarkupsFiducialNode]) -> None:
        """Have no other lists seen: points of one scan are nowhere in particular in another one."""
        self._forget_gone()
        shown = set(lists)
        for positive in class_nodes_of_all(self._parameter_node):
            self._negative.update(lists_of(positive)[1:])
            keep_from_other_volumes(positive, self._gone_volumes)
            for node in lists_of(positive):
                (bring_back if node in shown else put_away)(node)

    def remove_widowed(self) -> None:
        """Remove lists of negative points whose class is gone."""
        remove_widowed_lists(self._scene, self._negative)

    def have_moved(self, lists: Sequence[slicer.vtkMRMLMarkupsFiducialNode]) -> bool:
        """Whether a transform has moved one of some lists since the last call about it."""
        before, now = self._transforms, {node: _transform_of(node) for node in lists}
        self._transforms = before | now
        return any(before.get(node, matrix) != matrix for node, matrix in now.items())

    def _forget_gone(self) -> None:
        """Let go of lists that are not in the scene any more, whoever removed them."""
        self._negative = {node for node in self._negative if node.GetScene() is not None}
        self._transforms = {node: at for node, at in self._transforms.items() if node.GetScene() is not None}


def _transform_of(node: slicer.vtkMRMLMarkupsFiducialNode) -> bytes | None:
    """All transforms that a list is under; None where no matrix says them."""
    try:
        return matrix_to_world(node).tobytes()
    except InputError:
        return None
