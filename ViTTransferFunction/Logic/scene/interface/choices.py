"""What each setting may be, for front ends that offer it and for scenes that come from elsewhere."""

from __future__ import annotations

from typing import Any

from ...core.system.errors import InputError, shown
from ...core.system.user_path import is_there
from ...features.device import DEVICE_NAMES
from ...features.settings import LARGEST_GRID, check_grid
from ...refinement.refinement import REFINEMENT_METHODS
from ...session.presets import PRESETS
from ...weights.models import PRETRAINED_MODELS
from ...weights.sources import offered_models
from .choice_words import choice_words
from .parameters import CUTS, RENDERINGS, SceneParameters
from .translation import tr as _

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


def check_possible(name: str, value: Any, offered: dict[str, dict[str, str]]) -> None:
    """Check that a parameter may have a value; one without choices or range may have any.

    Args:
        name: of the parameter.
        value: of its default's type.
        offered: what `choices` has.

    Raises:
        InputError: it may not.
    """
    if name in offered:
        if value not in offered[name]:
            known = ", ".join(word for word in offered[name] if word)
            text = _("'{name}' cannot be {value}; expected {known}.")
            raise InputError(text.format(name=name, value=shown(value), known=known))
    elif name == "grid":
        if value:  # 0 is the preset's.
            check_grid(value)
    elif name in RANGES:
        low, high = RANGES[name]
        if not low <= value <= high:
            text = _("'{name}' cannot be {value}; expected {low} to {high}.")
            raise InputError(text.format(name=name, value=shown(value), low=f"{low:g}", high=f"{high:g}"))


def make_possible(parameters: SceneParameters, offered: dict[str, dict[str, str]]) -> list[str]:
    """Replace what is not offered by its default: a scene may come from another version, or have been edited by hand.

    Returns:
        What the user should know of that.
    """
    replaced = []
    for name in (*offered, *RANGES):
        value = parameters.get(name)
        try:
            check_possible(name, value, offered)
        except InputError as error:
            # Where structures were made with the model, the session sees what can be done (`FormerModel`).
            if name != "model" or value != parameters.get("usedModel"):
                replaced.append(_("{reason} The saved setting was replaced by the default.").format(reason=error))
            value = parameters.DEFAULTS[name]
        parameters.set(name, value)
    weights = parameters.get("weightsPath")
    if weights and not is_there(weights):
        text = _("The weights that the saved settings name are not on this computer: {path}. Others are used if there are any.")
        replaced.append(text.format(path=shown(weights)))
        parameters.set("weightsPath", "")
    return replaced
