"""Classes in the scene: two point lists each, for what belongs to a structure and for what does not.

The list of positive points stands for the class: its name and colour are the class's, its attributes hold the class's settings,
and it refers to the list of negative points. The parameter node refers to the lists of positive points, in order. So a saved
scene holds everything, and a user who deletes or renames a list in the Data module deletes or renames the class.
"""

from __future__ import annotations

import math
import uuid
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal

import numpy as np
import slicer

from ..core.close_up import CloseUp
from ..core.colors import Color, default_color
from ..core.errors import InputError
from ..core.iso_proposals import LARGEST_SIZE, SMALLEST_SIZE
from ..rendering.appearance import OF_STYLE, STYLES, Appearance
from .data_tree import put_into_folder
from .nodes import displays_of, name_for_scene, name_of, node_of_class, nodes_of_class
from .point_lists import Point, PropertiesByPoint, defined_points, points_and_properties, set_points

CLASS_ROLE = "class"
NEGATIVE_ROLE = "negativePoints"
LIST_CLASS = "vtkMRMLMarkupsFiducialNode"
"""Of lists of points."""
_PREFIX = "ViTTransferFunction."

CloseUpBox = tuple[float, float, float, float, float, float]
"""Of a class, see `ClassState`."""

EdgesMm = tuple[float, float, float]
"""Of a box, along the volume's axes I, J and K, millimetres."""

Polarity = Literal["positive", "negative"]


@dataclass(frozen=True)
class ClassState:
    """Everything about a class that the user decides, as values: what undo brings back.

    Attributes:
        id: stays the same when everything else changes.
        name: what the user calls it.
        look: how it is shown: its colour everywhere, all else in 3D.
        iso: threshold in [0, 1]; None: chosen from the annotations.
        size: offset from what is chosen, see `ClassRequest`; 0 where there is an `iso`.
        proximity: in [0, 1]; see `ClassRequest`.
        refine: whether its map is sharpened.
        close_up: the box in which it is looked at by itself: R, A and S of its centre, in the scene's coordinates, and its
            edges along the volume's axes, millimetres; None: in the whole volume.
        visible: whether it is shown.
        positive: points on the structure, in the scene's coordinates.
        negative: points off it.
        continues: ID of the segment that the class was begun from, which its own segment may overlap; empty: there is none.
        positive_properties: what else users may say of the points on the structure; no part of comparisons.
        negative_properties: of the points off it.
    """

    id: str
    name: str
    look: Appearance
    iso: float | None = None
    size: float = 0.0
    proximity: float = 0.0
    refine: bool = True
    close_up: CloseUpBox | None = None
    visible: bool = True
    positive: tuple[Point, ...] = ()
    negative: tuple[Point, ...] = ()
    continues: str = ""
    positive_properties: PropertiesByPoint = field(default_factory=dict, compare=False)
    negative_properties: PropertiesByPoint = field(default_factory=dict, compare=False)

    @property
    def color(self) -> Color:
        """Red, green, blue in [0, 1]."""
        return self.look.color


LOOK = tuple(each.name for each in fields(Appearance) if each.name != "color")
"""The fields of a class's `Appearance` that are attributes of the list of positive points; its colour is the list's own."""
SETTINGS = ("iso", "size", "proximity", "refine", "visible")
"""The fields of `ClassState` that are."""
_ANY = (-math.inf, math.inf)
_RANGES = {"size": (SMALLEST_SIZE, LARGEST_SIZE), "low": _ANY, "high": _ANY}
"""Of numbers among them that are no shares in [0, 1]."""


def changed(state: ClassState, **changes: Any) -> ClassState:
    """A class with other values of fields: its own, or those of its look. Another style brings its own of what it decides."""
    look = {name: changes.pop(name) for name in ("color", *LOOK) if name in changes}
    if "style" in look:
        look = dict.fromkeys(OF_STYLE) | look
    return replace(state, look=replace(state.look, **look), **changes)


