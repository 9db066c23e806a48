"""Classes in the scene: two point lists each, for what belongs to a structure and for what does not.

Each class belongs to the volume that it was made on. Unless they say otherwise, the functions here are about the classes of
the chosen volume only.

The list of positive points stands for the class: its name and colour are the class's, its attributes hold the class's settings,
and it refers to the list of negative points. The parameter node refers to the lists of positive points, in order. So a saved
scene holds everything, and a user who deletes or renames a list in the Data module deletes or renames the class.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import slicer

from ...core.classes.colors import Color, default_color
from ..interface.parameters import referred
from ..mrml.added_markups import add_markups
from ..mrml.data_tree import put_into_folder
from ..mrml.nodes import displays_of, name_for_scene, name_of, node_of_class, nodes_of_class, one_modification
from ..mrml.point_lists import defined_points, points_and_properties, set_points
from .class_attributes import attribute, read_look, read_settings, set_attribute, write_settings
from .class_state import ClassState, Polarity, name_beside, new_class_id
from .of_volume import set_volume_of, volume_of

CLASS_ROLE = "class"
NEGATIVE_ROLE = "negativePoints"
LIST_CLASS = "vtkMRMLMarkupsFiducialNode"
"""MRML class of point lists."""
LABEL_FORMAT = "%d"
"""Format of the labels of points, which are hidden: just their numbers. Slicer's default contains the list's name and is given
to C's `printf`; a name such as "70% stenosis" is then taken for a format with a text, and Slicer crashes at the next point."""
_VOLUME_NAME = "volumeName"
"""Attribute of a class's list: the name of the volume that the class belongs to. It stays when the volume is removed."""


def class_nodes(parameter_node: slicer.vtkMRMLScriptedModuleNode) -> list[slicer.vtkMRMLMarkupsFiducialNode]:
    """The lists of positive points of the chosen volume's classes, in order; while none is chosen, those without a volume."""
    volume = referred(parameter_node, "volume")
    return [node for node in class_nodes_of_all(parameter_node) if volume_of(node) is volume]


def class_nodes_of_all(parameter_node: slicer.vtkMRMLScriptedModuleNode) -> list[slicer.vtkMRMLMarkupsFiducialNode]:
    """The lists of positive points of the classes of all volumes, in order; if a class has several, only the first.

    Where a scene was added to an earlier or later state of itself, classes of two volumes may have the same id.
    """
    count = parameter_node.GetNumberOfNodeReferences(CLASS_ROLE)
    nodes = (_point_list(parameter_node.GetNthNodeReference(CLASS_ROLE, n), "positive") for n in range(count))
    first: dict[tuple[str, Any], slicer.vtkMRMLMarkupsFiducialNode] = {}
    for node in nodes:
        if node is not None and class_id(node):
            first.setdefault((class_id(node), volume_of(node)), node)
    return list(first.values())


def negative_node(positive: slicer.vtkMRMLMarkupsFiducialNode) -> slicer.vtkMRMLMarkupsFiducialNode | None:
    """A class's list of negative points; None where the user deleted it."""
    return _point_list(positive.GetNodeReference(NEGATIVE_ROLE), "negative")


def class_id(positive: slicer.vtkMRMLMarkupsFiducialNode) -> str:
    """The id of the class that a list of positive points stands for."""
    return attribute(positive, "class") or ""


def lists_of(positive: slicer.vtkMRMLMarkupsFiducialNode) -> list[slicer.vtkMRMLMarkupsFiducialNode]:
    """A class's lists of points."""
    return [node for node in (positive, negative_node(positive)) if node is not None]


def points_are_in_files(parameter_node: slicer.vtkMRMLScriptedModuleNode) -> bool:
    """Whether no list of points of any volume's classes has changed since it was read or saved, according to Slicer."""
    lists = (node for positive in class_nodes_of_all(parameter_node) for node in lists_of(positive))
    return not any(node.GetModifiedSinceRead() for node in lists if node.GetNumberOfControlPoints())


def is_list_of_a_class(node: slicer.vtkMRMLNode) -> bool:
    """Whether a node is a class's list of positive or negative points."""
    return attribute(node, "polarity") is not None


def read_class(positive: slicer.vtkMRMLMarkupsFiducialNode) -> ClassState:
    """The class as it is in the scene; settings that are missing there or cannot be read have their defaults."""
    negative = negative_node(positive)
    display = positive.GetDisplayNode() or (negative.GetDisplayNode() if negative else None)
    color = tuple(display.GetSelectedColor()) if display else default_color(0)
    on_it, of_on_it = points_and_properties(positive)
    off_it, of_off_it = points_and_properties(negative) if negative else ((), {})
    return ClassState(
        class_id(positive),
        name_of(positive),
        read_look(positive, color),
        **read_settings(positive),
        positive=on_it,
        negative=off_it,
        positive_properties=of_on_it,
        negative_properties=of_off_it,
    )


