"""Named settings for the whole path, so that users choose a meaning and not a dozen numbers."""

from __future__ import annotations

from dataclasses import dataclass

from ..core.system.errors import InputError, shown
from ..features.settings import FeatureSettings
from ..features.whitening import Statistics
from ..similarity.similarity_rule import SimilarityMethod
from .preset_meanings import DEFAULT_PRESET as DEFAULT_PRESET
from .preset_meanings import PRESET_MEANINGS


@dataclass(frozen=True)
class Preset:
    """One way through the method.

    Attributes:
        meaning: one sentence for users.
        model: the pretrained model, where the user names none.
        features: how features are extracted.
        statistics: how they are normalised.
        similarity: how annotations become maps.
    """

    meaning: str
    model: str
    features: FeatureSettings
    statistics: Statistics
    similarity: SimilarityMethod


def _whitened(meaning: str, features: FeatureSettings) -> Preset:
    return Preset(meaning, model="dinov2_vits14", features=features, statistics="whitened", similarity="kernel ridge")


# Benchmarks/results/features.md has what these cost, and what they buy.
PRESETS = {
    "balanced": _whitened(PRESET_MEANINGS["balanced"], FeatureSettings(most_patches=20_000, largest_cell_mm=8.0)),
    "fine": _whitened(PRESET_MEANINGS["fine"], FeatureSettings(layer_step=2)),
    "paper": Preset(
        meaning=PRESET_MEANINGS["paper"],
        model="dino_vits8",
        features=FeatureSettings(
            isotropic=False,
            canonical=False,
            every_slice=True,
            merge_background=False,
            window="full range",
            precision="float32",
        ),
        statistics="none",
        similarity="clamped cosine",
    ),
}


def preset(name: str) -> Preset:
    """The preset called `name`.

    Raises:
        InputError: no preset has this name.
    """
    if name not in PRESETS:
        raise InputError(f"Unknown preset {shown(name)}; expected one of {', '.join(PRESETS)}.")
    return PRESETS[name]
