"""Names of the values of settings, as users read them."""

from __future__ import annotations

from ...rendering.appearance import STYLES
from .translation import tr as _


def choice_words() -> dict[str, str]:
    """Texts for the values of parameters that have few values."""
    return {
        "": _("as in the preset"),
        "balanced": _("Balanced"),
        "fine": _("Fine (8 to 24 times as slow)"),
        "paper": _("As in the paper (many times slower)"),
        "auto": _("Automatic"),
        "cpu": _("Processor (CPU)"),
        "cuda": _("NVIDIA graphics card (CUDA)"),
        "mps": _("Apple graphics processor (MPS)"),
        "bilateral": _("Bilateral solver"),
        "guided": _("Guided filter"),
        "none": _("None"),
        "off": _("Off"),
        "similarity": _("Similarity"),
        "transfer function": _("Transfer function"),
        "box": _("To a box"),
        "plane": _("By a plane"),
    }


def style_words() -> dict[str, str]:
    """Texts for all styles of structures, in their order."""
    words = {
        "surface": _("Surface"),
        "glass": _("Glass"),
        "X-ray": _("X-ray"),
        "vessels": _("Vessels"),
        "as scanned": _("As scanned"),
    }
    return {name: words.get(name, name) for name in STYLES}


def context_words() -> dict[str, str]:
    """Texts for the surroundings of structures, except Slicer's presets, which keep their names."""
    return {"off": _("Off"), "bones and vessels": _("Bones and vessels"), "skin": _("Skin")}
