"""Sequences of volumes, as a 4D scan is one."""

from __future__ import annotations

from typing import Any

import slicer

from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image


class Sequence:
    """A sequence in Slicer's own nodes.

    Args:
        scene: gets the nodes.
        frames: in order; the first one is shown.

    Attributes:
        volume: the node that shows a frame.
        browser: the node that chooses it.
    """

    def __init__(self, scene: Any, frames: list[Volume]) -> None:
        self._logic = slicer.vtkSlicerSequencesLogic()
        self._logic.SetMRMLScene(scene)
        sequence = scene.AddNewNodeByClass("vtkMRMLSequenceNode", "heart")
        for number, frame in enumerate(frames):
            node = slicer.vtkMRMLScalarVolumeNode()
            set_image(node, frame.array, frame.geometry.ijk_to_ras)
            sequence.SetDataNodeAtValue(node, str(number))
        self.browser = scene.AddNewNodeByClass("vtkMRMLSequenceBrowserNode", "browser")
        self.browser.SetAndObserveMasterSequenceNodeID(sequence.GetID())
        self.show(1)
        self.volume = self.browser.GetProxyNode(sequence)
        self.volume.CreateDefaultDisplayNodes()

    def show(self, number: int) -> None:
        """Choose a frame, from 1."""
        self.browser.SetSelectedItemNumber(number - 1)
        self._logic.UpdateProxyNodesFromSequences(self.browser)
