"""The model that a scene's structures were made with: they are made with it again where that can be, or the user is told."""

from __future__ import annotations

from dataclasses import replace

from ...compute.proxy import SegmentationProxy
from ...session.settings import SessionSettings
from ..interface.message_texts import former_model_text
from ..interface.parameters import SceneParameters
from ..interface.problems import Problems


class FormerModel:
    """Remembers which model features were got with, in the scene, and speaks of the one that was there when the scene came.

    Args:
        parameters: of the scene.
        proxy: knows which model features are or will be of.
        problems: are told where another model has to do.
    """

    def __init__(self, parameters: SceneParameters, proxy: SegmentationProxy, problems: Problems) -> None:
        self._parameters = parameters
        self._proxy = proxy
        self._problems = problems
        self._name = parameters.get("usedModel")
        self._preset = parameters.get("preset")

    def applied_to(self, settings: SessionSettings) -> SessionSettings:
        """Settings that prefer it, unless the user has chosen anew."""
        if settings.preset != self._preset or settings.model not in (None, self._name):
            self._name = ""
        return replace(settings, former_model=self._name or None)

    def remember(self, name: str) -> None:
        """Structures come that were made with this model, "" if that is not known: features are to be of it, too."""
        # Features that are of it already, or are just being computed, stay.
        if name and name != self._model_of_features:
            self._name, self._preset = name, self._parameters.get("preset")

    def look(self, has_structures: bool) -> None:
        """Take in which model the features are or will be of, and tell the user if their structures were made with another."""
        model = self._model_of_features
        if not model:
            return
        if self._name in ("", model) or not has_structures:
            self._problems.solve("model")
        else:
            self._problems.put("model", former_model_text(self._name, model))
        if self._proxy.phase == "ready" and self._parameters.get("usedModel") != model:
            self._parameters.set("usedModel", model)

    @property
    def _model_of_features(self) -> str:
        """Which model the features are or will be of; "": not known."""
        return self._proxy.estimate.model if self._proxy.estimate is not None else ""
