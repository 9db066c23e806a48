"""A class as values: everything about it that the user decides, wherever it is kept."""

from __future__ import annotations

import re
import uuid
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal

import numpy as np

from ...core.classes.colors import Color, default_color
from ...rendering.appearance import OF_STYLE, Appearance
from ..mrml.point_lists import Point, PropertiesByPoint

CloseUpBox = tuple[float, float, float, float, float, float]
"""Of a class, see `ClassState`."""

Polarity = Literal["positive", "negative"]

UNNAMED = "Structure"
"""What a class is called, with a number, until the user gives it a name."""

PointsByClass = dict[str, tuple[tuple[Point, ...], tuple[Point, ...]]]
"""Positive and negative points, by the id of their class; of classes that have some."""


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


Classes = tuple[ClassState, ...]
"""All classes of a volume, in order."""

_OF_LOOK = tuple(each.name for each in fields(Appearance))


def changed(state: ClassState, **changes: Any) -> ClassState:
    """A class with other values of fields: its own, or those of its look. Another style brings its own of what it decides."""
    look = {name: changes.pop(name) for name in _OF_LOOK if name in changes}
    if "style" in look:
        look = dict.fromkeys(OF_STYLE) | look
    return replace(state, look=replace(state.look, **look), **changes)


def new_class_state(existing: Sequence[ClassState], name: str | None = None, color: Color | None = None) -> ClassState:
    """A class without points, of a name that no other class has, and a colour that none has unless it is given.

    Args:
        existing: the other classes.
        name: of the class; where another one has it, a number follows.
        color: of the class.
    """
    taken = {state.name for state in existing}
    if not name:
        name = next(numbered for n in range(1, len(existing) + 2) if (numbered := f"{UNNAMED} {n}") not in taken)
    used = {tuple(np.round(state.color, 2)) for state in existing}
    free = (n for n in range(len(existing) + 1) if tuple(np.round(default_color(n), 2)) not in used)
    look = Appearance(color or default_color(next(free, len(existing))))
    return ClassState(new_class_id(), name_beside(name, taken), look)


def is_named_by_user(state: ClassState) -> bool:
    """Whether a class has another name than `new_class_state` gives to one without a name."""
    return re.fullmatch(rf"{UNNAMED} \d+", state.name) is None


def name_beside(name: str, taken: Collection[str]) -> str:
    """A name that is not taken: this one, or with a number after it; files and tables tell classes apart by their names."""
    numbered = (f"{name} ({n})" for n in range(2, len(taken) + 2))
    return name if name not in taken else next(name for name in numbered if name not in taken)


def duplicate_class_state(existing: Sequence[ClassState], original: ClassState) -> ClassState:
    """A class with the settings and points of `original`, but a name and colour of its own."""
    fresh = new_class_state(existing, f"{original.name} copy")
    # Its points get labels with its own name.
    return changed(original, id=fresh.id, name=fresh.name, color=fresh.color, positive_properties={}, negative_properties={})


def without_points(original: ClassState) -> ClassState:
    """A class for the same structure in another scan: what users decide once for a structure, and nothing of where it lies."""
    look = replace(original.look, low=None, high=None)  # Intensities are a scan's own.
    return ClassState(new_class_id(), original.name, look, proximity=original.proximity, refine=original.refine)


def begun_anew(original: ClassState) -> ClassState:
    """The same class before anything was clicked."""
    return replace(without_points(original), id=original.id, look=original.look, continues=original.continues)


def new_class_id() -> str:
    """An id that no other class has, in any scene."""
    return uuid.uuid4().hex[:12]


def points_by_class(classes: Iterable[ClassState]) -> PointsByClass:
    """The points of all classes."""
    return {state.id: (state.positive, state.negative) for state in classes if state.positive or state.negative}


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