def class_nodes(parameter_node: slicer.vtkMRMLScriptedModuleNode) -> list[slicer.vtkMRMLMarkupsFiducialNode]:
    """The lists of positive points of all classes, in order; of several of one class the first."""
    count = parameter_node.GetNumberOfNodeReferences(CLASS_ROLE)
    nodes = (_point_list(parameter_node.GetNthNodeReference(CLASS_ROLE, n), "positive") for n in range(count))
    by_id: dict[str, slicer.vtkMRMLMarkupsFiducialNode] = {}
    for node in nodes:
        if node is not None and class_id(node):
            by_id.setdefault(class_id(node), node)
    return list(by_id.values())


def negative_node(positive: slicer.vtkMRMLMarkupsFiducialNode) -> slicer.vtkMRMLMarkupsFiducialNode | None:
    """A class's list of negative points; None where the user deleted it."""
    return _point_list(positive.GetNodeReference(NEGATIVE_ROLE), "negative")


def _point_list(node: slicer.vtkMRMLNode | None, polarity: Polarity) -> slicer.vtkMRMLMarkupsFiducialNode | None:
    """A node that is a class's list of points of this polarity; None in place of any other."""
    points = node_of_class(node, LIST_CLASS)
    return points if points is not None and points.GetAttribute(f"{_PREFIX}polarity") == polarity else None


def class_id(positive: slicer.vtkMRMLMarkupsFiducialNode) -> str:
    """The id of the class that a list of positive points stands for."""
    return positive.GetAttribute(f"{_PREFIX}class")


def is_list_of_a_class(node: slicer.vtkMRMLNode) -> bool:
    """Whether a node holds the points of a class, positive or negative ones."""
    return node.GetAttribute(f"{_PREFIX}polarity") is not None


def read_class(positive: slicer.vtkMRMLMarkupsFiducialNode) -> ClassState:
    """The class as it is in the scene; settings that the scene does not hold, or holds garbled, have their defaults."""
    negative, display = negative_node(positive), positive.GetDisplayNode()
    color = tuple(display.GetSelectedColor()) if display else default_color(0)
    on_it, of_on_it = points_and_properties(positive)
    off_it, of_off_it = points_and_properties(negative) if negative else ((), {})
    return ClassState(
        class_id(positive),
        name_of(positive),
        Appearance(color, **_read_attributes(positive, Appearance, LOOK)),
        **_read_attributes(positive, ClassState, SETTINGS),
        positive=on_it,
        negative=off_it,
        close_up=_read_close_up(positive),
        continues=positive.GetAttribute(f"{_PREFIX}continues") or "",
        positive_properties=of_on_it,
        negative_properties=of_off_it,
    )


def sharing(state: ClassState, before: ClassState | None) -> ClassState:
    """A class as it is, made of the objects that it was made of before wherever it has not changed.

    Undo keeps hundreds of states, and a class may have thousands of points.
    """
    if before is None:
        return state
    parts: dict[str, Any] = {}
    for polarity in ("positive", "negative"):
        properties, known = (getattr(each, f"{polarity}_properties") for each in (state, before))
        same = {point: point for point in getattr(before, polarity)}
        parts[polarity] = tuple(same.get(point, point) for point in getattr(state, polarity))
        parts[f"{polarity}_properties"] = {
            same.get(point, point): known[point] if known.get(point) == said else said for point, said in properties.items()
        }
    unchanged = state == before and all(getattr(before, name) == part for name, part in parts.items())
    return before if unchanged else replace(state, **parts)


def create_class(
    scene: slicer.vtkMRMLScene, parameter_node: slicer.vtkMRMLScriptedModuleNode, state: ClassState
) -> slicer.vtkMRMLMarkupsFiducialNode:
    """Add a class to the scene, after the others; returns its list of positive points."""
    positive = _create_list(scene, "positive")
    positive.SetAttribute(f"{_PREFIX}class", state.id)
    _create_negative(scene, positive)
    write_class(scene, positive, state)
    parameter_node.AddNodeReferenceID(CLASS_ROLE, positive.GetID())
    return positive


