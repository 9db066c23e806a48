"""The one way to open a volume for segmentation."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..core.intensity_window import IntensityWindow
from ..core.volume import Volume
from ..features.cache import FeatureCache
from ..features.device import check_device_name
from ..features.networks import Networks
from ..features.settings import FeatureSettings
from ..weights.models import pretrained_model
from ..weights.sources import identify_model
from .feature_source import FeatureSource
from .presets import DEFAULT_PRESET, preset
from .segmentation_session import SegmentationSession


@dataclass(frozen=True)
class SessionSettings:
    """What a user chooses before the features are computed.

    Attributes:
        preset: one of `PRESETS`.
        grid: feature cells along the longest edge; None: the preset's.
        window: intensities that the network sees, low and high; None: the preset's.
        model: one of `PRETRAINED_MODELS`; None: the one whose weights the user's file holds, else the preset's.
        weights_path: the user's own file or folder of weights; None: as `find_weights` finds them.
        device: one of `DEVICE_NAMES`.
    """

    preset: str = DEFAULT_PRESET
    grid: int | None = None
    window: tuple[float, float] | None = None
    model: str | None = None
    weights_path: str | None = None
    device: str = "auto"

    def feature_settings(self) -> FeatureSettings:
        """The preset's, with the changes. Raises InputError where a setting cannot be used."""
        settings = preset(self.preset).features
        if self.grid is not None:
            settings = replace(settings, grid=self.grid)
        if self.window is not None:
            settings = replace(settings, windows=(IntensityWindow(*self.window),) * 3)
        return settings


def open_session(
    volume: Volume, settings: SessionSettings, cache: FeatureCache | None = None, networks: Networks | None = None
) -> SegmentationSession:
    """A session on a volume; its features are still to be loaded (`SegmentationSession.load_features`).

    Args:
        volume: what is to be segmented.
        settings: what the user chose.
        cache: where features are kept between sessions; None: the user's cache folder.
        networks: that are open already, where several sessions follow each other.

    Raises:
        InputError: a setting cannot be used.
    """
    features = settings.feature_settings()
    chosen = preset(settings.preset)
    model = pretrained_model(settings.model or identify_model(settings.weights_path) or chosen.model)
    # PyTorch, which knows the devices, takes seconds to load, and is not needed before the features are.
    check_device_name(settings.device)
    source = FeatureSource(
        volume, features, model, settings.weights_path, settings.device, cache or FeatureCache(), networks or Networks()
    )
    return SegmentationSession(volume, chosen, source)
