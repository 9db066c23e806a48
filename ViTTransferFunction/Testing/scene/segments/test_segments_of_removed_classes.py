"""Segments of classes that are gone: the next writing removes them, and they take voxels from nobody before."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("slicer")

from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.scene.segments.test_corrections import paint
from ViTTransferFunction.Testing.support.scenes import OBLIQUE, add_segment, annotate, segment_masks, write_all
from ViTTransferFunction.Testing.support.segments import (
    LABELMAP,
    SHAPE,
    block,
    everything_about,
    output,
    positions_of,
    voxels_of,
    write_segments,
)
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras


@pytest.fixture
def session(session: SceneSession, spheres: Spheres) -> SceneSession:
    """A session with three structures, one on each sphere, that were written as segments."""
    annotate(session, spheres)
    write_all(session)
    return session


def masks(session: SceneSession) -> dict[str, np.ndarray]:
    return segment_masks(session.parameters.segmentation, session.parameters.volume)


def correct(session: SceneSession, id_: str, mask: np.ndarray) -> None:
    segment_id = session.segments.of(id_)
    assert segment_id is not None
    paint(session.parameters.segmentation, session.parameters.volume, segment_id, mask)


def test_the_segment_of_a_removed_class_goes_and_takes_no_voxel_before(session: SceneSession, spheres: Spheres) -> None:
    before = masks(session)
    session.annotations.remove_class(session.classes[1].id)
    session.annotations.add_points(session.classes[0].id, centre_ras(spheres, 2), positive=True)
    session.wait()
    assert list(masks(session)) == ["sphere 1", "sphere 2", "sphere 3"]
    write_all(session)
    after = masks(session)
    assert list(after) == ["sphere 1", "sphere 3"]
    assert (after["sphere 1"] & before["sphere 2"]).sum() > 0.8 * before["sphere 2"].sum()


def test_undo_brings_the_class_back_and_the_next_writing_its_segment(session: SceneSession) -> None:
    before = masks(session)
    session.annotations.remove_class(session.classes[1].id)
    session.wait()
    write_all(session)
    session.annotations.undo()
    session.wait()
    write_all(session)
    after = masks(session)
    assert set(after) == set(before)
    np.testing.assert_array_equal(after["sphere 2"], before["sphere 2"])


def test_a_corrected_one_stays_as_the_users_also_where_corrections_are_overwritten(
    session: SceneSession, spheres: Spheres
) -> None:
    removed = session.classes[1].id
    correct(session, removed, spheres[1] == 0)
    corrected = masks(session)["sphere 2"]
    session.annotations.remove_class(removed)
    session.wait()
    for corrections in ("ask", "overwrite"):
        session.segments.write(corrections)
        session.wait()
        assert session.segments.take_corrected() == ()
        np.testing.assert_array_equal(masks(session)["sphere 2"], corrected)
    assert session.segments.of(removed) is None
    assert not session.segments.outdated


def test_where_no_class_is_left_writing_removes_the_segments_and_leaves_those_of_others(
    session: SceneSession, spheres: Spheres
) -> None:
    segmentation = session.parameters.segmentation
    segmentation.GetSegmentation().CreateRepresentation("Closed surface")
    add_segment(segmentation, "bone", spheres[1] == 0, spheres[0].geometry.ijk_to_ras)
    others = everything_about(segmentation, "bone")
    for state in session.classes:
        session.annotations.remove_class(state.id)
    session.wait()
    assert session.segments.can_write
    assert session.segments.exist
    write_all(session)
    assert list(masks(session)) == ["bone"]
    assert everything_about(segmentation, "bone") == others
    assert not session.segments.can_write
    assert not session.segments.exist


def test_a_class_without_points_is_as_good_as_gone(session: SceneSession) -> None:
    session.annotations.remove_last_point(session.classes[0].id)
    session.wait()
    write_all(session)
    assert list(masks(session)) == ["sphere 2", "sphere 3"]


def test_the_segment_of_a_removed_class_is_not_outside_of_the_others(session: SceneSession) -> None:
    session.annotations.remove_class(session.classes[1].id)
    session.wait()
    before = masks(session)
    session.parameters.set("otherSegmentsAreOutside", True)
    session.wait()
    write_all(session)
    for name, mask in masks(session).items():
        np.testing.assert_array_equal(mask, before[name])


def test_a_class_that_comes_back_while_its_segment_is_to_be_removed_keeps_it(session: SceneSession) -> None:
    session.annotations.remove_class(session.classes[1].id)
    session.wait()
    session.segments.write()
    while session.progress is None or session.progress.what != "Writing segments":
        session.poll()
    session.annotations.undo()
    session.wait()
    assert "sphere 2" in masks(session)


def test_segments_of_a_file_are_somebody_elses_though_they_are_ours_of_another_scene(session: SceneSession) -> None:
    loaded = session.parameters.node.GetScene().AddNewNodeByClass("vtkMRMLSegmentationNode", "loaded")
    loaded.GetSegmentation().DeepCopy(session.parameters.segmentation.GetSegmentation())
    before = masks(session)
    removed = session.classes[1].id
    session.annotations.remove_class(removed)
    session.set_segmentation(loaded)
    session.wait()
    write_all(session)
    np.testing.assert_array_equal(masks(session)["sphere 2"], before["sphere 2"])


def test_others_that_share_a_labelmap_with_a_removed_class_keep_their_voxels(a_segmentation: Any, a_volume: Any) -> None:
    old, _ = write_segments(
        a_segmentation, a_volume, [output(block(1, 2), "old", "old"), output(block(4, 5), "new", "new")], respect_others=True
    )
    add_segment(a_segmentation, "bone", block(3, 4), OBLIQUE)
    a_segmentation.GetSegmentation().CollapseBinaryLabelmaps(False)
    before = everything_about(a_segmentation, "bone")
    (new,) = write_segments(a_segmentation, a_volume, [output(np.ones(SHAPE, dtype=bool), "new", "new")], False, gone={"old"})
    assert a_segmentation.GetSegmentation().GetSegment(old) is None
    assert everything_about(a_segmentation, "bone") == before
    assert a_segmentation.GetSegmentation().GetSegment("bone").GetRepresentation(LABELMAP) is not None
    assert voxels_of(a_segmentation, new) == positions_of(np.ones(SHAPE, dtype=bool), a_volume)