def adopt_class(parameter_node: slicer.vtkMRMLScriptedModuleNode, positive: slicer.vtkMRMLMarkupsFiducialNode) -> None:
    """Count a class of another scene, whose lists are in this one, after the others; as another class than any of these."""
    present = class_nodes(parameter_node)
    _set_name(positive, name_beside(name_of(positive), {name_of(node) for node in present}))
    if class_id(positive) in map(class_id, present):
        positive.SetAttribute(f"{_PREFIX}class", _new_id())
    parameter_node.AddNodeReferenceID(CLASS_ROLE, positive.GetID())


def write_class(scene: slicer.vtkMRMLScene, positive: slicer.vtkMRMLMarkupsFiducialNode, state: ClassState) -> None:
    """Bring a class in the scene to `state`; what is equal is not touched."""
    negative = negative_node(positive) or _create_negative(scene, positive)
    _set_name(positive, state.name)
    _set_name(negative, f"{state.name} – outside")
    of_positive = positive, state.positive, state.positive_properties
    of_negative = negative, state.negative, state.negative_properties
    for node, points, properties in (of_positive, of_negative):
        _set_color(node, state.color)
        _set_visible(node, state.visible)
        if defined_points(node) != points:
            set_points(node, points, properties)
    for holder, names in ((state, SETTINGS), (state.look, LOOK)):
        present = _read_attributes(positive, type(holder), names)
        for name, value in ((name, getattr(holder, name)) for name in names):
            if present[name] != value:
                positive.SetAttribute(f"{_PREFIX}{name}", None if value is None else str(value))
    if _read_close_up(positive) != state.close_up:
        box = None if state.close_up is None else " ".join(map(repr, state.close_up))
        positive.SetAttribute(f"{_PREFIX}closeUp", box)
    if (positive.GetAttribute(f"{_PREFIX}continues") or "") != state.continues:
        positive.SetAttribute(f"{_PREFIX}continues", state.continues or None)


def remove_class(scene: slicer.vtkMRMLScene, positive: slicer.vtkMRMLMarkupsFiducialNode) -> None:
    """Take a class's two lists out of the scene, and what displays them."""
    _remove_lists(scene, [node for node in (negative_node(positive), positive) if node is not None])


def remove_widowed_lists(scene: slicer.vtkMRMLScene, negative: Collection[slicer.vtkMRMLMarkupsFiducialNode]) -> None:
    """Take those negative points of classes out of the scene whose class is gone.

    Whoever deletes a list in Slicer deletes the positive one. A copy that the user made of a list is not among the classes'.
    """
    lists = nodes_of_class(scene, LIST_CLASS)
    wanted = {node.GetNodeReferenceID(NEGATIVE_ROLE) for node in lists}
    _remove_lists(scene, [node for node in lists if node in negative and node.GetID() not in wanted])


def _remove_lists(scene: slicer.vtkMRMLScene, lists: Sequence[slicer.vtkMRMLMarkupsFiducialNode]) -> None:
    displays = [display for node in lists for display in displays_of(node)]
    for node in (*lists, *displays):
        if scene.IsNodePresent(node):
            scene.RemoveNode(node)


def order_classes(parameter_node: slicer.vtkMRMLScriptedModuleNode, ids: list[str]) -> None:
    """Bring the classes into the order of `ids`, which names each once."""
    by_id = {class_id(node): node for node in class_nodes(parameter_node)}
    if list(by_id) != ids:
        parameter_node.RemoveNodeReferenceIDs(CLASS_ROLE)
        for id_ in ids:
            parameter_node.AddNodeReferenceID(CLASS_ROLE, by_id[id_].GetID())


def new_class_state(existing: list[ClassState], name: str | None = None, color: Color | None = None) -> ClassState:
    """A class without points, of a name that no other class has, and a colour that none has unless it is given.

    Args:
        existing: the other classes.
        name: of the class; where another one has it, a number follows.
        color: of the class.
    """
    taken = {state.name for state in existing}
    if not name:
        name = next(numbered for n in range(1, len(existing) + 2) if (numbered := f"Structure {n}") not in taken)
    used = {tuple(np.round(state.color, 2)) for state in existing}
    free = (n for n in range(len(existing) + 1) if tuple(np.round(default_color(n), 2)) not in used)
    look = Appearance(color or default_color(next(free, len(existing))))
    return ClassState(_new_id(), name_beside(name, taken), look)


