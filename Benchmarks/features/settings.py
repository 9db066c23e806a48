"""The ways of computing features that are compared, by name."""

from __future__ import annotations

from dataclasses import replace

from ViTTransferFunction.Logic.features.progressive import COARSE_PATCHES
from ViTTransferFunction.Logic.features.settings import FeatureSettings
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS

DEFAULT_SETTINGS = PRESETS[DEFAULT_PRESET].features
PUBLISHED = "published"
EVERY_SLICE = "every slice"
FINE = "fine"
DEFAULT = DEFAULT_PRESET
SETTINGS = {
    PUBLISHED: PRESETS["paper"].features,
    EVERY_SLICE: FeatureSettings(every_slice=True, merge_background=False),
    FINE: PRESETS["fine"].features,
    "40 000 patches": replace(DEFAULT_SETTINGS, most_patches=40_000),
    DEFAULT: DEFAULT_SETTINGS,
    "10 000 patches": replace(DEFAULT_SETTINGS, most_patches=10_000),
    "coarse": replace(DEFAULT_SETTINGS, most_patches=COARSE_PATCHES),
}
"""From slow to fast. *Fine* was the default before patches were counted; *coarse* is what the first map is made from."""
_AT_GRID = "grid "


def at_grid(grid: int) -> str:
    """Name of the default setting with so many cells along the longest edge."""
    return f"{_AT_GRID}{grid}"


def settings_called(name: str) -> FeatureSettings:
    """One of `SETTINGS`, or what `at_grid` named."""
    if name in SETTINGS:
        return SETTINGS[name]
    return DEFAULT_SETTINGS.with_grid(int(name.removeprefix(_AT_GRID)))
