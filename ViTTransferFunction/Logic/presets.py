"""Named settings for the whole path, so that users choose a meaning and not a dozen numbers."""

from __future__ import annotations

from dataclasses import dataclass

from .errors import InputError
from .feature_extraction import FeatureSettings
from .feature_statistics import Statistics
from .similarity import SimilarityMethod


@dataclass(frozen=True)
class Preset:
    """One way through the method.

    Attributes:
        meaning: one sentence for users.
        model: the pretrained model, where the user names none.
        features: how features are extracted.
        statistics: how they are made comparable.
        similarity: how annotations become maps.
    """

    meaning: str
    model: str
    features: FeatureSettings
    statistics: Statistics
    similarity: SimilarityMethod


PRESETS = {
    "default": Preset(
        meaning="one slice for each layer of cubic cells, features whitened by the volume's own statistics",
        model="dinov2_vits14",
        features=FeatureSettings(),
        statistics="whitened",
        similarity="kernel",
    ),
    "published": Preset(
        meaning="as in the paper: every slice of every axis, full intensity range, raw features; many times slower",
        model="dino_vits8",
        features=FeatureSettings(isotropic=False, upright=False, every_slice=True, windows="full range"),
        statistics="none",
        similarity="published",
    ),
}


def preset(name: str) -> Preset:
    """The preset called `name`.

    Raises:
        InputError: no preset is called so.
    """
    if name not in PRESETS:
        raise InputError(f"Unknown preset '{name}'; expected one of {', '.join(PRESETS)}.")
    return PRESETS[name]
