"""Segments of one scan, while another scan is segmented."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("slicer")

from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.scenes import FollowUp, add_segment, annotate, segment_masks, write_all
from ViTTransferFunction.Testing.support.spheres import Spheres


@pytest.fixture
def session(session: SceneSession, spheres: Spheres) -> SceneSession:
    """A session with three structures, one on each sphere, and their segments."""
    annotate(session, spheres)
    write_all(session)
    return session


def masks(segmentation: Any, volume: Any) -> list[np.ndarray]:
    return list(segment_masks(segmentation, volume).values())


def test_the_segments_of_one_scan_are_not_overwritten_by_those_of_the_next(session: SceneSession, follow_up: FollowUp) -> None:
    baseline, of_baseline = session.parameters.volume, session.parameters.segmentation
    before = masks(of_baseline, baseline)
    session.set_volume(follow_up.volume)
    session.wait()
    assert session.parameters.segmentation is None
    assert not session.segments.exist
    follow_up.click(session)
    write_all(session)
    of_follow_up = session.parameters.segmentation
    assert of_follow_up not in (None, of_baseline)
    assert len(masks(of_follow_up, follow_up.volume)) == 3
    np.testing.assert_array_equal(masks(of_baseline, baseline), before)
    for volume, segmentation in ((baseline, of_baseline), (None, of_baseline), (follow_up.volume, of_follow_up)):
        session.set_volume(volume)
        assert session.parameters.segmentation is segmentation
    session.wait()
    assert not session.segments.outdated


def test_segments_are_seen_with_their_scan_unless_the_user_hid_or_showed_them(
    session: SceneSession, follow_up: FollowUp
) -> None:
    baseline, of_baseline = session.parameters.volume, session.parameters.segmentation
    display = of_baseline.GetDisplayNode()
    session.set_volume(follow_up.volume)
    assert not display.GetVisibility()
    session.set_volume(baseline)
    assert display.GetVisibility()
    display.SetVisibility(False)
    session.set_volume(follow_up.volume)
    session.set_volume(baseline)
    assert not display.GetVisibility()
    session.set_volume(follow_up.volume)
    display.SetVisibility(True)  # To compare.
    session.wait()
    assert display.GetVisibility()
    session.set_volume(baseline)
    assert display.GetVisibility()


def test_of_several_segmentations_of_a_scan_the_latest_is_chosen_with_it_again(
    session: SceneSession, follow_up: FollowUp
) -> None:
    """Who began a new one keeps the first as it is."""
    baseline, first = session.parameters.volume, session.parameters.segmentation
    session.set_segmentation(None)
    write_all(session)
    second = session.parameters.segmentation
    assert second is not first
    session.set_volume(follow_up.volume)
    session.set_volume(baseline)
    assert session.parameters.segmentation is second


def test_changes_that_are_not_in_the_segments_are_still_not_when_their_scan_is_chosen_again(
    session: SceneSession, follow_up: FollowUp
) -> None:
    baseline = session.parameters.volume
    session.annotations.remove_class(session.classes[2].id)
    session.wait()
    outdated = session.segments.outdated, len(session.segments.left)
    assert outdated == (True, 1)
    session.set_volume(follow_up.volume)
    session.set_volume(baseline)
    session.wait()
    assert (session.segments.outdated, len(session.segments.left)) == outdated
    write_all(session)
    assert len(masks(session.parameters.segmentation, baseline)) == 2


def test_where_a_scan_was_deleted_its_segments_are_not_overwritten_either(session: SceneSession, follow_up: FollowUp) -> None:
    scene, baseline, of_baseline = follow_up.volume.GetScene(), session.parameters.volume, session.parameters.segmentation
    scene.RemoveNode(baseline)
    assert session.parameters.segmentation is of_baseline
    session.set_volume(follow_up.volume)
    assert session.parameters.segmentation is None


def test_in_a_segmentation_that_the_user_chooses_after_the_scan_those_of_another_scan_stay(
    session: SceneSession, follow_up: FollowUp
) -> None:
    baseline, of_baseline = session.parameters.volume, session.parameters.segmentation
    before = segment_masks(of_baseline, baseline)
    session.set_volume(follow_up.volume)
    session.set_segmentation(of_baseline)
    session.set_volume(follow_up.volume)
    assert session.parameters.segmentation is of_baseline
    assert of_baseline.GetDisplayNode().GetVisibility()
    session.parameters.set("respectOtherSegments", False)
    follow_up.click(session)
    for _ in range(2):
        write_all(session)
        after = segment_masks(of_baseline, baseline)
        assert list(after) == [*before, *(f"{name} (2)" for name in before)]
        for name, mask in before.items():
            np.testing.assert_array_equal(after[name], mask)


def test_a_segmentation_of_others_stays_chosen(session: SceneSession, follow_up: FollowUp, spheres: Spheres) -> None:
    theirs = follow_up.volume.GetScene().AddNewNodeByClass("vtkMRMLSegmentationNode", "theirs")
    add_segment(theirs, "bone", spheres[1] == 2, spheres[0].geometry.ijk_to_ras)
    session.set_segmentation(theirs)
    session.set_volume(follow_up.volume)
    assert session.parameters.segmentation is theirs


def test_a_saved_scene_knows_which_segments_are_of_which_scan(
    session: SceneSession, follow_up: FollowUp, slicer_app: Any, tmp_path: Path
) -> None:
    names = follow_up.volume.GetName(), session.parameters.segmentation.GetName()
    scene, baseline = slicer_app.scene, session.parameters.volume.GetName()
    session.set_volume(follow_up.volume)
    assert scene.WriteToMRB(str(tmp_path / "both.mrb"))
    session.close()
    assert scene.ReadFromMRB(str(tmp_path / "both.mrb"), True)
    node = scene.GetSingletonNode("ViTTransferFunction", "vtkMRMLScriptedModuleNode")
    opened = SceneSession(scene, slicer_app.app_logic, node)
    assert opened.parameters.volume.GetName() == names[0]
    assert opened.parameters.segmentation is None
    opened.set_volume(scene.GetFirstNodeByName(baseline))
    found: Any = opened.parameters.segmentation
    assert found.GetName() == names[1]
    assert found.GetDisplayNode().GetVisibility()
    opened.close()
