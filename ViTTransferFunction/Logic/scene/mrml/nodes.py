"""Nodes of the scene by their class."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from ...core.system.file_names import is_device

if TYPE_CHECKING:
    import slicer


_IN_NO_NAME = {"&": "＆", "<": "＜", ">": "＞", "\\": "＼"}
"""Characters that names of nodes may not have, and the wide ones that look like them."""
_FOR_SCENE = str.maketrans(_IN_NO_NAME)
_FOR_USERS = str.maketrans({wide: character for character, wide in _IN_NO_NAME.items()})
_NO_DEVICE = "＿"
"""Before a name that Windows has for a device: a wide _."""


def name_for_scene(name: str) -> str:
    """As a node may be called, whose file Slicer names after it.

    It writes an & in that name as it is, and cannot read the scene again; the others it leaves to Windows, which takes no such
    file, so that the scene is not saved (`vtkMRMLScene::PercentEncode`). What is written to CON or NUL is nowhere.
    """
    return f"{_NO_DEVICE if is_device(name) else ''}{name.translate(_FOR_SCENE)}"


def name_of(node: Any) -> str:
    """What was given a node by `name_for_scene`."""
    name: str = (node.GetName() or "").translate(_FOR_USERS)
    without = name.removeprefix(_NO_DEVICE)
    return without if is_device(without) else name


def node_of_class(node: Any, class_name: str) -> Any:
    """A node that is of a class or a subclass of it; None in place of any other.

    What a scene refers to may be anything: it may have been written by hand, or merged with another one.
    """
    return node if node is not None and node.IsA(class_name) else None


def nodes_of_class(scene: slicer.vtkMRMLScene, class_name: str) -> list[Any]:
    """All nodes of a class and its subclasses, in the order of the scene."""
    return [scene.GetNthNodeByClass(index, class_name) for index in range(scene.GetNumberOfNodesByClass(class_name))]


@contextmanager
def one_modification(node: Any) -> Iterator[None]:
    """Have a node tell of what is changed about it meanwhile once, in the end: in between, half of it is as it was."""
    was_modifying = node.StartModify()
    try:
        yield
    finally:
        node.EndModify(was_modifying)


def displays_of(node: slicer.vtkMRMLDisplayableNode) -> list[Any]:
    """All nodes that say how a node is displayed."""
    displays = (node.GetNthDisplayNode(index) for index in range(node.GetNumberOfDisplayNodes()))
    return [display for display in displays if display is not None]
