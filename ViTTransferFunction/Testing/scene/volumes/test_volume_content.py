"""A volume node that gets other voxels: frames of a sequence, edited voxels, and what is no change at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
import slicer

from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.views import contours
from ViTTransferFunction.Logic.scene.volumes import opened_volume
from ViTTransferFunction.Logic.scene.volumes.volume_content import Frame, content_of, is_playing
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_features
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S
from ViTTransferFunction.Testing.support.scenes import (
    add_parameter_node,
    add_volume,
    annotate,
    segment_masks,
    write_all,
)
from ViTTransferFunction.Testing.support.sequences import Sequence
from ViTTransferFunction.Testing.support.spheres import Spheres


@pytest.fixture
def sequence(slicer_app: Any, spheres: Spheres) -> Sequence:
    volume, labels = spheres
    frames = [volume, Volume(volume.array + 1.0, volume.geometry, volume.name)]
    for frame in frames:
        cache_known_features(frame, labels)
    return Sequence(slicer_app.scene, frames)


@pytest.fixture
def new_session(slicer_app: Any) -> Iterator[SceneSession]:
    session = SceneSession(slicer_app.scene, slicer_app.app_logic, add_parameter_node(slicer_app.scene))
    session.parameters.set("grid", GRID)
    yield session
    session.close()


@pytest.fixture
def session(new_session: SceneSession, sequence: Sequence) -> SceneSession:
    new_session.set_volume(sequence.volume)
    new_session.wait()
    assert new_session.phase == "ready", new_session.take_error()
    return new_session


@contextmanager
def restless(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Within, no frame counts as one that rests, however long a busy computer stands still."""
    with monkeypatch.context() as patched:
        patched.setattr(opened_volume, "REST_S", LONGEST_WAIT_S)
        yield


def seen_until_rest(session: SceneSession) -> list[Any]:
    """Phase and frame, each time that they change."""
    seen: list[Any] = []
    while session.busy:
        session.poll()
        if not seen or seen[-1] != (session.phase, session.frame):
            seen.append((session.phase, session.frame))
    return seen


def test_a_frame_is_told_by_its_number(slicer_app: Any, sequence: Sequence, spheres: Spheres) -> None:
    assert content_of(sequence.volume).frame == Frame(1, 2)
    sequence.show(2)
    assert content_of(sequence.volume).frame == Frame(2, 2)
    assert content_of(add_volume(slicer_app.scene, spheres[0])).frame is None


