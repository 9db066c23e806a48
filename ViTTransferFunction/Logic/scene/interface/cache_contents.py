"""What lies in the cache, in words, and its removal: features, and the weights of the model that the settings name."""

from __future__ import annotations

from pathlib import Path

from ...core.system.cache_folder import cache_folder
from ...core.system.errors import InputError
from ...features.cache import CacheEntry, FeatureCache
from ...session.presets import DEFAULT_PRESET, preset
from ...weights.models import PretrainedModel, pretrained_model
from ...weights.store import file_in, remove_weights, weights_folder
from .number_texts import size
from .parameters import SceneParameters
from .translation import tr as _


class CacheContents:
    """The cache as it was when this was made, which reads its folders.

    Args:
        parameters: whose model's weights are meant, wherever the user's own file may be; None: those of the default.
    """

    def __init__(self, parameters: SceneParameters | None) -> None:
        self._model = _model(parameters)
        self._weights: Path | None = None
        self._features: list[CacheEntry] = []
        self._trouble = ""
        try:
            self._weights = file_in(weights_folder(), self._model)
            self._features = FeatureCache().entries()
        except (OSError, InputError) as error:
            self._trouble = str(error)

    @property
    def text(self) -> str:
        """Where the cache is, and how much it holds; or why there is none."""
        return self._trouble or _("{folder}\nFeatures: {features}. {model}: {weights}.").format(
            # Windows takes it with these slashes as well, after which lines can be broken.
            folder=cache_folder().as_posix(),
            features=self._features_size,
            model=self._model.name,
            weights=size(self._weights.stat().st_size) if self._weights else _("not downloaded"),
        )

    @property
    def has_features(self) -> bool:
        """Whether there is something for `clear_features`."""
        return bool(self._features)

    @property
    def has_model(self) -> bool:
        """Whether there is something for `remove_model`."""
        return self._weights is not None

    @property
    def features_question(self) -> str:
        """What the user is asked before `clear_features`."""
        question = _("Delete the features of all volumes from the cache ({size})? They can be computed again.")
        return question.format(size=self._features_size)

    @property
    def model_question(self) -> str:
        """What the user is asked before `remove_model`."""
        question = _("Delete the weights of {model} from the cache? They can be downloaded again ({size}).")
        if self._model.url is None:
            question = _("Delete the weights of {model} from the cache ({size})? This program cannot download them again.")
        return question.format(model=self._model.name, size=size(self._model.size_mb * 1e6))

    @property
    def _features_size(self) -> str:
        return size(sum(entry.size_bytes for entry in self._features))

    def clear_features(self) -> None:
        """Delete all features. Raises InputError where they cannot be."""
        try:
            FeatureCache().clear()
        except OSError as error:
            raise _not_deleted(error) from error

    def remove_model(self) -> None:
        """Delete the model's weights. Raises InputError where they cannot be."""
        try:
            remove_weights(self._model.name)
        except OSError as error:
            raise _not_deleted(error) from error


def _model(parameters: SceneParameters | None) -> PretrainedModel:
    name = parameters.get("preset") if parameters else DEFAULT_PRESET
    return pretrained_model((parameters.get("model") if parameters else "") or preset(name).model)


def _not_deleted(error: OSError) -> InputError:
    return InputError(_("Cannot delete from the cache: {reason}. Close what uses it and try again.").format(reason=error))
