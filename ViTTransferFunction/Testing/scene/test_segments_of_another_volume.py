"""Segments of one scan, while another scan is segmented with the same structures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("slicer")

from ViTTransferFunction.Logic.core.volume import Volume
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.known_features import cache_known_features
from ViTTransferFunction.Testing.support.scenes import add_segment, add_volume, annotate, segment_masks, write_all
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras


@pytest.fixture
def session(session: SceneSession, spheres: Spheres) -> SceneSession:
    """A session with three structures, one on each sphere, and their segments."""
    annotate(session, spheres)
    write_all(session)
    return session


@pytest.fixture
def follow_up(slicer_app: Any, spheres: Spheres) -> Any:
    """A later scan, in which the spheres are elsewhere."""
    turned = Volume(spheres[0].array[::-1].copy(), spheres[0].geometry, "follow-up")
    cache_known_features(turned, spheres[1][::-1])
    return add_volume(slicer_app.scene, turned)


def masks(segmentation: Any, volume: Any) -> list[np.ndarray]:
    return list(segment_masks(segmentation, volume).values())


def test_the_segments_of_one_scan_are_not_overwritten_by_those_of_the_next(session: SceneSession, follow_up: Any) -> None:
    baseline, of_baseline = session.parameters.volume, session.parameters.segmentation
    before = masks(of_baseline, baseline)
    session.set_volume(follow_up)
    session.wait()
    assert session.parameters.segmentation is None
    assert not session.written.exist
    write_all(session)
    of_follow_up = session.parameters.segmentation
    assert of_follow_up not in (None, of_baseline)
    assert len(masks(of_follow_up, follow_up)) == 3
    np.testing.assert_array_equal(masks(of_baseline, baseline), before)
    for volume, segmentation in ((baseline, of_baseline), (None, of_baseline), (follow_up, of_follow_up)):
        session.set_volume(volume)
        assert session.parameters.segmentation is segmentation
    session.wait()
    assert not session.written.outdated


def test_it_is_told_when_structures_were_changed_for_another_scan_meanwhile(
    session: SceneSession, follow_up: Any, spheres: Spheres
) -> None:
    baseline, of_baseline = session.parameters.volume, session.parameters.segmentation
    for volume in (follow_up, baseline):
        session.set_volume(volume)
    assert session.errors == ()
    session.set_volume(follow_up)
    id_ = session.classes[0].id
    session.annotations.add_points(id_, centre_ras(spheres, 1) + 2.0, positive=True)
    session.set_volume(baseline)
    assert session.parameters.segmentation is of_baseline
    assert of_baseline.GetName() in " ".join(session.errors)
    session.set_volume(follow_up)
    assert session.errors == ()
    session.set_volume(baseline)
    assert len(session.errors) == 1
    session.set_segmentation(None)
    assert session.errors == ()


def test_structures_that_are_removed_for_another_scan_keep_their_segments_of_the_first(
    session: SceneSession, follow_up: Any, spheres: Spheres
) -> None:
    baseline, of_baseline = session.parameters.volume, session.parameters.segmentation
    before = masks(of_baseline, baseline)
    session.set_volume(follow_up)
    for state in session.classes[1:]:
        session.annotations.remove_class(state.id)
    session.wait()
    write_all(session)
    session.set_volume(baseline)
    session.wait()
    assert session.parameters.segmentation is of_baseline
    write_all(session)
    np.testing.assert_array_equal(masks(of_baseline, baseline), before)
    session.annotations.remove_class(session.classes[0].id)
    session.annotations.add_class("another")
    for volume in (follow_up, baseline):
        session.set_volume(volume)
    assert not session.written.exist
    session.set_volume(follow_up)
    assert session.parameters.segmentation is not of_baseline


def test_where_a_scan_was_deleted_its_segments_are_not_overwritten_either(session: SceneSession, follow_up: Any) -> None:
    scene, baseline, of_baseline = follow_up.GetScene(), session.parameters.volume, session.parameters.segmentation
    scene.RemoveNode(baseline)
    assert session.parameters.segmentation is of_baseline
    session.set_volume(follow_up)
    assert session.parameters.segmentation is None


def test_a_segmentation_that_the_user_chooses_after_the_scan_gets_the_segments(session: SceneSession, follow_up: Any) -> None:
    of_baseline = session.parameters.segmentation
    session.set_volume(follow_up)
    session.set_segmentation(of_baseline)
    session.set_volume(follow_up)
    assert session.parameters.segmentation is of_baseline


def test_a_segmentation_of_others_stays_chosen(session: SceneSession, follow_up: Any, spheres: Spheres) -> None:
    theirs = follow_up.GetScene().AddNewNodeByClass("vtkMRMLSegmentationNode", "theirs")
    add_segment(theirs, "bone", spheres[1] == 2, spheres[0].geometry.ijk_to_ras)
    session.set_segmentation(theirs)
    session.set_volume(follow_up)
    assert session.parameters.segmentation is theirs


def test_a_saved_scene_knows_which_segments_are_of_which_scan(
    session: SceneSession, follow_up: Any, slicer_app: Any, tmp_path: Path
) -> None:
    names = follow_up.GetName(), session.parameters.segmentation.GetName()
    scene, baseline = slicer_app.scene, session.parameters.volume.GetName()
    session.set_volume(follow_up)
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
    opened.close()