def name_beside(name: str, taken: Collection[str]) -> str:
    """A name that is not taken: this one, or with a number after it; files and tables tell classes apart by their names."""
    numbered = (f"{name} ({n})" for n in range(2, len(taken) + 2))
    return name if name not in taken else next(name for name in numbered if name not in taken)


def _new_id() -> str:
    return uuid.uuid4().hex[:12]


def duplicate_class_state(existing: list[ClassState], original: ClassState) -> ClassState:
    """A class with the settings and points of `original`, but a name and colour of its own."""
    fresh = new_class_state(existing, f"{original.name} copy")
    # Its points get labels with its own name.
    return changed(original, id=fresh.id, name=fresh.name, color=fresh.color, positive_properties={}, negative_properties={})


def _create_list(scene: slicer.vtkMRMLScene, polarity: Polarity) -> slicer.vtkMRMLMarkupsFiducialNode:
    node = scene.AddNewNodeByClass(LIST_CLASS)
    node.SetAttribute(f"{_PREFIX}polarity", polarity)
    _create_display(node)
    put_into_folder(scene, node)
    return node


def _display_of(node: slicer.vtkMRMLMarkupsFiducialNode) -> slicer.vtkMRMLMarkupsDisplayNode:
    """What displays a list of points, made where it is missing."""
    return node.GetDisplayNode() or _create_display(node)


def _create_display(node: slicer.vtkMRMLMarkupsFiducialNode) -> slicer.vtkMRMLMarkupsDisplayNode:
    node.CreateDefaultDisplayNodes()
    display = node.GetDisplayNode()
    # Told apart without colour: what belongs to the structure is a dot, what does not is a cross.
    negative = node.GetAttribute(f"{_PREFIX}polarity") == "negative"
    display.SetGlyphType(display.ThickCross2D if negative else display.Sphere3D)
    display.SetGlyphScale(2.0)
    display.SetPointLabelsVisibility(False)
    display.SetPropertiesLabelVisibility(False)
    return display


def _create_negative(
    scene: slicer.vtkMRMLScene, positive: slicer.vtkMRMLMarkupsFiducialNode
) -> slicer.vtkMRMLMarkupsFiducialNode:
    negative = _create_list(scene, "negative")
    positive.SetNodeReferenceID(NEGATIVE_ROLE, negative.GetID())
    return negative


def _read_attributes(positive: slicer.vtkMRMLMarkupsFiducialNode, kind: type, names: Sequence[str]) -> dict[str, Any]:
    """Fields of a dataclass as attributes of the list say; what they do not, or garbled, as the class has by default."""
    values: dict[str, Any] = {}
    for name in names:
        default = getattr(kind, name)
        text = positive.GetAttribute(f"{_PREFIX}{name}")
        values[name] = default
        if text in ("True", "False"):
            values[name] = text == "True"
        elif isinstance(default, str):
            values[name] = text if text in STYLES else default
        elif text is not None:
            values[name] = _number(text, _RANGES.get(name, (0.0, 1.0)), default)
    return values


def _read_close_up(positive: slicer.vtkMRMLMarkupsFiducialNode) -> CloseUpBox | None:
    """A class's close-up; None where the list has none, or a garbled one."""
    words = (positive.GetAttribute(f"{_PREFIX}closeUp") or "").split()
    try:
        r, a, s, *size = (float(word) for word in words)
        close_up = CloseUp((r, a, s), tuple(size))  # type: ignore[arg-type]
    except (ValueError, InputError):
        return None
    return (*close_up.centre_ras, *close_up.size_mm)


def _number(text: str, between: tuple[float, float], default: float | None) -> float | None:
    """A number in a range; the default where the text is no such number: a scene may come from anywhere."""
    try:
        number = float(text)
    except ValueError:
        return default
    if not math.isfinite(number):
        return default
    return number if between[0] <= number <= between[1] else default


def _set_name(node: slicer.vtkMRMLNode, name: str) -> None:
    if node.GetName() != name_for_scene(name):
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
