"""Points and segments that stay where they are while their volume is moved are told of, until that is over."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import vtk

from ViTTransferFunction.Logic.scene.annotation.annotations import SceneAnnotations
from ViTTransferFunction.Logic.scene.annotation.left_behind import LeftBehind
from ViTTransferFunction.Logic.scene.interface.parameters import SceneParameters
from ViTTransferFunction.Logic.scene.interface.problems import Problems
from ViTTransferFunction.Logic.scene.mrml.transforms import vtk_matrix
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image
from ViTTransferFunction.Testing.support.scenes import (
    MOVED,
    OBLIQUE,
    add_parameter_node,
    add_volume,
    annotate,
    bend,
    open_spheres,
    put_under,
    segment_masks,
    write_all,
)
from ViTTransferFunction.Testing.support.spheres import Spheres

ARRAY = np.arange(60, dtype=np.int16).reshape(3, 4, 5)


class Place:
    """A volume, a class with two points on it and one off it, and one without points.

    Attributes:
        volume: the volume.
        lists: of points.
        transform: nothing is under it yet.
    """

    def __init__(self, scene: Any) -> None:
        parameters = SceneParameters(add_parameter_node(scene))
        self.annotations = SceneAnnotations(scene, parameters.node, lambda: None)
        self.volume = scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "CT")
        set_image(self.volume, ARRAY, OBLIQUE)
        parameters.set_reference("volume", self.volume)
        self.id = self.annotations.add_class("liver").id
        self.annotations.add_points(self.id, np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), positive=True)
        self.annotations.add_points(self.id, np.array([[7.0, 8.0, 9.0]]), positive=False)
        self.annotations.add_class("nothing yet")
        self.lists = [self.annotations.points_node(self.id, positive) for positive in (True, False)]
        self.transform = scene.AddNewNodeByClass("vtkMRMLLinearTransformNode", "Registration")
        self.transform.SetMatrixTransformToParent(vtk_matrix(MOVED))
        self._problems = Problems()
        self._left_behind = LeftBehind(parameters, self.annotations, self._problems)
        assert self.told() == ()

    def put_under_transform(self, *nodes: Any) -> None:
        for node in nodes:
            node.SetAndObserveTransformNodeID(self.transform.GetID())

    def told(self) -> tuple[str, ...]:
        """What stands after a look."""
        before = self._problems.standing
        assert self._left_behind.look() == (self._problems.standing != before)
        return self._problems.standing


@pytest.fixture
def place(slicer_app: Any) -> Iterator[Place]:
    place = Place(slicer_app.scene)
    yield place
    place.annotations.close()


def test_a_volume_that_is_moved_alone_is_told_of_until_the_points_follow(place: Place) -> None:
    place.put_under_transform(place.volume)
    (message,) = place.told()
    assert "'CT' was moved, and the points of 'liver' were not" in message
    assert place.told() == (message,)
    place.put_under_transform(*place.lists)
    assert place.told() == ()


def test_points_outside_alone_are_told_of_as_well(place: Place) -> None:
    spleen = place.annotations.add_class("spleen")
    place.annotations.add_points(spleen.id, np.array([[7.0, 8.0, 9.0]]), positive=False)
    assert place.told() == ()
    place.put_under_transform(place.volume)
    (message,) = place.told()
    assert "the points of 'liver', 'spleen' were not" in message


def test_what_is_moved_together_is_not_told_of_in_whatever_order(place: Place) -> None:
    place.put_under_transform(*place.lists, place.volume)
    assert place.told() == ()
    place.transform.SetMatrixTransformToParent(vtk_matrix(np.eye(4)))
    assert place.told() == ()


def test_what_was_moved_together_is_told_of_when_the_volume_comes_back_alone(place: Place) -> None:
    place.put_under_transform(*place.lists, place.volume)
    assert place.told() == ()
    place.volume.SetAndObserveTransformNodeID(None)
    assert place.told()


def test_points_that_are_moved_alone_are_their_users_affair(place: Place) -> None:
    place.put_under_transform(*place.lists)
    assert place.told() == ()


def test_it_is_over_when_the_volume_comes_back_though_not_at_once(place: Place) -> None:
    place.put_under_transform(place.volume)
    assert place.told()
    place.transform.SetMatrixTransformToParent(vtk_matrix(np.diag([1.0, -1.0, 1.0, 1.0])))
    assert place.told()
    place.volume.SetAndObserveTransformNodeID(None)
    assert place.told() == ()


def test_it_is_over_when_points_are_placed_anew(place: Place) -> None:
    place.put_under_transform(place.volume)
    assert place.told()
    place.annotations.remove_last_point(place.id)
    assert place.told() == ()


def test_an_origin_that_is_corrected_moves_the_volume_as_well(place: Place) -> None:
    place.volume.SetOrigin(0.0, 0.0, 0.0)
    assert place.told()


def test_hardening_a_transform_moves_nothing(place: Place) -> None:
    place.put_under_transform(place.volume, *place.lists)
    assert place.told() == ()
    place.volume.HardenTransform()
    assert place.told() == ()


def test_other_voxels_elsewhere_are_no_move(place: Place) -> None:
    set_image(place.volume, ARRAY[1:], MOVED)
    assert place.told() == ()


def test_a_session_tells_it_once(slicer_app: Any, spheres: Spheres) -> None:
    session = SceneSession(slicer_app.scene, slicer_app.app_logic, add_parameter_node(slicer_app.scene))
    state = session.annotations.add_class("liver")
    points = session.annotations.points_node(state.id, positive=True)
    points.AddControlPointWorld(vtk.vtkVector3d(0.0, 0.0, 0.0))
    session.set_volume(add_volume(slicer_app.scene, spheres[0]))
    session.poll()
    heard: list[str | None] = []
    session.add_observer(lambda: heard.append(session.take_error()))
    put_under(session.parameters.volume, MOVED)
    session.poll()
    session.poll()
    (message,) = filter(None, heard)
    assert "was moved, and the points of 'liver' were not" in message
    assert message in session.errors
    session.close()


class Written:
    """Three structures with points, and their segments.

    Attributes:
        session: of them.
        volume: which they are of.
        segmentation: where they were written.
        lists: of points.
    """

    def __init__(self, slicer_app: Any, spheres: Spheres) -> None:
        self.session = open_spheres(slicer_app, spheres)
        ids = annotate(self.session, spheres)
        write_all(self.session)
        self.volume, self.segmentation = self.session.parameters.volume, self.session.parameters.segmentation
        self.lists = [self.session.annotations.points_node(id_, positive) for id_ in ids for positive in (True, False)]

    def told(self) -> str:
        """What is told of the places of things, or ""."""
        self.session.poll()
        return next((error for error in self.session.errors if "was moved" in error), "")


@pytest.fixture
def written(slicer_app: Any, spheres: Spheres) -> Iterator[Written]:
    written = Written(slicer_app, spheres)
    yield written
    written.session.close()


def test_segments_that_stay_are_told_of_after_the_points_followed_until_they_follow(written: Written) -> None:
    transform = put_under(written.volume, MOVED)
    assert "the points of 'sphere 1', 'sphere 2', 'sphere 3' and the segments of" in written.told()
    for node in written.lists:
        node.SetAndObserveTransformNodeID(transform.GetID())
    message = written.told()
    assert f"the segments of '{written.segmentation.GetName()}' were not" in message
    assert "the points" not in message
    written.session.annotations.add_class("another")
    assert written.told() == message
    written.segmentation.SetAndObserveTransformNodeID(transform.GetID())
    assert written.told() == ""


def test_in_another_scene_nothing_was_moved(slicer_app: Any, written: Written) -> None:
    slicer_app.scene.StartState(slicer_app.scene.RestoreState)
    put_under(written.volume, MOVED)
    slicer_app.scene.EndState(slicer_app.scene.RestoreState)
    assert written.told() == ""


def test_segments_that_follow_are_not_told_of_with_points_that_stay(written: Written) -> None:
    transform = put_under(written.volume, MOVED)
    written.segmentation.SetAndObserveTransformNodeID(transform.GetID())
    assert "'sphere 3' were not" in written.told()


def test_of_segments_that_are_bent_nobody_can_say_whether_they_were_left(written: Written) -> None:
    bend(written.segmentation)
    assert written.told() == ""


def test_segments_that_are_written_anew_are_where_the_volume_is(written: Written) -> None:
    before = segment_masks(written.segmentation, written.volume)
    transform = put_under(written.volume, MOVED)
    for node in written.lists:
        node.SetAndObserveTransformNodeID(transform.GetID())
    assert written.told()
    written.session.segments.write("ask")
    written.session.wait()
    assert written.told() == ""
    after = segment_masks(written.segmentation, written.volume)
    assert {name: mask.sum() for name, mask in after.items()} == {name: mask.sum() for name, mask in before.items()}


def test_segments_that_were_moved_before_the_volume_are_not_told_of(written: Written) -> None:
    transform = put_under(written.segmentation, MOVED)
    assert written.told() == ""
    for node in (*written.lists, written.volume):
        node.SetAndObserveTransformNodeID(transform.GetID())
    assert written.told() == ""


def test_hardening_the_transforms_of_all_moves_no_segments(written: Written) -> None:
    transform = put_under(written.volume, MOVED)
    for node in (*written.lists, written.segmentation):
        node.SetAndObserveTransformNodeID(transform.GetID())
    assert written.told() == ""
    for node in (written.volume, *written.lists, written.segmentation):
        node.HardenTransform()
        assert written.told() == ""
