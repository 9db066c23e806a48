"""What a volume node holds at the moment: features belong to voxels, and a node may get others.

A sequence shows its frames one after the other in the same node, and users edit voxels. Nothing is compared voxel by voxel:
whoever changes an array says so, by a newer modification time or another array. How voxels are displayed is no part of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import slicer
from vtkmodules.util.numpy_support import vtk_to_numpy

from ...core.volumes.geometry import Geometry
from ...core.volumes.thumbnail import Thumbnail
from .volume_nodes import geometry_from_node


@dataclass(frozen=True)
class Frame:
    """Which item of a sequence a node shows: `number` of `count`, from 1."""

    number: int
    count: int


@dataclass(frozen=True, eq=False)
class VolumeContent:
    """Voxels and where they lie.

    Attributes:
        geometry: of the voxels, in the node's local frame.
        voxels: their array, not its address, which another one may get after it; and when it was changed last.
        frame: which frame of a sequence it is; None where the volume is no sequence.
    """

    geometry: Geometry
    voxels: tuple[Any, int]
    frame: Frame | None

    @property
    def array(self) -> np.ndarray:
        """The voxels, (K, J, I): a view on them, not a copy."""
        return vtk_to_numpy(self.voxels[0]).reshape(self.geometry.shape)

    @cached_property
    def thumbnail(self) -> Thumbnail | None:
        """What they show, as they are when this is asked first; None of a frame: the next one may show something else."""
        return Thumbnail.of(self.array, self.geometry) if self.frame is None else None

    @property
    def state(self) -> tuple[Any, ...]:
        """Differs from that of other content."""
        return (self.geometry.shape, self.geometry.ijk_to_ras.tobytes(), *self.voxels)


def content_of(node: slicer.vtkMRMLScalarVolumeNode) -> VolumeContent:
    """What a volume node holds now.

    Raises:
        InputError: nothing that can be segmented (`geometry_from_node`).
    """
    geometry = geometry_from_node(node)
    voxels = node.GetImageData().GetPointData().GetScalars()
    return VolumeContent(geometry, (voxels, voxels.GetMTime()), frame_of(node))


def frame_of(node: slicer.vtkMRMLScalarVolumeNode) -> Frame | None:
    """Which frame of a sequence a volume node shows; None where it is no sequence."""
    browser = _browser_of(node)
    return Frame(browser.GetSelectedItemNumber() + 1, browser.GetNumberOfItems()) if browser else None


def first_frame(node: slicer.vtkMRMLScalarVolumeNode) -> slicer.vtkMRMLScalarVolumeNode:
    """The node of a sequence's first frame, whichever a volume node shows; itself where it has none of its size."""
    browser = _browser_of(node)
    first = browser.GetSequenceNode(node).GetNthDataNode(0) if browser is not None else None
    image = first.GetImageData() if first is not None else None
    return first if image is not None and image.GetDimensions() == node.GetImageData().GetDimensions() else node


def changes_with(node: slicer.vtkMRMLNode, volume: slicer.vtkMRMLScalarVolumeNode) -> bool:
    """Whether a node shows an item of a sequence, too, that is chosen together with the frame of a volume node."""
    browser = _browser_of(volume)
    return browser is not None and browser.GetSequenceNode(node) is not None


def is_playing(node: slicer.vtkMRMLScalarVolumeNode) -> bool:
    """Whether a sequence is being played in a volume node."""
    browser = _browser_of(node)
    return browser is not None and bool(browser.GetPlaybackActive())


def _browser_of(node: slicer.vtkMRMLScalarVolumeNode) -> Any:
    """The sequence browser that chooses what the node shows; None where there is none."""
    scene = node.GetScene()
    browsers = (scene.GetNthNodeByClass(n, _BROWSER) for n in range(scene.GetNumberOfNodesByClass(_BROWSER)))
    return next((browser for browser in browsers if browser.GetSequenceNode(node) is not None), None)


_BROWSER = "vtkMRMLSequenceBrowserNode"
