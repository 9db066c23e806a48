"""What a user chooses before the features are computed."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..core.volumes.intensity_window import IntensityWindow
from ..features.settings import FeatureSettings
from .presets import DEFAULT_PRESET, preset


@dataclass(frozen=True)
class SessionSettings:
    """The way through the method, in few words; front ends fill it in.

    Attributes:
        preset: one of `PRESETS`.
        grid: feature cells along the longest edge, however long it is; None: the preset's.
        window: intensities that the network sees, low and high; None: the preset's.
        model: one of `PRETRAINED_MODELS`; None: the former one, else the one whose weights the user's file holds, else the
            preset's.
        former_model: what was used before, where `model` is None; passed over where its weights are not on this computer.
        weights_path: the user's own file or folder of weights; None: as `find_weights` finds them.
        device: one of `DEVICE_NAMES`.
    """

    preset: str = DEFAULT_PRESET
    grid: int | None = None
    window: tuple[float, float] | None = None
    model: str | None = None
    former_model: str | None = None
    weights_path: str | None = None
    device: str = "auto"

    def feature_settings(self) -> FeatureSettings:
        """The preset's, with the changes. Raises InputError where a setting cannot be used."""
        settings = preset(self.preset).features
        if self.grid is not None:
            settings = settings.with_grid(self.grid)
        if self.window is not None:
            settings = replace(settings, window=IntensityWindow(*self.window))
        return settings
