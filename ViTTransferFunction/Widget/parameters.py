"""The settings of the panel that Slicer itself keeps equal to the parameter node."""

from __future__ import annotations

from typing import Annotated, Any

import qt
from slicer.i18n import tr as _
from slicer.parameterNodeWrapper import Choice, WithinRange, parameterNodeWrapper

from ViTTransferFunction.Logic.features.device import DEVICE_NAMES
from ViTTransferFunction.Logic.features.settings import LARGEST_GRID
from ViTTransferFunction.Logic.refinement.refinement import REFINEMENT_METHODS
from ViTTransferFunction.Logic.scene.parameters import RENDERINGS, SceneParameters
from ViTTransferFunction.Logic.session.presets import PRESETS
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS
from ViTTransferFunction.Logic.weights.sources import offered_models

_DEFAULTS: dict[str, Any] = dict(SceneParameters.DEFAULTS)
_CHOICES: dict[str, list[str]] = {
    "preset": list(PRESETS),
    "model": ["", *offered_models()],
    "device": list(DEVICE_NAMES),
    "refinement": list(REFINEMENT_METHODS),
    "rendering": list(RENDERINGS),
}
_RANGES: dict[str, tuple[float, float]] = {
    "grid": (0, LARGEST_GRID),
    "overlayOpacity": (0.0, 1.0),
    "contextStrength": (0.0, 1.0),
}


@parameterNodeWrapper
class PanelParameters:
    """Those of `SceneParameters` that have a widget of their own; `SceneParameters` says what they mean."""

    preset: Annotated[str, Choice(_CHOICES["preset"])] = _DEFAULTS["preset"]
    model: Annotated[str, Choice(_CHOICES["model"])] = _DEFAULTS["model"]
    grid: Annotated[int, WithinRange(*_RANGES["grid"])] = _DEFAULTS["grid"]
    device: Annotated[str, Choice(_CHOICES["device"])] = _DEFAULTS["device"]
    refinement: Annotated[str, Choice(_CHOICES["refinement"])] = _DEFAULTS["refinement"]
    onlyAnnotatedParts: bool = _DEFAULTS["onlyAnnotatedParts"]  # noqa: N815
    respectOtherSegments: bool = _DEFAULTS["respectOtherSegments"]  # noqa: N815
    otherSegmentsAreOutside: bool = _DEFAULTS["otherSegmentsAreOutside"]  # noqa: N815
    overlayVisible: bool = _DEFAULTS["overlayVisible"]  # noqa: N815
    overlayOpacity: Annotated[float, WithinRange(*_RANGES["overlayOpacity"])] = _DEFAULTS["overlayOpacity"]  # noqa: N815
    proposalsVisible: bool = _DEFAULTS["proposalsVisible"]  # noqa: N815
    rendering: Annotated[str, Choice(_CHOICES["rendering"])] = _DEFAULTS["rendering"]
    renderingSolo: bool = _DEFAULTS["renderingSolo"]  # noqa: N815
    contextStrength: Annotated[float, WithinRange(*_RANGES["contextStrength"])] = _DEFAULTS["contextStrength"]  # noqa: N815
    contextCutAway: bool = _DEFAULTS["contextCutAway"]  # noqa: N815
    renderingCut: bool = _DEFAULTS["renderingCut"]  # noqa: N815


class BoundParameters:
    """Binds the widgets that bear the property SlicerParameterName to a parameter node.

    Args:
        parameters: of the node; what has no place in the widgets is replaced by its default.
        ui: the widgets of the panel, by name.
    """

    def __init__(self, parameters: SceneParameters, ui: Any) -> None:
        _make_showable(parameters)
        # The decorator replaces the constructor and adds methods, which type checkers do not see.
        wrap: Any = PanelParameters
        self._parameters = wrap(parameters.node)
        self._tag = self._parameters.connectGui(ui)
        _word_choices(ui)

    def release(self) -> None:
        """Leave widgets and node to themselves."""
        self._parameters.disconnectGui(self._tag)


def _make_showable(parameters: SceneParameters) -> None:
    """A scene may come from another version, or have been edited by hand."""
    for name, choices in _CHOICES.items():
        if parameters.get(name) not in choices:
            parameters.set(name, _DEFAULTS[name])
    for name, (low, high) in _RANGES.items():
        value = parameters.get(name)
        parameters.set(name, value if low <= value <= high else _DEFAULTS[name])


def _word_choices(ui: Any) -> None:
    """Show choices in words; Slicer goes by their position in the list, and shows them as they are stored."""
    words = {
        "": _("as in the preset"),
        "balanced": _("Balanced"),
        "fine": _("Fine (ten times as slow)"),
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
    }
    own = _("{model} (your own file)")
    words |= {model.name: own.format(model=model.name) for model in PRETRAINED_MODELS.values() if model.request_page}
    for name, choices in _CHOICES.items():
        combo_box = getattr(ui, f"{name}ComboBox")
        for index, choice in enumerate(choices):
            combo_box.setItemText(index, words.get(choice, choice))
    for index, choice in enumerate(_CHOICES["preset"]):
        ui.presetComboBox.setItemData(index, PRESETS[choice].meaning, qt.Qt.ToolTipRole)
