"""The slice views go from point to point."""

from __future__ import annotations

from typing import Any

import pytest

from ViTTransferFunction.Logic.scene.classes.point_tour import PointTour

FIRST, SECOND, THIRD = (10.0, 20.0, 30.0), (-5.0, 0.0, 7.0), (1.0, 2.0, 3.0)


@pytest.fixture
def slice_nodes(slicer_app: Any) -> list[Any]:
    nodes = []
    for name, orientation in (("Red", "Axial"), ("Green", "Coronal"), ("Slice4", "Sagittal")):
        node = slicer_app.scene.AddNewNodeByClass("vtkMRMLSliceNode")
        node.SetLayoutName(name)
        node.SetOrientation(orientation)
        node.SetFieldOfView(80.0, 80.0, 1.0)
        nodes.append(node)
    return nodes


def centre(node: Any) -> tuple[float, ...]:
    return tuple(node.GetSliceToRAS().GetElement(row, 3) for row in range(3))


def test_all_slice_views_are_centred_on_one_point_after_the_other_and_the_first_follows_the_last(
    slicer_app: Any, slice_nodes: list[Any]
) -> None:
    tour = PointTour(slicer_app.scene)
    for expected in (FIRST, SECOND, THIRD, FIRST):
        assert tour.show_next([FIRST, SECOND, THIRD]) == expected
        assert [centre(node) for node in slice_nodes] == [pytest.approx(expected)] * 3
    assert [node.GetFieldOfView()[0] for node in slice_nodes] == [80.0] * 3


def test_the_tour_goes_on_where_it_was_after_points_came_or_went(slicer_app: Any, slice_nodes: list[Any]) -> None:
    tour = PointTour(slicer_app.scene)
    tour.show_next([FIRST, SECOND])
    assert tour.show_next([THIRD, FIRST, SECOND]) == SECOND
    assert tour.show_next([FIRST, THIRD]) == FIRST


def test_points_at_one_place_are_one_stop(slicer_app: Any, slice_nodes: list[Any]) -> None:
    tour = PointTour(slicer_app.scene)
    assert [tour.show_next([FIRST, FIRST, SECOND]) for _ in range(3)] == [FIRST, SECOND, FIRST]


def test_without_points_nothing_moves(slicer_app: Any, slice_nodes: list[Any]) -> None:
    before = [centre(node) for node in slice_nodes]
    assert PointTour(slicer_app.scene).show_next([]) is None
    assert [centre(node) for node in slice_nodes] == before
