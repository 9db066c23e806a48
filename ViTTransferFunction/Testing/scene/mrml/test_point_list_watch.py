"""What Slicer's views, and its table of points, do to a list, and what is heard of it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import vtk

from ViTTransferFunction.Logic.scene.mrml.point_list_watch import PointListWatch
from ViTTransferFunction.Testing.support.scenes import add_hanging_point, put_under


class Heard:
    """A watch on a list of two points, and what was heard of it since it was asked for last; nobody reads the list anew."""

    def __init__(self, scene: Any) -> None:
        self.node = scene.AddNewNodeByClass("vtkMRMLMarkupsFiducialNode")
        self.node.CreateDefaultDisplayNodes()
        for x in (0.0, 10.0):
            self.node.AddControlPointWorld(vtk.vtkVector3d(x, 0.0, 0.0))
        self._heard: list[str] = []
        names = ("placed", "step", "passing", "displayed")
        self.watch = PointListWatch(*(lambda points, name=name: self._hear(points, name) for name in names))
        self.watch.watch([self.node])

    def _hear(self, points: Any, name: str) -> None:
        assert points is self.node
        self._heard.append(name)

    def take(self) -> list[str]:
        """Also has the watch know what has become of the list."""
        heard, self._heard = self._heard, []
        self.watch.watch([self.node])
        return heard


@pytest.fixture
def heard(slicer_app: Any) -> Iterator[Heard]:
    heard = Heard(slicer_app.scene)
    assert heard.take() == ["displayed"]
    yield heard
    heard.watch.close()
    assert heard.watch.observer_count == 0


def test_a_point_that_is_added_is_placed(heard: Heard) -> None:
    heard.node.AddControlPointWorld(vtk.vtkVector3d(20.0, 0.0, 0.0))
    assert heard.take() == ["placed"]


def test_nothing_is_heard_of_a_point_that_hangs_on_the_mouse_until_it_is_placed(heard: Heard) -> None:
    add_hanging_point(heard.node.GetScene(), heard.node)
    heard.take()
    heard.node.SetNthControlPointPositionWorld(2, 6.0, 0.0, 0.0, heard.node.PositionPreview)
    assert heard.take() == []
    heard.node.SetNthControlPointPositionWorld(2, 7.0, 0.0, 0.0)
    assert set(heard.take()) == {"placed"}


def test_dragging_a_point_is_a_step_at_either_end_and_passes_in_between(heard: Heard) -> None:
    heard.node.InvokeEvent(heard.node.PointStartInteractionEvent)
    assert heard.take() == ["step"]
    heard.node.SetNthControlPointPositionWorld(1, 11.0, 0.0, 0.0)
    assert set(heard.take()) - {"displayed"} == {"passing"}
    heard.node.InvokeEvent(heard.node.PointEndInteractionEvent)
    assert heard.take() == ["step"]


def test_deleting_a_point_is_a_step(heard: Heard) -> None:
    heard.node.RemoveNthControlPoint(0)
    assert heard.take() == ["step"]


def test_unsetting_a_point_in_the_table_is_a_step_and_restoring_it_is_placing_it(heard: Heard) -> None:
    heard.node.UnsetNthControlPointPosition(0)
    assert heard.take() == ["step"]
    heard.node.RestoreNthControlPointPosition(0)
    assert heard.take() == ["placed"]


def test_a_name_and_a_transform_pass(heard: Heard) -> None:
    heard.node.SetName("liver")
    assert set(heard.take()) == {"passing"}
    put_under(heard.node, np.eye(4))
    assert set(heard.take()) == {"passing"}


def test_a_list_that_is_displayed_otherwise_may_have_another_colour(heard: Heard) -> None:
    heard.node.GetDisplayNode().SetSelectedColor(1.0, 0.5, 0.0)
    assert set(heard.take()) == {"displayed", "passing"}


def test_a_list_that_is_not_named_any_more_is_left_alone(heard: Heard) -> None:
    heard.watch.watch([])
    heard.node.RemoveNthControlPoint(0)
    assert heard.watch.observer_count == 0
    # It is new when it comes back.
    assert heard.take() == []
    assert heard.take() == ["displayed"]
