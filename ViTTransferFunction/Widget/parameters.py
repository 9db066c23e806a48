"""The settings of the panel that Slicer itself keeps equal to the parameter node."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

import qt
import slicer
import vtk
from slicer.parameterNodeWrapper import Choice, WithinRange, parameterNodeWrapper

from ViTTransferFunction.Logic.scene.interface.choices import RANGES, choices, make_possible
from ViTTransferFunction.Logic.scene.interface.parameters import SceneParameters
from ViTTransferFunction.Logic.scene.mrml.observers import SceneObservers
from ViTTransferFunction.Logic.session.presets import PRESETS

_DEFAULTS: dict[str, Any] = dict(SceneParameters.DEFAULTS)
_CHOICES: dict[str, dict[str, str]] = choices()


@parameterNodeWrapper
class PanelParameters:
    """Those of `SceneParameters` that have a widget of their own; `SceneParameters` says what they mean."""

    preset: Annotated[str, Choice(list(_CHOICES["preset"]))] = _DEFAULTS["preset"]
    model: Annotated[str, Choice(list(_CHOICES["model"]))] = _DEFAULTS["model"]
    grid: Annotated[int, WithinRange(*RANGES["grid"])] = _DEFAULTS["grid"]
    device: Annotated[str, Choice(list(_CHOICES["device"]))] = _DEFAULTS["device"]
    refinement: Annotated[str, Choice(list(_CHOICES["refinement"]))] = _DEFAULTS["refinement"]
    onlyAnnotatedParts: bool = _DEFAULTS["onlyAnnotatedParts"]  # noqa: N815
    respectOtherSegments: bool = _DEFAULTS["respectOtherSegments"]  # noqa: N815
    otherSegmentsAreOutside: bool = _DEFAULTS["otherSegmentsAreOutside"]  # noqa: N815
    overlayVisible: bool = _DEFAULTS["overlayVisible"]  # noqa: N815
    overlayOpacity: Annotated[float, WithinRange(*RANGES["overlayOpacity"])] = _DEFAULTS["overlayOpacity"]  # noqa: N815
    proposalsVisible: bool = _DEFAULTS["proposalsVisible"]  # noqa: N815
    rendering: Annotated[str, Choice(list(_CHOICES["rendering"]))] = _DEFAULTS["rendering"]
    renderingSolo: bool = _DEFAULTS["renderingSolo"]  # noqa: N815
    contextStrength: Annotated[float, WithinRange(*RANGES["contextStrength"])] = _DEFAULTS["contextStrength"]  # noqa: N815
    contextCutAway: bool = _DEFAULTS["contextCutAway"]  # noqa: N815
    renderingCut: Annotated[str, Choice(list(_CHOICES["renderingCut"]))] = _DEFAULTS["renderingCut"]  # noqa: N815


class BoundParameters:
    """Binds the widgets that bear the property SlicerParameterName to a parameter node, and lets the selectors of nodes speak.

    Args:
        parameters: of the node; what has no place in the widgets is replaced by its default.
        ui: the widgets of the panel, by name.

    Attributes:
        replaced: what the user should know of that.
    """

    def __init__(self, parameters: SceneParameters, ui: Any) -> None:
        self.replaced = make_possible(parameters, _CHOICES)
        # The decorator replaces the constructor and adds methods, which type checkers do not see.
        wrap: Any = PanelParameters
        self._node, self._node_tags = parameters.node, list[int]()
        self._parameters = wrap(parameters.node)
        # Slicer 5.10 goes on to observe the node when the widgets are disconnected, one observer more for each scene.
        vars(self._parameters)["AddObserver"] = self._observe_node
        self._tag = self._parameters.connectGui(ui)
        del vars(self._parameters)["AddObserver"]
        _word_choices(ui)
        self._selectors = (ui.volumeSelector, ui.segmentationSelector)
        self._silence_selectors(False)
        self._observers = SceneObservers()
        scene = slicer.mrmlScene
        self._observers.observe(scene, [(scene.NodeAboutToBeRemovedEvent, self._on_node_going)])

    def release(self) -> None:
        """Leave widgets and node to themselves."""
        self._observers.remove_all()
        # When a scene was added, Slicer's selectors list its nodes anew, and say that none is chosen.
        self._silence_selectors(True)
        self._parameters.disconnectGui(self._tag)
        for tag in self._node_tags:
            self._node.RemoveObserver(tag)

    def _observe_node(self, event: int, callback: Callable[..., None], priority: float = 0.0) -> int:
        self._node_tags.append(self._node.AddObserver(event, callback, priority))
        return self._node_tags[-1]

    @vtk.calldata_type(vtk.VTK_OBJECT)
    def _on_node_going(self, caller: vtk.vtkObject, event: str, node: Any) -> None:
        """Where it is the chosen one, none is: by themselves, Slicer's selectors choose the one beside it in their list."""
        for selector in self._selectors:
            if selector.currentNode() is node:
                selector.setCurrentNode(None)

    def _silence_selectors(self, silent: bool) -> None:
        for selector in self._selectors:
            selector.blockSignals(silent)


def _word_choices(ui: Any) -> None:
    """Show choices in words; Slicer goes by their position in the list, and shows them as they are stored."""
    for name, words in _CHOICES.items():
        combo_box = getattr(ui, f"{name}ComboBox")
        for index, text in enumerate(words.values()):
            combo_box.setItemText(index, text)
    for index, choice in enumerate(_CHOICES["preset"]):
        ui.presetComboBox.setItemData(index, PRESETS[choice].meaning, qt.Qt.ToolTipRole)