def create_class(
    scene: slicer.vtkMRMLScene, parameter_node: slicer.vtkMRMLScriptedModuleNode, state: ClassState
) -> slicer.vtkMRMLMarkupsFiducialNode:
    """Add a class to the scene, after the others; returns its list of positive points."""
    positive = _create_list(scene, "positive")
    set_attribute(positive, "class", state.id)
    _create_negative(scene, positive)
    write_class(scene, positive, state)
    volume = referred(parameter_node, "volume")
    if volume is not None:
        _give_to(volume, positive)
    parameter_node.AddNodeReferenceID(CLASS_ROLE, positive.GetID())
    return positive


def adopt_class(parameter_node: slicer.vtkMRMLScriptedModuleNode, positive: slicer.vtkMRMLMarkupsFiducialNode) -> None:
    """Add a class from another scene, whose lists are in this one already, after the others, with a name and id of its own."""
    present = class_nodes_of_all(parameter_node)
    _tell_apart(positive, [node for node in present if volume_of(node) is volume_of(positive)])
    parameter_node.AddNodeReferenceID(CLASS_ROLE, positive.GetID())


def give_to_volume(
    volume: slicer.vtkMRMLScalarVolumeNode, positive: Sequence[slicer.vtkMRMLMarkupsFiducialNode]
) -> list[slicer.vtkMRMLMarkupsFiducialNode]:
    """Make the classes that never belonged to a volume belong to this one, with names and ids that its classes do not have.

    Such classes were made before a volume was chosen, or by a version that had one set of classes for all volumes.

    Args:
        volume: the volume that gets them.
        positive: lists of positive points of classes; those that belong or belonged to a volume are left as they are.

    Returns:
        The lists of the classes that the volume got.
    """
    new = [node for node in positive if attribute(node, _VOLUME_NAME) is None]
    present = [node for node in positive if volume_of(node) is volume]
    for node in new:
        _tell_apart(node, present)
        _give_to(volume, node)
        present.append(node)
    return new


def volume_name(positive: slicer.vtkMRMLMarkupsFiducialNode) -> str:
    """Name of the volume that a class belongs to; if it was removed, the name that it had when it got the class."""
    volume = volume_of(positive)
    return (volume.GetName() if volume is not None else attribute(positive, _VOLUME_NAME)) or ""


def keep_from_other_volumes(positive: slicer.vtkMRMLMarkupsFiducialNode, names: dict[str, str]) -> None:
    """Keep a class whose volume was removed from being given to another one, also after the class was removed and restored.

    Args:
        positive: the class's list of positive points.
        names: names of such volumes by class id. The name is noted there, or restored from there if the list has lost it.
    """
    if volume_of(positive) is None:
        name = attribute(positive, _VOLUME_NAME)
        if name is not None:
            names[class_id(positive)] = name
        elif class_id(positive) in names:
            set_attribute(positive, _VOLUME_NAME, names[class_id(positive)])


def write_class(scene: slicer.vtkMRMLScene, positive: slicer.vtkMRMLMarkupsFiducialNode, state: ClassState) -> None:
    """Change a class in the scene to `state`. Only differences are written, so that single hidden points stay hidden."""
    negative = negative_node(positive) or _create_negative(scene, positive)
    shown_or_hidden = read_settings(positive)["visible"] != state.visible
    _set_name(positive, state.name)
    _set_name(negative, _outside(state.name))
    of_positive = positive, state.positive, state.positive_properties
    of_negative = negative, state.negative, state.negative_properties
    for node, points, properties in (of_positive, of_negative):
        _set_color(node, state.color)
        if shown_or_hidden:
            _set_visible(node, state.visible)
        if defined_points(node) != points:
            set_points(node, points, properties)
    write_settings(positive, state)


def let_negative_follow(positive: slicer.vtkMRMLMarkupsFiducialNode) -> None:
    """Give a class's list of negative points the name and colour of the positive one, which users may have changed."""
    negative = negative_node(positive)
    # During an import, display nodes may still be missing.
    if negative is not None and positive.GetDisplayNode() is not None and negative.GetDisplayNode() is not None:
        _set_name(negative, _outside(name_of(positive)))
        _set_color(negative, positive.GetDisplayNode().GetSelectedColor())


def write_classes(
    scene: slicer.vtkMRMLScene, parameter_node: slicer.vtkMRMLScriptedModuleNode, states: Sequence[ClassState]
) -> None:
    """Make the classes in the scene equal to `states`, in this order: missing ones are added, all others are removed."""
    present = {class_id(node): node for node in class_nodes(parameter_node)}
    with one_modification(parameter_node):
        for id_ in present.keys() - {state.id for state in states}:
            remove_class(scene, present[id_])
        for state in states:
            if state.id in present:
                write_class(scene, present[state.id], state)
            else:
                create_class(scene, parameter_node, state)
        order_classes(parameter_node, [state.id for state in states])


def remove_class(scene: slicer.vtkMRMLScene, positive: slicer.vtkMRMLMarkupsFiducialNode) -> None:
    """Remove a class's two lists and their display nodes from the scene."""
    _remove_lists(scene, lists_of(positive)[::-1])


