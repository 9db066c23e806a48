"""Typed access to the module's settings, which are stored in a parameter node of the scene.

The node stores text in the format of Slicer's `parameterNodeWrapper`, so that a panel can connect its widgets to the same
values.
"""

from __future__ import annotations

from typing import Any, get_args

import slicer

from ...compute.requests import Refinement, RenderingMode
from ...core.volumes.intensity_window import IntensityWindow
from ...refinement.refinement import REFINEMENT_METHODS
from ...session.presets import DEFAULT_PRESET, PRESETS
from ...session.settings import SessionSettings
from ..mrml.nodes import node_of_class

RENDERINGS: tuple[str, ...] = ("off", *get_args(RenderingMode))
CUTS = ("off", "box", "plane")
REFERENCES = {
    "volume": "vtkMRMLScalarVolumeNode",
    "segmentation": "vtkMRMLSegmentationNode",
    "renderingBox": "vtkMRMLMarkupsROINode",
    "renderingPlane": "vtkMRMLMarkupsPlaneNode",
}
"""Class of the nodes that the parameter node refers to, by role."""


class SceneParameters:
    """Reads and writes a parameter node.

    Args:
        node: the parameter node. Missing parameters are added with their defaults, so that every reader finds all of them.

    The parameters, by their names in the node:
        volume, segmentation: references to the volume to segment, and to the segmentation that gets the segments.
        preset: one of `PRESETS`.
        model: one of `PRETRAINED_MODELS`; empty: the model of the scene's structures, of `weightsPath`, or of the preset.
        usedModel: the model of the last features; empty: there were none.
        weightsPath: file or folder of weights; empty: the cache or a download.
        grid: feature cells along the longest edge; 0: as in the preset.
        device: one of `DEVICE_NAMES`.
        windowAutomatic, windowLow, windowHigh: the intensity window for the network, and whether it is chosen automatically.
        refinement: one of `REFINEMENT_METHODS`.
        onlyAnnotatedParts: whether components of a segment without a positive point are left out.
        respectOtherSegments: whether voxels that belong to other segments are left to these.
        otherSegmentsAreOutside: whether visible segments that were not made here count as outside of all structures.
        overlayVisible, overlayOpacity: of the overlay of the selected class's similarity in slice views.
        proposalsVisible: whether slice views show faint outlines of other proposals for the selected class.
        rendering: what the 3D views show ("off", "similarity" or "transfer function").
        renderingSolo: whether 3D views show the selected class alone.
        context: the surroundings that 3D views show ("off", or one of `SessionViews.context_names`).
        contextStrength: density of the surroundings, in [0, 1].
        contextCutAway: whether surroundings are removed where they would hide a structure.
        renderingCut: how 3D views are cropped ("off", "box" or "plane": `rendering_box`, `rendering_plane`).
        selectedClass: id of the class that is annotated.
    """

    DEFAULTS: dict[str, bool | int | float | str] = {  # noqa: RUF012
        "preset": DEFAULT_PRESET,
        "model": "",
        "usedModel": "",
        "weightsPath": "",
        "grid": 0,
        "device": "auto",
        "windowAutomatic": True,
        "windowLow": 0.0,
        "windowHigh": 0.0,
        "refinement": "bilateral",
        "onlyAnnotatedParts": True,
        "respectOtherSegments": True,
        "otherSegmentsAreOutside": False,
        "overlayVisible": True,
        "overlayOpacity": 0.5,
        "proposalsVisible": True,
        "rendering": "similarity",
        "renderingSolo": False,
        "context": "off",
        "contextStrength": 0.5,
        "contextCutAway": False,
        "renderingCut": "off",
        "selectedClass": "",
    }

    def __init__(self, node: slicer.vtkMRMLScriptedModuleNode) -> None:
        self.node = node
        for name, default in self.DEFAULTS.items():
            if not node.HasParameter(name):
                node.SetParameter(name, str(default))

    def get(self, name: str) -> Any:
        """The value of a parameter, of its default's type; the default if the node's text should be a number and is not."""
        default = self.DEFAULTS[name]
        if not self.node.HasParameter(name):
            return default  # Closing a scene removes all parameters.
        text = self.node.GetParameter(name)
        if isinstance(default, bool):
            return text == "True"
        try:
            return type(default)(text)
        except ValueError:
            return default

    def set(self, name: str, value: bool | float | str) -> None:
        """Write a parameter."""
        self.node.SetParameter(name, str(type(self.DEFAULTS[name])(value)))

    @property
    def window(self) -> tuple[float, float]:
        """The intensity window for the network, low and high; if it is chosen automatically, the window of the views."""
        display = self.volume.GetScalarVolumeDisplayNode() if self.volume else None
        if self.get("windowAutomatic") and display is not None:
            return display.GetWindowLevelMin(), display.GetWindowLevelMax()
        return self.get("windowLow"), self.get("windowHigh")

    def set_window(self, low: float, high: float, automatic: bool) -> None:
        """Set the intensity window for the network in a single event, so that no observer sees a partly changed window."""
        was_modifying = self.node.StartModify()
        self.set("windowLow", low)
        self.set("windowHigh", high)
        self.set("windowAutomatic", automatic)
        self.node.EndModify(was_modifying)

    @property
    def volume(self) -> Any:
        """The volume to segment, a vtkMRMLScalarVolumeNode; None if none is chosen."""
        return self._reference("volume")

    @property
    def segmentation(self) -> Any:
        """The vtkMRMLSegmentationNode that gets the segments; None if none is chosen."""
        return self._reference("segmentation")

    @property
    def rendering_box(self) -> Any:
        """The vtkMRMLMarkupsROINode to which 3D views are cropped; None if there is none yet."""
        return self._reference("renderingBox")

    @property
    def rendering_plane(self) -> Any:
        """The vtkMRMLMarkupsPlaneNode by which 3D views are cropped; None if there is none yet."""
        return self._reference("renderingPlane")

    def _reference(self, name: str) -> Any:
        return referred(self.node, name)

    def set_reference(self, name: str, node: slicer.vtkMRMLNode | None) -> None:
        """Set the reference to a node; `name` is one of `REFERENCES`."""
        self.node.SetNodeReferenceID(name, node.GetID() if node else None)

    def session_settings(self) -> SessionSettings:
        """The settings that determine the features.

        Raises:
            InputError: the intensity window is invalid.
        """
        low, high = self.get("windowLow"), self.get("windowHigh")
        automatic = self.get("windowAutomatic")
        if not automatic:
            IntensityWindow(low, high)  # Raises InputError if the window is invalid.
        return SessionSettings(
            preset=self.get("preset") if self.get("preset") in PRESETS else DEFAULT_PRESET,
            grid=self.get("grid") or None,
            window=None if automatic else (low, high),
            model=self.get("model") or None,
            weights_path=self.get("weightsPath") or None,
            device=self.get("device"),
        )

    def refinement(self) -> Refinement:
        """The refinement of maps; with the default method if the stored one is unknown."""
        method = self.get("refinement")
        if method not in REFINEMENT_METHODS:
            method = self.DEFAULTS["refinement"]
        return Refinement(method, self.get("onlyAnnotatedParts"))

    def rendering_mode(self) -> RenderingMode | None:
        """What the 3D views show; None: nothing, or the stored value is unknown."""
        mode = self.get("rendering")
        return mode if mode in get_args(RenderingMode) else None


def referred(parameter_node: slicer.vtkMRMLScriptedModuleNode, role: str) -> Any:
    """The node that a parameter node refers to in a role of `REFERENCES`; None if it is gone or of another class."""
    return node_of_class(parameter_node.GetNodeReference(role), REFERENCES[role])
