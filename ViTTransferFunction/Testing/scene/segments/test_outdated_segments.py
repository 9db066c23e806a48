"""Whether the segments that were written are those of the structures as they are now."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("slicer")

import slicer

from ViTTransferFunction.Logic.scene.segments.written_segments import SOURCE_ATTRIBUTE
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.scenes import MOVED, annotate, put_under, write_all
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras


@pytest.fixture
def session(session: SceneSession, spheres: Spheres) -> SceneSession:
    """A session with three structures, one on each sphere."""
    annotate(session, spheres)
    return session


def add_point(session: SceneSession, spheres: Spheres) -> None:
    session.annotations.add_points(session.classes[0].id, centre_ras(spheres, 2), positive=False)


def delete_segment(session: SceneSession, spheres: Spheres) -> None:
    session.parameters.segmentation.GetSegmentation().RemoveSegment(session.segments.of(session.classes[0].id))


CHANGES: dict[str, Callable[[SceneSession, Spheres], Any]] = {
    "a point": add_point,
    "a size": lambda session, spheres: session.annotations.step_size(session.classes[0].id, 1),
    "a name": lambda session, spheres: session.annotations.set_class(session.classes[0].id, name="liver"),
    "a colour": lambda session, spheres: session.annotations.set_class(session.classes[0].id, color=(0.1, 0.2, 0.3)),
    "a removed class": lambda session, spheres: session.annotations.remove_class(session.classes[0].id),
    "how it is refined": lambda session, spheres: session.parameters.set("refinement", "none"),
    "what gives way to whom": lambda session, spheres: session.parameters.set("respectOtherSegments", False),
    "a deleted segment": delete_segment,
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_change_of_what_segments_follow_from_is_told_until_they_are_written_again(
    session: SceneSession, spheres: Spheres, change: Callable[[SceneSession, Spheres], Any]
) -> None:
    assert not session.segments.outdated
    write_all(session)
    assert not session.segments.outdated
    change(session, spheres)
    assert session.segments.outdated
    session.wait()
    write_all(session)
    assert not session.segments.outdated


def test_segments_are_outdated_while_other_intensities_are_looked_at(session: SceneSession) -> None:
    write_all(session)
    low, high = session.parameters.window
    session.parameters.set_window(low, high + 1.0, automatic=False)
    assert session.segments.outdated
    session.parameters.set_window(low, high, automatic=True)
    assert not session.segments.outdated


def test_what_does_not_change_segments_leaves_them_as_they_are(session: SceneSession) -> None:
    write_all(session)
    session.annotations.set_class(session.classes[0].id, opacity=0.3, visible=False)
    session.annotations.add_class()
    session.annotations.move_class(session.classes[0].id, 1)
    session.parameters.set("overlayVisible", False)
    session.parameters.set("device", "cpu")
    session.wait()
    assert not session.segments.outdated


def test_who_takes_a_change_back_has_the_segments_that_are_written(session: SceneSession, spheres: Spheres) -> None:
    write_all(session)
    add_point(session, spheres)
    session.annotations.undo()
    session.wait()
    assert not session.segments.outdated


def test_what_is_changed_while_segments_are_written_is_not_in_them(session: SceneSession, spheres: Spheres) -> None:
    session.segments.write()
    add_point(session, spheres)
    session.wait()
    assert session.segments.take_written()
    assert not session.segments.take_written()
    assert session.segments.outdated


def test_cancelled_segments_are_not_written(session: SceneSession) -> None:
    write_all(session)
    assert session.segments.take_written()
    session.annotations.step_size(session.classes[0].id, 1)
    session.segments.write()
    session.cancel()
    session.wait()
    assert not session.segments.take_written()
    assert session.segments.outdated


def test_moving_volume_points_and_segments_together_changes_nothing(session: SceneSession) -> None:
    write_all(session)
    transform = put_under(session.parameters.volume, MOVED)
    points = session.parameters.node.GetScene().GetNodesByClass("vtkMRMLMarkupsFiducialNode")
    for node in (*points, session.parameters.segmentation):
        node.SetAndObserveTransformNodeID(transform.GetID())
    session.wait()
    assert not session.segments.outdated


def shift(volume: Any, millimetres: float) -> None:
    """Have the volume's own axes begin elsewhere, as Slicer's *Center Volume* and hardened transforms do."""
    right, anterior, superior = volume.GetOrigin()
    volume.SetOrigin(right + millimetres, anterior, superior)


def test_segments_of_a_volume_that_was_moved_away_are_told_until_it_is_back(session: SceneSession) -> None:
    write_all(session)
    shift(session.parameters.volume, 1.0)
    session.wait()
    assert session.segments.outdated
    shift(session.parameters.volume, -1.0)
    session.wait()
    assert not session.segments.outdated


def test_a_place_that_was_rounded_in_a_file_is_the_same(session: SceneSession) -> None:
    write_all(session)
    shift(session.parameters.volume, 1e-5)
    session.wait()
    assert not session.segments.outdated


def test_segments_of_a_volume_that_got_other_voxels_are_told_until_it_has_its_own_again(session: SceneSession) -> None:
    write_all(session)
    voxels = slicer.util.arrayFromVolume(session.parameters.volume)
    before = voxels.copy()
    voxels[5:10, 5:10, 5:10] += 7
    slicer.util.arrayFromVolumeModified(session.parameters.volume)
    session.wait()
    assert session.segments.outdated
    voxels[:] = before
    slicer.util.arrayFromVolumeModified(session.parameters.volume)
    session.wait()
    assert not session.segments.outdated


def test_segments_that_were_written_before_voxels_were_noted_are_not_outdated_for_that(session: SceneSession) -> None:
    write_all(session)
    classes_alone, _, _ = session.segments.source.partition(" ")
    session.parameters.segmentation.SetAttribute(SOURCE_ATTRIBUTE, classes_alone)
    assert not session.segments.outdated


def test_a_saved_scene_knows_it_when_it_is_opened_again(slicer_app: Any, session: SceneSession, tmp_path: Path) -> None:
    write_all(session)
    assert slicer_app.scene.WriteToMRB(str(tmp_path / "tomorrow.mrb"))
    slicer_app.scene.Clear(False)
    session.wait()
    assert not session.segments.outdated
    assert slicer_app.scene.ReadFromMRB(str(tmp_path / "tomorrow.mrb"))
    session.wait()
    assert session.segments.exist
    assert not session.segments.outdated
    session.annotations.step_size(session.classes[0].id, 1)
    assert session.segments.outdated
