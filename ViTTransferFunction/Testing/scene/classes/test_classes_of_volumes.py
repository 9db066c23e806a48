"""Structures and points belong to the scan that they were made on: several scans in one scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import vtk

pytest.importorskip("slicer")

from ViTTransferFunction.Logic.scene.classes.class_nodes import CLASS_ROLE, class_nodes, class_nodes_of_all, lists_of
from ViTTransferFunction.Logic.scene.classes.of_volume import VOLUME_ROLE
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.scenes import (
    MOVED,
    FollowUp,
    add_parameter_node,
    add_segment,
    add_volume,
    annotate,
    put_under,
    segment_masks,
    write_all,
)
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras


def displays(session: SceneSession) -> dict[str, bool]:
    """Which lists of points are shown, by name, of all scans."""
    lists = [node for each in class_nodes_of_all(session.parameters.node) for node in lists_of(each)]
    return {f"{node.GetName()} {node.GetID()}": bool(node.GetDisplayNode().GetVisibility()) for node in lists}


def opened_again(app: Any, session: SceneSession, path: Path, change: Any = None) -> SceneSession:
    """A session on the scene as it is read from a file that it was saved to."""
    assert app.scene.WriteToMRB(str(path))
    session.close()
    assert app.scene.ReadFromMRB(str(path), True)
    node = app.scene.GetSingletonNode("ViTTransferFunction", "vtkMRMLScriptedModuleNode")
    if change is not None:
        change(node)
    return SceneSession(app.scene, app.app_logic, node)


def test_each_scan_has_its_own_structures_which_are_there_again_as_they_were(
    session: SceneSession, follow_up: FollowUp, spheres: Spheres
) -> None:
    ids, baseline = annotate(session, spheres), session.parameters.volume
    session.annotations.add_points(ids[0], centre_ras(spheres, 2), positive=False)
    session.annotations.step_size(ids[0], 1)
    session.annotations.set_class(ids[1], iso=0.5, proximity=0.5)
    session.annotations.set_close_up(ids[2], (1.0, 2.0, 3.0, 40.5, 50.0, 60.0))
    session.select_class(ids[1])
    of_baseline = session.classes
    session.set_volume(follow_up.volume)
    assert not {state.id for state in session.classes} & set(ids)
    follow_up.click(session)
    session.annotations.remove_class(session.classes[2].id)
    session.annotations.move_class(session.classes[0].id, 1)
    of_follow_up = session.classes
    for volume, classes in ((baseline, of_baseline), (follow_up.volume, of_follow_up), (baseline, of_baseline)):
        session.set_volume(volume)
        assert session.classes == classes
        session.wait()
        assert session.classes == classes
        assert [request.id for request in session._maps.requests.requests] == [state.id for state in classes]
    assert session.selected_class == of_baseline[1]


def test_on_another_scan_the_same_structures_begin_without_points_and_one_undo_takes_them_away(
    session: SceneSession, follow_up: FollowUp, spheres: Spheres
) -> None:
    ids, baseline = annotate(session, spheres), session.parameters.volume
    session.annotations.set_class(ids[0], style="glass", opacity=0.5, low=10.0, high=20.0, proximity=0.25, refine=False)
    session.annotations.set_class(ids[1], iso=0.5, visible=False)
    session.annotations.step_size(ids[2], 1)
    session.select_class(ids[2])
    before = session.classes
    session.set_volume(follow_up.volume)
    after = session.classes
    assert [(state.name, state.color) for state in after] == [(state.name, state.color) for state in before]
    assert (after[0].look.style, after[0].look.opacity) == ("glass", 0.5)
    assert (after[0].look.low, after[0].look.high) == (None, None)
    assert (after[0].proximity, after[0].refine) == (0.25, False)
    for state in after:
        assert (state.positive, state.negative, state.iso, state.size, state.visible) == ((), (), None, 0.0, True)
    assert session.selected_class == after[2]
    session.annotations.undo()
    assert not session.classes
    session.set_volume(baseline)
    session.set_volume(follow_up.volume)
    assert not session.classes
    session.annotations.redo()
    assert session.classes == after


def test_a_scan_that_was_only_looked_at_leaves_nothing_behind(
    slicer_app: Any, session: SceneSession, follow_up: FollowUp, spheres: Spheres
) -> None:
    annotate(session, spheres)
    baseline, classes, nodes = session.parameters.volume, session.classes, slicer_app.scene.GetNumberOfNodes()
    session.set_volume(follow_up.volume)
    assert len(session.classes) == 3
    session.set_volume(baseline)
    session.wait()
    assert session.classes == classes
    assert slicer_app.scene.GetNumberOfNodes() == nodes
    session.set_volume(follow_up.volume)
    first = session.classes[0].id
    session.annotations.set_class(first, name="renamed")
    for volume in (baseline, follow_up.volume):
        session.set_volume(volume)
    assert session.classes[0].id == first


def test_points_of_another_scan_are_not_seen_and_what_the_user_hid_stays_hidden(
    session: SceneSession, follow_up: FollowUp, spheres: Spheres
) -> None:
    ids, baseline = annotate(session, spheres), session.parameters.volume
    session.annotations.set_class(ids[0], visible=False)
    session.annotations.points_node(ids[1], positive=False).GetDisplayNode().SetVisibility(False)  # In the module Markups.
    before = displays(session)
    assert sorted(before.values()) == [False] * 3 + [True] * 3
    session.set_volume(follow_up.volume)
    there = displays(session)
    assert [there[name] for name in before] == [False] * 6
    assert sorted(there.values()) == [False] * 6 + [True] * 6
    session.set_volume(None)
    assert sorted(displays(session).values()) == [False] * 6
    session.set_volume(baseline)
    assert displays(session) == before
    assert [state.visible for state in session.classes] == [False, True, True]


def test_each_scan_has_its_own_undo(session: SceneSession, follow_up: FollowUp, spheres: Spheres) -> None:
    ids, baseline = annotate(session, spheres), session.parameters.volume
    done = session.classes
    session.annotations.remove_class(ids[0])
    removed = session.classes
    session.set_volume(follow_up.volume)
    follow_up.click(session)
    of_follow_up = session.classes
    while session.annotations.can_undo:
        session.annotations.undo()
    assert not session.classes
    session.set_volume(baseline)
    assert session.classes == removed
    session.annotations.undo()
    assert session.classes == done
    session.set_volume(follow_up.volume)
    while session.annotations.can_redo:
        session.annotations.redo()
    assert session.classes == of_follow_up


def test_after_another_scan_was_looked_at_undo_and_the_removal_of_the_last_point_go_no_further_back(
    session: SceneSession, follow_up: FollowUp, spheres: Spheres
) -> None:
    baseline, id_ = session.parameters.volume, session.annotations.add_class("sphere").id

    def look_at_the_other() -> None:
        for volume in (follow_up.volume, baseline):
            session.set_volume(volume)

    for iso in (0.25, 0.75):
        session.annotations.set_class(id_, iso=iso)
        look_at_the_other()
    session.annotations.undo()
    assert session.classes[0].iso == 0.25
    session.annotations.add_points(id_, centre_ras(spheres, 3), positive=False)
    session.annotations.add_points(id_, centre_ras(spheres, 1), positive=True)
    look_at_the_other()
    session.annotations.remove_last_point(id_)
    assert (len(session.classes[0].positive), len(session.classes[0].negative)) == (0, 1)


def test_what_was_done_to_points_elsewhere_in_slicer_can_be_undone_when_their_scan_is_chosen_again(
    session: SceneSession, follow_up: FollowUp, spheres: Spheres
) -> None:
    ids, baseline, scene = annotate(session, spheres), session.parameters.volume, follow_up.volume.GetScene()
    before, points = session.classes, session.annotations.points_node(ids[0], positive=True)
    outside = session.annotations.points_node(ids[1], positive=False)
    gone = session.annotations.points_node(ids[1], positive=True)
    session.set_volume(follow_up.volume)
    follow_up.click(session)
    of_follow_up = session.classes
    points.AddControlPointWorld(vtk.vtkVector3d(1.0, 2.0, 3.0))
    scene.RemoveNode(gone)
    assert not scene.IsNodePresent(outside)
    session.wait()
    assert session.classes == of_follow_up
    session.set_volume(baseline)
    assert [len(state.positive) for state in session.classes] == [2, 1]
    session.annotations.undo()
    assert session.classes == before


def test_where_points_were_moved_while_another_scan_was_chosen_undo_does_not_lead_beside_them(
    session: SceneSession, follow_up: FollowUp, spheres: Spheres
) -> None:
    ids, baseline = annotate(session, spheres), session.parameters.volume
    box = (1.0, 2.0, 3.0, 40.5, 50.0, 60.0)
    session.annotations.set_close_up(ids[0], box)
    session.poll()
    lists = [session.annotations.points_node(id_, positive) for id_ in ids for positive in (True, False)]
    session.set_volume(follow_up.volume)
    transform = put_under(lists[0], MOVED)
    for node in (*lists[1:], baseline):
        node.SetAndObserveTransformNodeID(transform.GetID())
    session.set_volume(baseline)
    assert not session.annotations.can_undo
    session.poll()
    assert not session.errors
    close_up = session.classes[0].close_up
    assert close_up is not None
    assert close_up[:3] == pytest.approx((MOVED @ (*box[:3], 1.0))[:3])


def test_a_scan_that_was_moved_away_from_its_points_while_another_one_was_chosen_is_told_of(
    session: SceneSession, follow_up: FollowUp, spheres: Spheres
) -> None:
    annotate(session, spheres)
    baseline = session.parameters.volume
    session.poll()
    session.set_volume(follow_up.volume)
    session.poll()
    put_under(baseline, MOVED)  # Registered to the other one.
    session.poll()
    assert not session.errors
    session.set_volume(baseline)
    session.poll()
    (message,) = session.errors
    assert "was moved, and the points of 'sphere 1', 'sphere 2', 'sphere 3' were not" in message
    session.set_volume(follow_up.volume)
    session.poll()
    assert not session.errors


def test_structures_that_are_made_before_a_scan_is_chosen_go_to_that_one_with_their_undo(
    slicer_app: Any, spheres: Spheres
) -> None:
    session = SceneSession(slicer_app.scene, slicer_app.app_logic, add_parameter_node(slicer_app.scene))
    first = session.annotations.add_class("liver")
    session.annotations.add_points(first.id, centre_ras(spheres, 1), positive=True)
    one, other = (add_volume(slicer_app.scene, spheres[0]) for _ in range(2))
    session.set_volume(one)
    assert [(state.id, len(state.positive)) for state in session.classes] == [(first.id, 1)]
    session.annotations.undo()
    assert [len(state.positive) for state in session.classes] == [0]
    session.annotations.redo()
    session.set_volume(None)
    assert not session.classes
    second = session.annotations.add_class("liver")
    session.set_volume(one)
    assert [(state.id, state.name) for state in session.classes] == [(first.id, "liver"), (second.id, "liver (2)")]
    session.set_volume(other)
    assert not {state.id for state in session.classes} & {first.id, second.id}
    session.close()


def test_structures_of_a_scan_that_is_removed_are_there_while_none_is_chosen_and_in_no_other(
    session: SceneSession, follow_up: FollowUp, spheres: Spheres
) -> None:
    scene = follow_up.volume.GetScene()
    annotate(session, spheres)
    classes = session.classes
    scene.RemoveNode(session.parameters.volume)
    assert session.classes == classes
    session.set_volume(follow_up.volume)
    follow_up.click(session)
    assert [len(state.positive) for state in session.classes] == [1, 1, 1]
    assert not {state.id for state in session.classes} & {state.id for state in classes}
    assert sorted(displays(session).values()) == [False] * 6 + [True] * 6
    session.set_volume(None)
    assert session.classes == classes


def test_undo_takes_no_structures_away_whose_scan_was_removed(
    session: SceneSession, follow_up: FollowUp, spheres: Spheres
) -> None:
    volume = session.parameters.volume
    annotate(session, spheres)
    classes = session.classes
    # As Slicer's list of scans has it: none is chosen before the chosen one goes.
    session.set_volume(None)
    follow_up.volume.GetScene().RemoveNode(volume)
    assert session.classes == classes
    session.annotations.undo()
    assert session.classes == classes
    # Of what the user does to them, each step can be undone as ever, and they are still of no other scan.
    session.annotations.remove_class(classes[0].id)
    session.annotations.undo()
    assert session.classes == classes
    session.set_volume(follow_up.volume)
    assert not {state.id for state in session.classes} & {state.id for state in classes}


def test_a_saved_scene_has_the_structures_of_all_its_scans(
    slicer_app: Any, session: SceneSession, follow_up: FollowUp, spheres: Spheres, tmp_path: Path
) -> None:
    ids, name = annotate(session, spheres), session.parameters.volume.GetName()
    session.annotations.set_class(ids[0], visible=False)
    of_baseline = session.classes
    session.set_volume(follow_up.volume)
    follow_up.click(session)
    of_follow_up, shown = session.classes, list(displays(session).values())
    opened = opened_again(slicer_app, session, tmp_path / "both.mrb")
    assert opened.classes == of_follow_up
    assert list(displays(opened).values()) == shown
    opened.set_volume(slicer_app.scene.GetFirstNodeByName(name))
    assert opened.classes == of_baseline
    assert list(displays(opened).values())[:2] == [False, False]
    opened.close()


def test_structures_of_an_earlier_version_belong_to_the_scan_that_is_chosen_and_those_of_others_keep_their_segments(
    slicer_app: Any, session: SceneSession, follow_up: FollowUp, spheres: Spheres, tmp_path: Path
) -> None:
    """One set of structures was for all scans, and so were their ids."""
    annotate(session, spheres)
    classes, baseline = session.classes, session.parameters.volume.GetName()
    write_all(session)
    before = segment_masks(session.parameters.segmentation, session.parameters.volume)

    def forget_volumes(node: Any) -> None:
        for positive in class_nodes_of_all(node):
            positive.RemoveNodeReferenceIDs(VOLUME_ROLE)
            positive.SetAttribute("ViTTransferFunction.volumeName", None)
        node.SetNodeReferenceID("volume", slicer_app.scene.GetFirstNodeByName("follow-up").GetID())
        node.SetNodeReferenceID("segmentation", None)

    opened = opened_again(slicer_app, session, tmp_path / "old.mrb", forget_volumes)
    assert opened.classes == classes
    assert not opened.annotations.can_undo
    opened.annotations.remove_class(classes[2].id)
    opened.set_volume(slicer_app.scene.GetFirstNodeByName(baseline))
    opened.wait()
    assert [len(state.positive) for state in opened.classes] == [0, 0]
    opened.annotations.add_points(opened.classes[0].id, centre_ras(spheres, 3) + 2.0, positive=True)
    opened.wait()
    opened.parameters.set("respectOtherSegments", False)
    write_all(opened)
    after = segment_masks(opened.parameters.segmentation, opened.parameters.volume)
    assert list(after) == [*before, "sphere 1 (2)"]
    for name, mask in before.items():
        np.testing.assert_array_equal(after[name], mask)
    opened.close()


def test_closing_the_scene_forgets_the_undo_of_all_scans(
    slicer_app: Any, session: SceneSession, follow_up: FollowUp, spheres: Spheres
) -> None:
    annotate(session, spheres)
    session.set_volume(follow_up.volume)
    follow_up.click(session)
    slicer_app.scene.Clear(False)
    assert (session.classes, session.annotations.can_undo) == ((), False)
    session.set_volume(add_volume(slicer_app.scene, spheres[0]))
    assert (session.classes, session.annotations.can_undo) == ((), False)


def test_the_undo_of_a_scan_that_is_gone_is_not_that_of_the_next_with_its_identifier(
    session: SceneSession, follow_up: FollowUp, spheres: Spheres
) -> None:
    scene = follow_up.volume.GetScene()
    annotate(session, spheres)
    baseline = session.parameters.volume
    id_ = baseline.GetID()
    session.set_volume(follow_up.volume)
    follow_up.click(session)
    scene.RemoveNode(baseline)
    del baseline
    again = scene.AddNewNodeByClassWithID("vtkMRMLScalarVolumeNode", "again", id_)
    session.set_volume(again)
    assert [len(state.positive) for state in session.classes] == [0, 0, 0]
    session.annotations.undo()
    assert not session.classes
    assert not session.annotations.can_undo


def test_a_structure_that_is_to_begin_from_a_segment_does_not_begin_in_another_scan(
    session: SceneSession, follow_up: FollowUp, spheres: Spheres
) -> None:
    theirs = follow_up.volume.GetScene().AddNewNodeByClass("vtkMRMLSegmentationNode", "theirs")
    add_segment(theirs, "bone", spheres[1] == 2, spheres[0].geometry.ijk_to_ras)
    session.set_segmentation(theirs)
    session.continue_segment("bone")
    assert not session.classes
    session.set_volume(follow_up.volume)
    session.wait()
    assert not session.classes


def test_a_copy_of_a_scan_is_another_scan(slicer_app: Any, session: SceneSession, spheres: Spheres) -> None:
    annotate(session, spheres)
    copy = slicer_app.scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "copy")
    copy.Copy(session.parameters.volume)
    session.set_volume(copy)
    assert [len(state.positive) for state in session.classes] == [0, 0, 0]


def test_the_order_of_one_scans_structures_leaves_those_of_others(
    session: SceneSession, follow_up: FollowUp, spheres: Spheres
) -> None:
    ids = annotate(session, spheres)
    session.set_volume(follow_up.volume)
    follow_up.click(session)
    session.annotations.move_class(session.classes[0].id, 2)
    node = session.parameters.node
    assert node.GetNumberOfNodeReferences(CLASS_ROLE) == 6
    assert [state.name for state in session.classes] == ["sphere 2", "sphere 3", "sphere 1"]
    assert [n for n in class_nodes_of_all(node) if n not in class_nodes(node)] == class_nodes_of_all(node)[:3]
    assert len(ids) == 3


def test_front_ends_hear_of_another_scan_when_all_of_it_is_there_and_of_what_was_told_of_the_one_before_no_more(
    session: SceneSession, follow_up: FollowUp, spheres: Spheres
) -> None:
    ids, baseline = annotate(session, spheres), session.parameters.volume
    session.close_ups.look_closer(session.annotations.add_class("nothing yet").id)
    assert len(session.errors) == 1
    seen: list[int] = []
    session.add_observer(lambda: seen.append(len(session.classes)))
    session.set_volume(follow_up.volume)
    assert seen == [4]
    assert not session.errors
    session.set_volume(baseline)
    assert seen == [4, 4]
    assert [state.id for state in session.classes[:3]] == ids
