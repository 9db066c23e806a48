"""Opens a volume for segmentation."""

from __future__ import annotations

from ..core.system.errors import InputError
from ..core.volumes.intensity_window import IntensityWindow, check_shows_something
from ..core.volumes.volume import Volume
from ..features.cache import FeatureCache
from ..features.device import check_device_name
from ..features.networks import Networks
from ..features.settings import FeatureSettings
from ..weights.models import PretrainedModel, pretrained_model
from ..weights.sources import Trust, find_weights, identify_model
from .close_ups import close_up_settings
from .feature_source import FeatureSource
from .model_weights import ModelWeights
from .presets import preset
from .segmentation_session import SegmentationSession
from .settings import SessionSettings


def open_session(
    volume: Volume,
    settings: SessionSettings,
    cache: FeatureCache | None = None,
    networks: Networks | None = None,
    trust: Trust | None = None,
    ask_first: bool = False,
) -> SegmentationSession:
    """Make a session on a volume; its features are loaded later (`SegmentationSession.load_features`).

    Args:
        volume: the volume to segment.
        settings: the user's settings.
        cache: keeps features between sessions; None: in the user's cache folder.
        networks: keeps networks open from one session to the next; None: only for this session.
        trust: asked about downloaded weights whose hash nobody publishes (`find_weights`).
        ask_first: whether weights are downloaded only if an estimate announced it (`ModelWeights`), and never for close-ups.

    Raises:
        InputError: a setting is invalid, or the chosen window shows nothing of the volume.
    """
    features = settings.feature_settings()
    if settings.window is not None:
        check_shows_something(IntensityWindow(*settings.window), volume)
    chosen = preset(settings.preset)
    model = chosen_model(settings)
    # Only the name is checked: PyTorch, which knows the devices, takes seconds to load, and is needed only for features.
    check_device_name(settings.device)
    cache, networks = cache or FeatureCache(), networks or Networks()

    def source(of: Volume, how: FeatureSettings) -> FeatureSource:
        weights = ModelWeights(model, settings.weights_path, trust, ask_first)
        return FeatureSource(of, how, chosen.statistics, weights, settings.device, cache, networks)

    def open_part(part: Volume) -> SegmentationSession:
        return SegmentationSession(part, chosen, source(part, close_up_settings(features, part.geometry)))

    return SegmentationSession(volume, chosen, source(volume, features), open_part)


def chosen_model(settings: SessionSettings) -> PretrainedModel:
    """The model that the settings name; otherwise the former one, that of the user's file of weights, or the preset's.

    Raises:
        InputError: a setting is invalid.
    """
    if settings.model is None and _is_here(settings.former_model, settings.weights_path):
        return pretrained_model(str(settings.former_model))
    return pretrained_model(settings.model or identify_model(settings.weights_path) or preset(settings.preset).model)


def _is_here(model_name: str | None, weights_path: str | None) -> bool:
    """Whether a model is named, and its weights are on this computer."""
    if model_name is None:
        return False
    try:
        find_weights(model_name, weights_path, allow_download=False)
    except InputError:
        return False
    return True
