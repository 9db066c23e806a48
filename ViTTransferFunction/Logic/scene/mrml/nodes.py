"""Nodes of the scene: their names, classes and display nodes."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from ...core.system.file_names import is_device

if TYPE_CHECKING:
    import slicer


_IN_NO_NAME = {"&": "＆", "<": "＜", ">": "＞", "\\": "＼"}
"""Characters that are not allowed in names of nodes, and the full-width ones that replace them."""
_FOR_SCENE = str.maketrans(_IN_NO_NAME)
_FOR_USERS = str.maketrans({wide: character for character, wide in _IN_NO_NAME.items()})
_NO_DEVICE = "＿"
"""A full-width _ before names that are names of devices on Windows."""


def name_for_scene(name: str) -> str:
    """A name that a node can have, given that Slicer names its file after it.

    Slicer does not escape an & in the file's name, and cannot read the scene again. It leaves the other characters to Windows,
    which does not accept such a file, so that the scene is not saved (`vtkMRMLScene::PercentEncode`). Files named CON or NUL
    would vanish.
    """
    return f"{_NO_DEVICE if is_device(name) else ''}{name.translate(_FOR_SCENE)}"


def name_of(node: Any) -> str:
    """A node's name as users know it, from which `name_for_scene` made the node's."""
    name: str = (node.GetName() or "").translate(_FOR_USERS)
    without = name.removeprefix(_NO_DEVICE)
    return without if is_device(without) else name


def in_text(name: str) -> str:
    """A name for a sentence, whose direction it leaves alone.

    Beside a name in Arabic or Hebrew, marks and numbers change sides, and a line that begins with one runs from the right. The
    characters around it are not seen (Unicode's isolates, UAX #9).
    """
    from_the_right = any(unicodedata.bidirectional(letter) in ("R", "AL") for letter in name)
    return f"\N{FIRST STRONG ISOLATE}{name}\N{POP DIRECTIONAL ISOLATE}" if from_the_right else name


def node_of_class(node: Any, class_name: str) -> Any:
    """The node if it is of a class or one of its subclasses, else None.

    References in a scene may lead to any node, as the scene may have been edited by hand or merged with another one.
    """
    return node if node is not None and node.IsA(class_name) else None


def nodes_of_class(scene: slicer.vtkMRMLScene, class_name: str) -> list[Any]:
    """All nodes of a class and its subclasses, in the order of the scene."""
    return [scene.GetNthNodeByClass(index, class_name) for index in range(scene.GetNumberOfNodesByClass(class_name))]


@contextmanager
def one_modification(node: Any) -> Iterator[None]:
    """Make a node report several changes once, at the end, so that nobody sees a half-changed node."""
    was_modifying = node.StartModify()
    try:
        yield
    finally:
        node.EndModify(was_modifying)


def displays_of(node: slicer.vtkMRMLDisplayableNode) -> list[Any]:
    """All display nodes of a node."""
    displays = (node.GetNthDisplayNode(index) for index in range(node.GetNumberOfDisplayNodes()))
    return [display for display in displays if display is not None]
