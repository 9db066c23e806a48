"""Points in segments: to continue what others made, and to say what structures are not."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import vtk
from vtkmodules.util.numpy_support import vtk_to_numpy

from ViTTransferFunction.Logic.compute.proxy import SegmentationProxy
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry, transform_points
from ViTTransferFunction.Logic.scene.mrml.transforms import matrix_to_world
from ViTTransferFunction.Logic.scene.segments.outside_points import outside_points
from ViTTransferFunction.Logic.scene.segments.segment_points import SegmentPoints
from ViTTransferFunction.Logic.scene.segments.segment_tags import CORRECTED_TAG, set_tag
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.scenes import MOVED, OBLIQUE, add_parameter_node, add_segment, bend, put_under
from ViTTransferFunction.Testing.support.segments import LABELMAP, SHAPE, block, output, positions_of, rounded, write_segments


@pytest.fixture
def session(slicer_app: Any, a_segmentation: Any) -> Iterator[SceneSession]:
    """A session without a volume, into whose segmentation a colleague wrote."""
    a_segmentation.CreateDefaultDisplayNodes()
    session = SceneSession(slicer_app.scene, slicer_app.app_logic, add_parameter_node(slicer_app.scene))
    session.set_segmentation(a_segmentation)
    yield session
    session.close()


def known(segmentation: Any, *segment_ids: str) -> SegmentPoints:
    """The points of segments, all of them found."""
    points = SegmentPoints(segmentation.GetScene())
    for segment_id in segment_ids:
        points.of(segmentation, segment_id, 3)
    while points.busy:
        points.advance()
    return points


def test_points_lie_in_the_segment_also_where_it_was_moved(a_segmentation: Any, a_volume: Any) -> None:
    add_segment(a_segmentation, "liver", block(1, 4), OBLIQUE)
    add_segment(a_segmentation, "spleen", block(4, 6), OBLIQUE)
    put_under(a_segmentation, MOVED)
    put_under(a_volume, MOVED)
    points = known(a_segmentation, "liver").of(a_segmentation, "liver", 3)
    assert points is not None
    assert len(points) == 3
    assert set(rounded(points)) <= set(positions_of(block(1, 4), a_volume))


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int16])
def test_points_are_found_in_a_segment_that_a_script_made_whatever_the_type_of_its_voxels(
    session: SceneSession, a_segmentation: Any, a_volume: Any, dtype: type[np.number[Any]]
) -> None:
    segment_id = add_segment(a_segmentation, "liver", block(1, 4), OBLIQUE, dtype)
    labelmap = a_segmentation.GetSegmentation().GetSegment(segment_id).GetRepresentation(LABELMAP)
    assert vtk_to_numpy(labelmap.GetPointData().GetScalars()).dtype == dtype
    session.continue_segment(segment_id)
    session.wait()
    (state,) = session.classes
    assert set(rounded(np.array(state.positive))) <= set(positions_of(block(1, 4), a_volume))


def test_points_are_found_anew_when_voxels_change_and_only_then(a_segmentation: Any, a_volume: Any) -> None:
    (ours,) = write_segments(a_segmentation, a_volume, [output(block(1, 4))], respect_others=True)
    points = known(a_segmentation, ours)
    first = points.of(a_segmentation, ours, 3)
    a_segmentation.GetSegmentation().GetSegment(ours).SetName("renamed")
    assert points.of(a_segmentation, ours, 3) is not None
    assert not points.busy
    write_segments(a_segmentation, a_volume, [output(block(5, 6))], respect_others=True)
    assert points.of(a_segmentation, ours, 3) is None
    while points.busy:
        points.advance()
    again = points.of(a_segmentation, ours, 3)
    assert first is not None
    assert again is not None
    assert set(rounded(again)).isdisjoint(rounded(first))


@pytest.mark.parametrize("steps", [3, None])
def test_labelmaps_of_segments_that_are_removed_leave_memory(
    a_segmentation: Any, steps: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ViTTransferFunction.Logic.core.volumes.stepped_work.ADVANCE_S", 0.0)
    add_segment(a_segmentation, "liver", block(1, 4), OBLIQUE)
    labelmap = vtk.vtkWeakReference()
    labelmap.Set(a_segmentation.GetSegmentation().GetSegment("liver").GetRepresentation(LABELMAP))
    points = SegmentPoints(a_segmentation.GetScene())
    points.of(a_segmentation, "liver", 3)
    for _ in range(steps or 1000):
        points.advance()
    assert points.busy == (steps is not None)
    a_segmentation.GetSegmentation().RemoveSegment("liver")
    points.advance()
    gc.collect()
    assert not points.busy
    assert labelmap.Get() is None


@pytest.mark.parametrize("steps", range(1, 6))
def test_a_segment_that_is_erased_while_points_in_it_are_searched_for_has_none(
    a_segmentation: Any, steps: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ViTTransferFunction.Logic.core.volumes.stepped_work.ADVANCE_S", 0.0)
    add_segment(a_segmentation, "liver", block(1, 4), OBLIQUE)
    points = SegmentPoints(a_segmentation.GetScene())
    points.of(a_segmentation, "liver", 3)
    for _ in range(steps):
        points.advance()
    # As the Segment Editor does.
    labelmap = a_segmentation.GetSegmentation().GetSegment("liver").GetRepresentation(LABELMAP)
    vtk_to_numpy(labelmap.GetPointData().GetScalars())[:] = 0
    labelmap.Modified()
    points.of(a_segmentation, "liver", 3)
    while points.busy:
        points.advance()
    found = points.of(a_segmentation, "liver", 3)
    assert found is not None
    assert len(found) == 0


def test_a_search_that_fails_is_over(a_segmentation: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ViTTransferFunction.Logic.core.volumes.stepped_work.ADVANCE_S", 60.0)

    def fail(*_: Any) -> Any:
        raise ValueError("a defect")

    monkeypatch.setattr("ViTTransferFunction.Logic.scene.segments.segment_points.points_in_label", fail)
    add_segment(a_segmentation, "liver", block(1, 4), OBLIQUE)
    points = SegmentPoints(a_segmentation.GetScene())
    points.of(a_segmentation, "liver", 3)
    with pytest.raises(ValueError, match="a defect"):
        points.advance()
    assert not points.busy


def test_a_class_continues_a_segment_in_one_step(session: SceneSession, a_segmentation: Any, a_volume: Any) -> None:
    segment_id = add_segment(a_segmentation, "liver", block(1, 4), OBLIQUE)
    a_segmentation.GetSegmentation().GetSegment(segment_id).SetColor(0.2, 0.4, 0.6)
    told: list[bool] = []
    session.add_observer(lambda: told.append(session.busy))
    session.continue_segment(segment_id)
    assert told[-1:] == [True]
    session.wait()
    (state,) = session.classes
    assert (state.name, state.color, state.continues) == ("liver", pytest.approx((0.2, 0.4, 0.6)), segment_id)
    assert session.selected_class == state
    assert len(state.positive) == 5
    assert set(rounded(np.array(state.positive))) <= set(positions_of(block(1, 4), a_volume))
    session.annotations.undo()
    assert session.classes == ()
    session.annotations.redo()
    assert session.classes == (state,)


def test_segments_that_are_chosen_one_right_after_the_other_are_all_continued(
    session: SceneSession, a_segmentation: Any
) -> None:
    add_segment(a_segmentation, "liver", block(1, 3), OBLIQUE)
    add_segment(a_segmentation, "empty", np.zeros(SHAPE, dtype=bool), OBLIQUE)
    add_segment(a_segmentation, "spleen", block(3, 5), OBLIQUE)
    told: list[str | None] = []
    session.add_observer(lambda: told.append(session.take_error()))
    for segment_id in ("liver", "empty", "spleen", "spleen"):
        session.continue_segment(segment_id)
    session.wait()
    assert [state.name for state in session.classes] == ["liver", "spleen"]
    assert session.selected_class == session.classes[-1]
    assert ["'empty' is empty" in error for error in told if error] == [True]


def test_a_segment_waits_for_the_points_of_one_that_was_chosen_before(
    session: SceneSession, a_segmentation: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    liver = add_segment(a_segmentation, "liver", block(1, 3), OBLIQUE)
    spleen = add_segment(a_segmentation, "spleen", block(3, 5), OBLIQUE)
    of, not_found = SegmentPoints.of, [liver]
    monkeypatch.setattr(SegmentPoints, "of", lambda points, *of_what: None if of_what[1] in not_found else of(points, *of_what))
    for segment_id in (liver, spleen):
        session.continue_segment(segment_id)
    session.wait()
    assert not session.classes
    not_found.clear()
    session.continue_segment(spleen)
    session.wait()
    assert [state.name for state in session.classes] == ["liver", "spleen"]


def test_an_empty_segment_cannot_be_continued(session: SceneSession, a_segmentation: Any) -> None:
    session.continue_segment(add_segment(a_segmentation, "liver", np.zeros(SHAPE, dtype=bool), OBLIQUE))
    session.wait()
    assert session.classes == ()
    assert "'liver' is empty" in (session.take_error() or "")


def test_a_segment_without_voxels_of_its_own_is_not_taken_for_empty(session: SceneSession, surfaces_only: Any) -> None:
    session.continue_segment("implant")
    session.wait()
    assert not session.classes
    assert "'implant' is stored as 'Closed surface'" in (session.take_error() or "")
    # As the user is advised to.
    surfaces_only.GetSegmentation().CreateRepresentation(LABELMAP)
    session.continue_segment("implant")
    session.wait()
    (state,) = session.classes
    assert (state.name, bool(state.positive)) == ("implant", True)


@pytest.mark.parametrize("what", ["the segment", "the segmentation"])
def test_a_segment_that_is_deleted_meanwhile_is_not_continued(session: SceneSession, a_segmentation: Any, what: str) -> None:
    segment_id = add_segment(a_segmentation, "liver", block(1, 4), OBLIQUE)
    session.continue_segment(segment_id)
    if what == "the segment":
        a_segmentation.GetSegmentation().RemoveSegment(segment_id)
    else:
        a_segmentation.GetScene().RemoveNode(a_segmentation)
    session.wait()
    assert (session.classes, session.take_error()) == ((), None)


def test_a_segment_is_not_continued_in_another_scan_that_is_chosen_meanwhile(
    session: SceneSession, a_segmentation: Any, a_volume: Any
) -> None:
    session.continue_segment(add_segment(a_segmentation, "liver", block(1, 4), OBLIQUE))
    session.set_volume(a_volume)
    session.wait()
    assert (session.classes, session.take_error()) == ((), None)


def class_at(session: SceneSession, mask: np.ndarray, volume: Any) -> Any:
    """A class with a point in the middle of a mask."""
    state = session.annotations.add_class()
    points = positions_of(mask, volume)
    session.annotations.add_points(state.id, np.array([points[len(points) // 2]]), positive=True)
    return next(new for new in session.classes if new.id == state.id)


def test_visible_segments_of_others_are_outside_of_all_classes(
    session: SceneSession, a_segmentation: Any, a_volume: Any
) -> None:
    add_segment(a_segmentation, "bone", block(4, 6), OBLIQUE)
    add_segment(a_segmentation, "hidden", block(3, 4), OBLIQUE)
    a_segmentation.GetDisplayNode().SetSegmentVisibility("hidden", False)
    first, second = class_at(session, block(0, 1), a_volume), class_at(session, block(1, 2), a_volume)
    outside = outside_points(a_segmentation, session.classes, known(a_segmentation, "bone", "hidden"))
    for state in (first, second):
        assert len(outside[state.id]) == 3
        assert set(rounded(outside[state.id])) <= set(positions_of(block(4, 6), a_volume))


@pytest.mark.parametrize("moved", [False, True], ids=["in place", "moved"])
def test_a_segment_in_which_a_class_was_clicked_is_not_outside_of_it(
    session: SceneSession, a_segmentation: Any, a_volume: Any, moved: bool
) -> None:
    """A body that holds everything says nothing about what is not an organ."""
    add_segment(a_segmentation, "body", np.ones(SHAPE, dtype=bool), OBLIQUE)
    add_segment(a_segmentation, "liver", block(1, 4), OBLIQUE)
    if moved:
        put_under(a_segmentation, MOVED)
        put_under(a_volume, MOVED)
    lesion, bone = class_at(session, block(2, 3), a_volume), class_at(session, block(5, 6), a_volume)
    right_beside = session.annotations.add_class()
    beyond = Geometry(SHAPE, OBLIQUE).ijk_to_ras_points(np.array([SHAPE[::-1]]))
    session.annotations.add_points(right_beside.id, transform_points(matrix_to_world(a_volume), beyond), positive=True)
    outside = outside_points(a_segmentation, session.classes, known(a_segmentation, "body", "liver"))
    assert [len(outside[state.id]) for state in (lesion, bone, right_beside)] == [0, 3, 6]


def test_segments_of_the_classes_themselves_are_not_outside(session: SceneSession, a_segmentation: Any, a_volume: Any) -> None:
    first, second = class_at(session, block(0, 1), a_volume), class_at(session, block(1, 2), a_volume)
    ids = write_segments(a_segmentation, a_volume, [output(block(3, 4), first.id), output(block(4, 5), second.id)], True)
    points = known(a_segmentation, *ids)
    outside = outside_points(a_segmentation, session.classes, points)
    assert [len(outside[state.id]) for state in (first, second)] == [0, 0]
    segment = a_segmentation.GetSegmentation().GetSegment(ids[0])
    segment.RemoveTag("ViTTransferFunction.class")
    set_tag(segment, CORRECTED_TAG, first.id)
    outside = outside_points(a_segmentation, session.classes, points)
    assert [len(outside[state.id]) for state in (first, second)] == [0, 3]


def test_outside_points_are_asked_for_but_not_kept(
    session: SceneSession, a_segmentation: Any, a_volume: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only where the user wants them, and anew when a segment changes."""
    asked: list[Any] = []
    monkeypatch.setattr(SegmentationProxy, "update", lambda self, classes, refinement, first: asked.append(tuple(classes)))
    monkeypatch.setattr(SegmentationProxy, "open", lambda self, volume, settings: None)
    add_segment(a_segmentation, "bone", block(4, 6), OBLIQUE)
    session.set_volume(a_volume)
    class_at(session, block(0, 1), a_volume)
    assert len(asked[-1][0].negative) == 0
    session.parameters.set("otherSegmentsAreOutside", True)
    session.wait()
    assert len(asked[-1][0].negative) == 3
    assert session.classes[0].negative == ()
    add_segment(a_segmentation, "vessel", block(2, 3), OBLIQUE)
    session.wait()
    assert len(asked[-1][0].negative) == 6
    before, shift = asked[-1][0].negative, np.eye(4)
    shift[:3, 3] = -OBLIQUE[:3, 2]  # By one slice.
    put_under(a_segmentation, shift)
    session.wait()
    np.testing.assert_allclose(asked[-1][0].negative, before + shift[:3, 3])
    transform = a_segmentation.GetParentTransformNode()
    bend(a_segmentation)
    session.wait()
    assert len(asked[-1][0].negative) == 0
    a_segmentation.SetAndObserveTransformNodeID(transform.GetID())
    session.wait()
    assert len(asked[-1][0].negative) == 6
    a_segmentation.GetDisplayNode().SetVisibility(False)
    session.wait()
    assert len(asked[-1][0].negative) == 0
    session.parameters.set("otherSegmentsAreOutside", False)
    count = len(asked)
    a_segmentation.GetDisplayNode().SetVisibility(True)
    session.wait()
    assert len(asked) == count
