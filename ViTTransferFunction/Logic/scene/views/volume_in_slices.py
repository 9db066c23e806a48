"""The segmented volume in the slice views: whoever clicks there is to see what is segmented, not another scan."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import slicer

from ..mrml.nodes import nodes_of_class
from .slice_layer import COMPOSITE_CLASS

ROOM = 1.1
"""How many times the size of a volume a view shows at least, where the volume is small in it."""


def is_in_slices(
    scene: slicer.vtkMRMLScene, app_logic: slicer.vtkMRMLApplicationLogic, volume: slicer.vtkMRMLScalarVolumeNode
) -> bool:
    """Whether a slice view of the layout shows a volume, in the background or the foreground; also where there is no view."""
    seen = [composite for logic, composite in _views(scene, app_logic) if logic.GetSliceNode().IsMappedInLayout()]
    return not seen or any(_shows(composite, volume) for composite in seen)


def show_in_slices(
    scene: slicer.vtkMRMLScene, app_logic: slicer.vtkMRMLApplicationLogic, volume: slicer.vtkMRMLScalarVolumeNode
) -> None:
    """Have all slice views show a volume, unless one of the layout does.

    As Slicer's Segment Editor does, in place of all that they show; but views on a place where the volume is not go to it.
    Views that do not show what is loaded do not show this either.
    """
    if is_in_slices(scene, app_logic, volume):
        return
    for logic, composite in _views(scene, app_logic):
        if not composite.GetDoPropagateVolumeSelection():
            continue
        was_empty = composite.GetBackgroundVolumeID() is None
        was_modifying = composite.StartModify()
        composite.SetBackgroundVolumeID(volume.GetID())
        composite.SetForegroundVolumeID(None)
        composite.SetLabelVolumeID(None)
        composite.EndModify(was_modifying)
        if was_empty or not _is_on(logic.GetSliceNode(), volume):
            logic.FitSliceToBackground()


def fit_in_slices(
    scene: slicer.vtkMRMLScene, app_logic: slicer.vtkMRMLApplicationLogic, volume: slicer.vtkMRMLScalarVolumeNode
) -> None:
    """Have slice views that show a volume alone, and smaller than they could, show it as large as they can.

    When Slicer loads a scan, it fits views to all that they show, the overlay of the scan before among it. Views stay on the
    slice that they are on, unless the volume is not there.
    """
    for logic, composite in _views(scene, app_logic):
        slice_node = logic.GetSliceNode()
        alone = composite.GetForegroundVolumeID() is None and composite.GetLabelVolumeID() is None
        if not alone or not _shows(composite, volume) or not _is_small_in(logic, volume):
            continue
        offset = slice_node.GetSliceOffset()
        logic.FitSliceToVolume(volume, *slice_node.GetDimensions()[:2])
        fitted = slice_node.GetSliceOffset()
        slice_node.SetSliceOffset(offset)
        if not _is_on(slice_node, volume):
            slice_node.SetSliceOffset(fitted)


def _views(scene: slicer.vtkMRMLScene, app_logic: slicer.vtkMRMLApplicationLogic) -> Iterator[tuple[Any, Any]]:
    """Of each slice view its logic, and the node that says which volumes it shows."""
    for composite in nodes_of_class(scene, COMPOSITE_CLASS):
        logic = app_logic.GetSliceLogicByLayoutName(composite.GetLayoutName() or "")
        if logic is not None:
            yield logic, composite


def _shows(composite: slicer.vtkMRMLSliceCompositeNode, volume: slicer.vtkMRMLScalarVolumeNode) -> bool:
    in_foreground = composite.GetForegroundVolumeID() == volume.GetID() and composite.GetForegroundOpacity() > 0.0
    return in_foreground or composite.GetBackgroundVolumeID() == volume.GetID()


def _is_small_in(logic: slicer.vtkMRMLSliceLogic, volume: slicer.vtkMRMLScalarVolumeNode) -> bool:
    """Whether a slice view has room around a volume on all sides."""
    size_mm, _centre = [0.0] * 3, [0.0] * 3
    logic.GetVolumeSliceDimensions(volume, size_mm, _centre)
    return all(seen > ROOM * size for seen, size in zip(logic.GetSliceNode().GetFieldOfView()[:2], size_mm[:2], strict=True))


def _is_on(slice_node: slicer.vtkMRMLSliceNode, volume: slicer.vtkMRMLScalarVolumeNode) -> bool:
    """Whether the middle of a slice view lies in a volume."""
    bounds = [0.0] * 6
    volume.GetRASBounds(bounds)
    centre = (slice_node.GetSliceToRAS().GetElement(axis, 3) for axis in range(3))
    return all(bounds[2 * axis] <= place <= bounds[2 * axis + 1] for axis, place in enumerate(centre))
