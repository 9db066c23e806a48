"""Points that hang on the mouse until they are placed: Slicer shows them in all views, wherever the mouse is."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import slicer

from ..mrml.nodes import nodes_of_class


@contextmanager
def without_previews(scene: slicer.vtkMRMLScene) -> Iterator[None]:
    """Have them shown in no view meanwhile: pictures are of what is there."""
    preview = slicer.vtkMRMLMarkupsNode.PositionPreview
    hidden = [
        (node, index)
        for node in nodes_of_class(scene, "vtkMRMLMarkupsNode")
        for index in range(node.GetNumberOfControlPoints())
        if node.GetNthControlPointPositionStatus(index) == preview and node.GetNthControlPointVisibility(index)
    ]
    for node, index in hidden:
        node.SetNthControlPointVisibility(index, False)
    try:
        yield
    finally:
        for node, index in hidden:
            node.SetNthControlPointVisibility(index, True)
