"""What each setting may be, for front ends that offer it and for scenes that come from elsewhere."""

from __future__ import annotations

from typing import Any

from ..features.device import DEVICE_NAMES
from ..features.settings import LARGEST_GRID
from ..refinement.refinement import REFINEMENT_METHODS
from ..session.presets import PRESETS
from ..weights.models import PRETRAINED_MODELS
from ..weights.sources import offered_models
from .parameters import CUTS, RENDERINGS, SceneParameters
from .translation import tr as _
from .wording import choice_words

RANGES: dict[str, tuple[float, float]] = {
    "grid": (0, LARGEST_GRID),
    "overlayOpacity": (0.0, 1.0),
    "contextStrength": (0.0, 1.0),
}
"""Least and largest value, by the name of the parameter."""


def choices() -> dict[str, dict[str, str]]:
    """Of each parameter that has few values, these, in the order in which they are offered, and what users read for them."""
    words, own = choice_words(), _("{model} (your own file)")
    words |= {model.name: own.format(model=model.name) for model in PRETRAINED_MODELS.values() if model.request_page}
    values = {
        "preset": PRESETS,
        "model": ("", *offered_models()),
        "device": DEVICE_NAMES,
        "refinement": REFINEMENT_METHODS,
        "rendering": RENDERINGS,
        "renderingCut": CUTS,
    }
    return {name: {value: words.get(value, value) for value in of_one} for name, of_one in values.items()}


def is_possible(name: str, value: Any, offered: dict[str, dict[str, str]]) -> bool:
    """Whether a parameter may have a value; `offered`: what `choices` has. One without choices or range may have any."""
    if name in offered:
        return value in offered[name]
    low, high = RANGES.get(name, (value, value))
    return bool(low <= value <= high)


def make_possible(parameters: SceneParameters, offered: dict[str, dict[str, str]]) -> None:
    """Replace what is not offered by its default: a scene may come from another version, or have been edited by hand."""
    for name in (*offered, *RANGES):
        value = parameters.get(name)
        parameters.set(name, value if is_possible(name, value, offered) else parameters.DEFAULTS[name])
