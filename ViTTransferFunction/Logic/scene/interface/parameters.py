"""The module's settings, typed, as a parameter node of the scene keeps them.

The node holds text, written as Slicer's `parameterNodeWrapper` writes it, so that a panel may bind its widgets to the same
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
"""Of which class the nodes are that the parameter node refers to, by role."""


class SceneParameters:
    """Reads and writes a parameter node.

    Args:
        node: which one. What it lacks is filled in with defaults, so that whoever reads it finds everything.

    The parameters, by the names that they have in the node:
        volume, segmentation: references to the volume to segment, and to the segmentation that gets the segments.
        preset: one of `PRESETS`.
        model: one of `PRETRAINED_MODELS`; empty: the one that the scene's structures were made with, the one of `weightsPath`,
            or the preset's.
        usedModel: with which features were got last; empty: none were yet.
        weightsPath: file or folder of weights; empty: the cache or a download.
        grid: feature cells along the longest edge; 0: the preset's.
        device: one of `DEVICE_NAMES`.
        windowAutomatic, windowLow, windowHigh: intensities that the network sees.
        refinement: one of `REFINEMENT_METHODS`.
        onlyAnnotatedParts: drop the parts of a segment that no positive point lies in.
        respectOtherSegments: leave voxels to the segments that have them already.
        otherSegmentsAreOutside: while clicking, count the visible segments of others as what structures are not.
        overlayVisible, overlayOpacity: of the selected class's similarity in the slice views.
        proposalsVisible: whether slice views outline faintly what else the selected class may be.
        rendering: what the 3D views show ("off", "similarity" or "transfer function").
        renderingSolo: whether 3D views show the selected class alone.
        context: what 3D views show around the structures ("off", or one of `SessionViews.context_names`).
        contextStrength: how dense that is, in [0, 1].
        contextCutAway: whether it gives way where it would hide a structure.
        renderingCut: what 3D views are cut by ("off", "box" or "plane": `rendering_box`, `rendering_plane`).
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
        """The value of a parameter, of its default's type; the default where the node's text should be a number and is none."""
        default = self.DEFAULTS[name]
        if not self.node.HasParameter(name):
            return default  # Closing a scene empties the node.
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
        """The intensities that the network sees, low and high; while they are chosen automatically, those that views show."""
        display = self.volume.GetScalarVolumeDisplayNode() if self.volume else None
        if self.get("windowAutomatic") and display is not None:
            return display.GetWindowLevelMin(), display.GetWindowLevelMax()
        return self.get("windowLow"), self.get("windowHigh")

    def set_window(self, low: float, high: float, automatic: bool) -> None:
        """Write what the network sees, at once, so that nobody sees a window that is half the old one."""
        was_modifying = self.node.StartModify()
        self.set("windowLow", low)
        self.set("windowHigh", high)
        self.set("windowAutomatic", automatic)
        self.node.EndModify(was_modifying)

    @property
    def volume(self) -> Any:
        """The volume to segment, a vtkMRMLScalarVolumeNode; None where none is chosen."""
        return self._reference("volume")

    @property
    def segmentation(self) -> Any:
        """The vtkMRMLSegmentationNode that gets the segments; None where none is chosen."""
        return self._reference("segmentation")

    @property
    def rendering_box(self) -> Any:
        """The vtkMRMLMarkupsROINode that 3D views are cut to; None where there is none yet."""
        return self._reference("renderingBox")

    @property
    def rendering_plane(self) -> Any:
        """The vtkMRMLMarkupsPlaneNode that 3D views are cut by; None where there is none yet."""
        return self._reference("renderingPlane")

    def _reference(self, name: str) -> Any:
        return referred(self.node, name)

    def set_reference(self, name: str, node: slicer.vtkMRMLNode | None) -> None:
        """Refer to a node as one of `REFERENCES`."""
        self.node.SetNodeReferenceID(name, node.GetID() if node else None)

    def session_settings(self) -> SessionSettings:
        """What decides the features.

        Raises:
            InputError: the window is none.
        """
        low, high = self.get("windowLow"), self.get("windowHigh")
        automatic = self.get("windowAutomatic")
        if not automatic:
            IntensityWindow(low, high)  # Refuses what is no window.
        return SessionSettings(
            preset=self.get("preset") if self.get("preset") in PRESETS else DEFAULT_PRESET,
            grid=self.get("grid") or None,
            window=None if automatic else (low, high),
            model=self.get("model") or None,
            weights_path=self.get("weightsPath") or None,
            device=self.get("device"),
        )

    def refinement(self) -> Refinement:
        """How maps are refined."""
        method = self.get("refinement")
        if method not in REFINEMENT_METHODS:
            method = self.DEFAULTS["refinement"]
        return Refinement(method, self.get("onlyAnnotatedParts"))

    def rendering_mode(self) -> RenderingMode | None:
        """What the 3D views show; None: nothing."""
        mode = self.get("rendering")
        return mode if mode in get_args(RenderingMode) else None


def referred(parameter_node: slicer.vtkMRMLScriptedModuleNode, role: str) -> Any:
    """The node that a parameter node refers to as one of `REFERENCES`; None where it is gone, or of another class."""
    return node_of_class(parameter_node.GetNodeReference(role), REFERENCES[role])