def test_a_frame_that_is_chosen_is_taken_up_when_it_rests_with_its_own_features(
    session: SceneSession, sequence: Sequence, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    ids = annotate(session, spheres)
    assert session.frame == Frame(1, 2)
    with restless(monkeypatch):
        sequence.show(2)
        assert session.volume_changed
        session.poll()
        assert session.frame == Frame(1, 2)
    session.wait()
    assert (session.phase, session.frame) == ("ready", Frame(2, 2))
    assert session.estimate is not None
    assert session.estimate.cached
    assert session.chosen_iso(ids[0]) is not None


@pytest.mark.slow
@pytest.mark.parametrize("shared", [False, True], ids=["frames are copied", "frames are shared"])
def test_coming_back_to_a_frame_loads_its_features_at_once(session: SceneSession, sequence: Sequence, shared: bool) -> None:
    sequence.browser.SetSaveChanges(sequence.browser.GetMasterSequenceNode(), shared)
    for number in (2, 1, 2):
        sequence.show(number)
        session.wait()
        assert (session.phase, session.frame) == ("ready", Frame(number, 2))


def test_what_is_passed_by_is_not_taken_up(session: SceneSession, sequence: Sequence, monkeypatch: pytest.MonkeyPatch) -> None:
    sequence.browser.SetSaveChanges(sequence.browser.GetMasterSequenceNode(), True)
    with restless(monkeypatch):
        for number in (2, 1, 2):
            sequence.show(number)
            session.poll()
            assert (session.phase, session.frame) == ("ready", Frame(1, 2))
    session.wait()
    assert session.frame == Frame(2, 2)


def test_nothing_is_taken_up_while_a_sequence_plays(session: SceneSession, sequence: Sequence) -> None:
    sequence.browser.SetPlaybackActive(True)
    assert is_playing(sequence.volume)
    sequence.show(2)
    with pytest.raises(TimeoutError):
        session.wait(timeout_s=1.0)
    assert session.frame == Frame(1, 2)
    sequence.browser.SetPlaybackActive(False)
    session.wait()
    assert session.frame == Frame(2, 2)


def test_what_is_shown_of_the_frame_before_is_hidden_and_comes_back_with_it(
    slicer_app: Any, session: SceneSession, sequence: Sequence, spheres: Spheres
) -> None:
    sequence.browser.SetSaveChanges(sequence.browser.GetMasterSequenceNode(), True)
    sequence.show(1)
    session.wait()
    annotate(session, spheres)
    outlines = slicer_app.scene.GetFirstNodeByName(contours.STRUCTURES.name).GetDisplayNode()
    assert outlines.GetVisibility()
    sequence.show(2)
    assert not outlines.GetVisibility()
    sequence.show(1)
    assert not session.volume_changed
    assert outlines.GetVisibility()


@pytest.mark.slow
def test_what_runs_for_a_frame_is_finished_before_the_next_one_is_taken_up(
    new_session: SceneSession, sequence: Sequence
) -> None:
    new_session.set_volume(sequence.volume)
    while new_session.phase != "extracting":
        new_session.poll()
    sequence.show(2)
    seen = seen_until_rest(new_session)
    # On a busy computer it may have ended before it is looked at.
    assert seen[0] in (("extracting", Frame(1, 2)), ("ready", Frame(1, 2)))
    assert ("ready", Frame(1, 2)) in seen
    assert seen[-1] == ("ready", Frame(2, 2))


def test_segments_are_not_made_of_a_frame_that_is_gone(session: SceneSession, sequence: Sequence, spheres: Spheres) -> None:
    annotate(session, spheres)
    sequence.show(2)
    session.segments.write()
    assert "has just changed" in (session.take_error() or "")
    session.wait()
    assert session.parameters.segmentation is None


def test_a_frame_that_is_left_while_segments_are_computed_is_not_written_over_another(
    session: SceneSession, sequence: Sequence, spheres: Spheres
) -> None:
    annotate(session, spheres)
    session.segments.write()
    sequence.show(2)
    session.wait()
    assert "no segments were written" in (session.take_error() or "")
    assert session.parameters.segmentation is None
    assert session.frame == Frame(2, 2)


def test_the_segments_of_a_frame_are_not_overwritten_by_those_of_another(
    session: SceneSession, sequence: Sequence, spheres: Spheres
) -> None:
    ids = annotate(session, spheres)
    write_all(session)
    of_first: Any = session.parameters.segmentation
    before = segment_masks(of_first, sequence.volume)
    sequence.show(2)
    session.wait()
    assert session.parameters.segmentation is None
    assert not session.segments.exist
    session.annotations.remove_class(ids[2])
    write_all(session)
    of_second: Any = session.parameters.segmentation
    assert of_second is not of_first
    assert (of_first.GetName(), of_second.GetName()) == ("heart frame 1 segmentation", "heart frame 2 segmentation")
    for name, mask in segment_masks(of_first, sequence.volume).items():
        np.testing.assert_array_equal(mask, before[name])
    for number, chosen, other in ((1, of_first, of_second), (2, of_second, of_first)):
        sequence.show(number)
        session.wait()
        assert chosen.GetDisplayNode().GetVisibility()
        assert not other.GetDisplayNode().GetVisibility()
        assert session.parameters.segmentation is chosen
    # That of the class which was removed for the other frame, too.
    sequence.show(1)
    session.wait()
    write_all(session)
    assert segment_masks(of_first, sequence.volume).keys() == before.keys()


def test_segments_that_the_user_hid_stay_hidden_when_their_frame_is_shown_again(
    session: SceneSession, sequence: Sequence, spheres: Spheres
) -> None:
    annotate(session, spheres)
    write_all(session)
    display = session.parameters.segmentation.GetDisplayNode()
    display.SetVisibility(False)
    for number in (2, 1):
        sequence.show(number)
        session.wait()
        assert not display.GetVisibility()


def test_a_segmentation_that_the_user_chooses_for_a_frame_stays_until_the_next_one(
    session: SceneSession, sequence: Sequence, spheres: Spheres
) -> None:
    annotate(session, spheres)
    write_all(session)
    of_first = session.parameters.segmentation
    sequence.show(2)
    session.wait()
    session.set_segmentation(of_first)
    session.parameters.set("grid", GRID + 1)
    session.wait()
    assert session.parameters.segmentation is of_first


def test_a_segmentation_that_is_a_sequence_with_the_volume_gets_the_segments_of_each_frame(
    slicer_app: Any, session: SceneSession, sequence: Sequence, spheres: Spheres
) -> None:
    annotate(session, spheres)
    write_all(session)
    segmentation = session.parameters.segmentation
    of_segments = slicer_app.scene.AddNewNodeByClass("vtkMRMLSequenceNode", "segments")
    sequence.browser.AddSynchronizedSequenceNodeID(of_segments.GetID())
    sequence.browser.AddProxyNode(segmentation, of_segments, False)
    sequence.show(2)
    session.wait()
    assert session.parameters.segmentation is segmentation


def test_voxels_that_a_user_edits_are_noticed(session: SceneSession, sequence: Sequence) -> None:
    slicer.util.arrayFromVolume(sequence.volume)[:4] = -1000.0
    slicer.util.arrayFromVolumeModified(sequence.volume)
    assert session.volume_changed
    session.wait()
    assert session.phase == "no features"
    assert session.estimate is not None
    assert not session.estimate.cached


def test_how_the_volume_is_displayed_or_called_is_no_change(session: SceneSession, sequence: Sequence) -> None:
    before = content_of(sequence.volume)
    display = sequence.volume.GetDisplayNode()
    display.SetAutoWindowLevel(False)
    display.SetWindowLevelMinMax(10.0, 20.0)
    display.SetAndObserveColorNodeID("vtkMRMLColorTableNodeRed")
    sequence.volume.SetName("renamed")
    assert np.ptp(slicer.util.arrayFromVolume(sequence.volume)) > 0
    assert content_of(sequence.volume).state == before.state
    assert not session.volume_changed
    assert session.phase == "ready"
