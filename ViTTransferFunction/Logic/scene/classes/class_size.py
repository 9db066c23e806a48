"""How large a structure the user means, changed step by step by keys, or little by little by the wheel.

Where the iso value is chosen from the annotations, what changes is the class's size: an offset from what is chosen, which later
clicks leave as it is. Where the user fixed the iso value, that changes itself.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from ...core.classes.iso_proposals import LARGEST_SIZE, SMALLEST_SIZE, resized_iso
from .class_state import ClassState

STEPS = (SMALLEST_SIZE, -2.5, -2.0, -1.5, -1.0, 0.0, 1.0, 1.5, 2.0, 2.5, LARGEST_SIZE)
"""Where keys stop: at the three proposals, which are structures of their own, and at every half beyond."""
NOTCH = 0.1
"""Size that a notch of the wheel adds: fine enough to follow a border by eye, ten notches to the next proposal."""


def stepped(state: ClassState, direction: Literal[-1, 1]) -> ClassState:
    """A class one step smaller (−1) or larger (1); the same at the end of the steps."""
    if state.iso is not None:
        return replace(state, iso=resized_iso(state.iso, direction))
    further = [size for size in STEPS if (size - state.size) * direction > 0.0]
    return replace(state, size=min(further, key=lambda size: abs(size - state.size))) if further else state


def turned(state: ClassState, notches: int) -> ClassState:
    """A class so many notches of the wheel larger, or smaller where negative."""
    if state.iso is not None:
        return replace(state, iso=resized_iso(state.iso, NOTCH * notches))
    # Rounded, so that the way back ends where it began.
    size = round(state.size + NOTCH * notches, 3)
    return replace(state, size=float(np.clip(size, SMALLEST_SIZE, LARGEST_SIZE)))
