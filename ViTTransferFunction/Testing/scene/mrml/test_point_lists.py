"""Lists of points are brought to what classes have."""

from __future__ import annotations

from typing import Any

import vtk

from ViTTransferFunction.Logic.scene.mrml.point_lists import defined_points, set_points


def test_points_that_come_or_go_together_are_drawn_anew_once(slicer_app: Any) -> None:
    node = slicer_app.scene.AddNewNodeByClass("vtkMRMLMarkupsFiducialNode")
    told: list[str] = []
    # What Slicer's views draw all points anew upon.
    for event in (vtk.vtkCommand.ModifiedEvent, node.PointAddedEvent, node.PointModifiedEvent, node.PointRemovedEvent):
        node.AddObserver(event, lambda _, name: told.append(name))
    counts = []
    for count in (5, 50, 0):
        points = tuple((float(index), 0.0, 0.0) for index in range(count))
        told.clear()
        set_points(node, points, {})
        assert defined_points(node) == points
        counts.append(len(told))
    assert max(counts) <= 4
    assert min(counts) >= 1
