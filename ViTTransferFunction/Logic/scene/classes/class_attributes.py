"""Stores a class's settings as attributes (text) of its list of positive points, which are saved with the scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import slicer

from ...core.classes.close_up import CloseUp
from ...core.classes.colors import Color
from ...core.classes.iso_proposals import LARGEST_SIZE, SMALLEST_SIZE
from ...core.system.errors import InputError
from ...rendering.appearance import STYLES, Appearance
from .class_state import ClassState, CloseUpBox

_SETTINGS = ("iso", "size", "proximity", "refine", "visible")
"""Fields of `ClassState` that are stored by their own name and value."""
_LOOK = tuple(each.name for each in fields(Appearance) if each.name != "color")
"""Fields of its `Appearance`; the colour is that of the list."""
_ANY = (-math.inf, math.inf)
_RANGES = {"size": (SMALLEST_SIZE, LARGEST_SIZE), "low": _ANY, "high": _ANY}
"""Ranges of the numbers among these fields; by default [0, 1]."""


def attribute(node: slicer.vtkMRMLNode, name: str) -> str | None:
    """The value of one of this extension's attributes; None if the node does not have it."""
    text: str | None = node.GetAttribute(f"ViTTransferFunction.{name}")
    return text


def set_attribute(node: slicer.vtkMRMLNode, name: str, text: str | None) -> None:
    """Set one of this extension's attributes; None: remove it."""
    node.SetAttribute(f"ViTTransferFunction.{name}", text)


def read_look(positive: slicer.vtkMRMLMarkupsFiducialNode, color: Color) -> Appearance:
    """The appearance of a class with this colour; defaults replace missing or invalid attributes."""
    return Appearance(color, **_read_fields(positive, Appearance, _LOOK))


def read_settings(positive: slicer.vtkMRMLMarkupsFiducialNode) -> dict[str, Any]:
    """A class's other settings, as fields of `ClassState`; defaults replace missing or invalid attributes."""
    return {
        **_read_fields(positive, ClassState, _SETTINGS),
        "close_up": _read_close_up(positive),
        "continues": attribute(positive, "continues") or "",
    }


def write_settings(positive: slicer.vtkMRMLMarkupsFiducialNode, state: ClassState) -> None:
    """Write a class's settings and look to the attributes; only those that differ are changed."""
    for holder, names in ((state, _SETTINGS), (state.look, _LOOK)):
        present = _read_fields(positive, type(holder), names)
        for name, value in ((name, getattr(holder, name)) for name in names):
            if present[name] != value:
                set_attribute(positive, name, None if value is None else str(value))
    if _read_close_up(positive) != state.close_up:
        box = None if state.close_up is None else " ".join(map(repr, state.close_up))
        set_attribute(positive, "closeUp", box)
    if (attribute(positive, "continues") or "") != state.continues:
        set_attribute(positive, "continues", state.continues or None)


def _read_fields(positive: slicer.vtkMRMLMarkupsFiducialNode, kind: type, names: Sequence[str]) -> dict[str, Any]:
    """Fields of a dataclass from attributes of the list; its defaults replace missing or invalid ones."""
    values: dict[str, Any] = {}
    for name in names:
        default = getattr(kind, name)
        text = attribute(positive, name)
        values[name] = default
        if text in ("True", "False"):
            values[name] = text == "True"
        elif isinstance(default, str):
            values[name] = text if text in STYLES else default
        elif text is not None:
            values[name] = _number(text, _RANGES.get(name, (0.0, 1.0)), default)
    return values


def _read_close_up(positive: slicer.vtkMRMLMarkupsFiducialNode) -> CloseUpBox | None:
    """A class's close-up; None if the list has none, or an invalid one."""
    words = (attribute(positive, "closeUp") or "").split()
    try:
        r, a, s, *size = (float(word) for word in words)
        close_up = CloseUp((r, a, s), tuple(size))  # type: ignore[arg-type]
    except (ValueError, InputError):
        return None
    return (*close_up.centre_ras, *close_up.size_mm)


def _number(text: str, between: tuple[float, float], default: float | None) -> float | None:
    """The number in a text; the default if it is not a finite number in the range, since scenes may contain anything."""
    try:
        number = float(text)
    except ValueError:
        return default
    if not math.isfinite(number):
        return default
    return number if between[0] <= number <= between[1] else default