def remove_widowed_lists(scene: slicer.vtkMRMLScene, negative: Collection[slicer.vtkMRMLMarkupsFiducialNode]) -> None:
    """Remove the lists of negative points whose class is gone, because its positive list was deleted in Slicer.

    Args:
        scene: the scene.
        negative: the negative lists of classes. Copies that the user made of lists are not among them, and stay.
    """
    lists = nodes_of_class(scene, LIST_CLASS)
    wanted = {node.GetNodeReferenceID(NEGATIVE_ROLE) for node in lists}
    _remove_lists(scene, [node for node in lists if node in negative and node.GetID() not in wanted])


def order_classes(parameter_node: slicer.vtkMRMLScriptedModuleNode, ids: list[str]) -> None:
    """Put the classes into the order of `ids`, which has each id once."""
    by_id = {class_id(node): node for node in class_nodes(parameter_node)}
    if list(by_id) != ids:
        others = [node for node in class_nodes_of_all(parameter_node) if node not in by_id.values()]
        with one_modification(parameter_node):
            parameter_node.RemoveNodeReferenceIDs(CLASS_ROLE)
            for node in (*others, *(by_id[id_] for id_ in ids)):
                parameter_node.AddNodeReferenceID(CLASS_ROLE, node.GetID())


def _point_list(node: slicer.vtkMRMLNode | None, polarity: Polarity) -> slicer.vtkMRMLMarkupsFiducialNode | None:
    """The node if it is a class's list of points of this polarity, else None."""
    points = node_of_class(node, LIST_CLASS)
    return points if points is not None and attribute(points, "polarity") == polarity else None


def _give_to(volume: slicer.vtkMRMLScalarVolumeNode, positive: slicer.vtkMRMLMarkupsFiducialNode) -> None:
    set_volume_of(positive, volume)
    set_attribute(positive, _VOLUME_NAME, volume.GetName() or "")


def _tell_apart(positive: slicer.vtkMRMLMarkupsFiducialNode, present: Sequence[slicer.vtkMRMLMarkupsFiducialNode]) -> None:
    """Give a class a name and an id that none of the present ones has."""
    _set_name(positive, name_beside(name_of(positive), {name_of(node) for node in present}))
    if class_id(positive) in map(class_id, present):
        set_attribute(positive, "class", new_class_id())


def _create_list(scene: slicer.vtkMRMLScene, polarity: Polarity) -> slicer.vtkMRMLMarkupsFiducialNode:
    node: slicer.vtkMRMLMarkupsFiducialNode = add_markups(scene, LIST_CLASS)
    node.SetControlPointLabelFormat(LABEL_FORMAT)
    set_attribute(node, "polarity", polarity)
    _create_display(node)
    put_into_folder(scene, node)
    return node


def _create_negative(
    scene: slicer.vtkMRMLScene, positive: slicer.vtkMRMLMarkupsFiducialNode
) -> slicer.vtkMRMLMarkupsFiducialNode:
    negative = _create_list(scene, "negative")
    _set_visible(negative, read_settings(positive)["visible"])
    positive.SetNodeReferenceID(NEGATIVE_ROLE, negative.GetID())
    return negative


def _create_display(node: slicer.vtkMRMLMarkupsFiducialNode) -> slicer.vtkMRMLMarkupsDisplayNode:
    node.CreateDefaultDisplayNodes()
    display = node.GetDisplayNode()
    # Distinguishable without colour: a dot for points inside the structure, a cross for those outside.
    negative = attribute(node, "polarity") == "negative"
    display.SetGlyphType(display.ThickCross2D if negative else display.Sphere3D)
    display.SetGlyphScale(2.0)
    display.SetPointLabelsVisibility(False)
    display.SetPropertiesLabelVisibility(False)
    return display


def _outside(name: str) -> str:
    """Name of the list of negative points of a class with this name."""
    return f"{name} – outside"


def _set_name(node: slicer.vtkMRMLMarkupsFiducialNode, name: str) -> None:
    if node.GetName() != name_for_scene(name):
        # Before the name changes, since lists from earlier versions have Slicer's default format (`LABEL_FORMAT`).
        node.SetControlPointLabelFormat(LABEL_FORMAT)
        node.SetName(name_for_scene(name))


def _set_color(node: slicer.vtkMRMLMarkupsFiducialNode, color: Color) -> None:
    display = _display_of(node)
    if display.GetSelectedColor() != color:
        display.SetSelectedColor(*color)
        display.SetColor(*color)


def _set_visible(node: slicer.vtkMRMLMarkupsFiducialNode, visible: bool) -> None:
    display = _display_of(node)
    if bool(display.GetVisibility()) != visible:
        display.SetVisibility(visible)


def _display_of(node: slicer.vtkMRMLMarkupsFiducialNode) -> slicer.vtkMRMLMarkupsDisplayNode:
    """The display node of a list of points, created if it is missing."""
    return node.GetDisplayNode() or _create_display(node)


def _remove_lists(scene: slicer.vtkMRMLScene, lists: Sequence[slicer.vtkMRMLMarkupsFiducialNode]) -> None:
    displays = [display for node in lists for display in displays_of(node)]
    for node in (*lists, *displays):
        if scene.IsNodePresent(node):
            scene.RemoveNode(node)
