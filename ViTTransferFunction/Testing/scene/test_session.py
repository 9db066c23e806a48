"""A session on a real scene: what the user does there reaches the compute process, and what comes back reaches the scene."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import slicer
import vtk
from vtkmodules.util.numpy_support import vtk_to_numpy

from ViTTransferFunction.Logic.compute.proxy import Event, SegmentationProxy
from ViTTransferFunction.Logic.compute.requests import ComputeMaps, FirstMap
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.geometry import transform_points
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.scene import session as scene_session
from ViTTransferFunction.Logic.scene.mrml.nodes import nodes_of_class
from ViTTransferFunction.Logic.scene.mrml.transforms import vtk_matrix
from ViTTransferFunction.Logic.scene.segments.segment_tags import segments_of_classes
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.views.rendering import ClassRendering
from ViTTransferFunction.Logic.scene.views.session_views import SessionViews
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image
from ViTTransferFunction.Testing.support.masks import dice
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S
from ViTTransferFunction.Testing.support.scenes import (
    add_parameter_node,
    add_volume,
    annotate,
    bend,
    put_under,
    segment_masks,
)
from ViTTransferFunction.Testing.support.segments import LABELMAP
from ViTTransferFunction.Testing.support.spheres import centre_ras


def test_points_placed_in_a_view_count_as_those_placed_by_the_session(
    session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    state = session.annotations.add_class("sphere")
    session.annotations.points_node(state.id, positive=True).AddControlPointWorld(vtk.vtkVector3d(*centre_ras(spheres, 1)[0]))
    session.wait()
    assert len(session.classes[0].positive) == 1
    assert session.chosen_iso(state.id) is not None


def test_the_class_that_is_clicked_is_answered_before_the_others(
    session: SceneSession, spheres: tuple[Volume, np.ndarray], monkeypatch: pytest.MonkeyPatch
) -> None:
    ids = [session.annotations.add_class(f"sphere {number}").id for number in (1, 2, 3)]
    for label, id_ in enumerate(ids, start=1):
        session.annotations.add_points(id_, centre_ras(spheres, label), positive=True)
    session.select_class(ids[1])
    session.wait()
    came: list[str] = []
    on_first_map = SegmentationProxy._on_first_map

    def noted(proxy: SegmentationProxy, request: ComputeMaps, reply: FirstMap) -> set[Event]:
        came.append(request.first)
        return on_first_map(proxy, request, reply)

    monkeypatch.setattr(SegmentationProxy, "_on_first_map", noted)
    session.annotations.add_points(ids[1], centre_ras(spheres, 2) + 1.0, positive=True)
    assert not session.selected_up_to_date
    session.wait()
    assert came == [ids[1]]
    assert session.up_to_date


@pytest.mark.slow
def test_a_point_that_is_still_being_placed_does_not_count(session: SceneSession, spheres: tuple[Volume, np.ndarray]) -> None:
    state = session.annotations.add_class("sphere")
    node = session.annotations.points_node(state.id, positive=True)
    node.AddControlPointWorld(vtk.vtkVector3d(*centre_ras(spheres, 1)[0]))
    node.SetNthControlPointPosition(0, 0.0, 0.0, 0.0, node.PositionPreview)
    assert session.classes[0].positive == ()
    session.wait()
    assert session.chosen_iso(state.id) is None


def test_a_structure_that_is_renamed_keeps_its_map_and_is_written_under_its_new_name(
    session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    id_ = annotate(session, spheres)[0]
    session.wait()
    session.annotations.set_class(id_, name="renamed")
    assert session.up_to_date
    session.segments.write()
    session.wait()
    masks = segment_masks(session.parameters.segmentation, session.parameters.volume)
    assert list(masks) == ["renamed", "sphere 2", "sphere 3"]


def test_segments_are_written_where_the_spheres_are(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    annotate(session, spheres)
    session.segments.write()
    session.wait()
    assert session.take_error() is None
    masks = segment_masks(session.parameters.segmentation, session.parameters.volume)
    assert list(masks) == ["sphere 1", "sphere 2", "sphere 3"]
    for name, mask in masks.items():
        assert dice(mask, spheres[1] == int(name[-1])) > 0.9


def test_the_voxels_of_a_structure_and_its_duplicate_stay_with_the_upper_one(
    session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    first, *_ = annotate(session, spheres)
    before = session.volume_ml(first)
    duplicate = session.annotations.duplicate_class(first)
    session.wait()
    assert session.volume_ml(first) == before
    assert session.volume_ml(duplicate.id) == 0.0


def test_segments_go_where_they_were_asked_for_also_if_another_segmentation_is_chosen_meanwhile(
    session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    annotate(session, spheres)
    nodes = []
    for _ in range(2):
        session.set_segmentation(None)
        session.segments.write()
        session.wait()
        nodes.append(session.parameters.segmentation)
    first, second = nodes
    labelmap = second.GetSegmentation().GetNthSegment(0).GetRepresentation(LABELMAP)
    voxels = vtk_to_numpy(labelmap.GetPointData().GetScalars())
    voxels[: len(voxels) // 2] = 0  # By hand, say.
    labelmap.Modified()
    before = segment_masks(second, session.parameters.volume)
    session.set_segmentation(first)
    session.annotations.add_points(session.classes[0].id, centre_ras(spheres, 3), positive=True)
    session.segments.write("overwrite")
    session.set_segmentation(second)
    session.wait()
    after = segment_masks(second, session.parameters.volume)
    assert all((after[name] == mask).all() for name, mask in before.items())
    assert after.keys() == before.keys()
    session.set_segmentation(first)
    assert not session.segments.outdated


def test_the_live_volume_is_that_of_the_segment_once_maps_are_refined(
    session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    ids = annotate(session, spheres)
    live_ml = [session.volume_ml(id_) for id_ in ids]
    session.segments.write()
    session.wait()
    masks = segment_masks(session.parameters.segmentation, session.parameters.volume)
    written_ml = [mask.sum() * spheres[0].geometry.voxel_volume_mm3 / 1000.0 for mask in masks.values()]
    assert live_ml == pytest.approx(written_ml)
    session.annotations.remove_class(ids[0])
    session.wait()
    assert session.volume_ml(ids[0]) is None


def test_a_structure_that_ends_without_a_voxel_is_told_until_the_user_goes_on(
    session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    annotate(session, spheres)
    copy = session.annotations.add_class("copy")
    session.annotations.add_points(copy.id, centre_ras(spheres, 2), positive=True)
    session.wait()
    session.segments.write()
    session.wait()
    assert "Nothing was found of 'copy'" in (session.take_error() or "")
    assert len(session.errors) == 1
    session.annotations.remove_class(copy.id)
    assert session.errors == ()


def test_nothing_that_was_shown_of_a_volume_stays_in_the_scene_without_it(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray], capfd: pytest.CaptureFixture[str]
) -> None:
    annotate(session, spheres)
    volume = session.parameters.volume
    assert len(nodes_of_class(slicer_app.scene, "vtkMRMLVolumeNode")) == 3
    capfd.readouterr()
    session.set_volume(None)
    assert "ERROR" not in capfd.readouterr().err
    assert nodes_of_class(slicer_app.scene, "vtkMRMLVolumeNode") == [volume]
    session.set_volume(volume)
    session.wait()
    assert len(nodes_of_class(slicer_app.scene, "vtkMRMLVolumeNode")) == 3


@pytest.mark.slow
def test_a_volume_whose_rigid_transform_is_hardened_keeps_its_features_and_maps_where_they_are(
    session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    (id_, *_) = annotate(session, spheres)
    session.select_class(id_)
    lists = [session.annotations.points_node(state.id, positive) for state in session.classes for positive in (True, False)]
    turn = np.eye(4)
    turn[:2, :2] = ((0.8, -0.6), (0.6, 0.8))
    turn[:3, 3] = (100.0, -20.0, 3.0)
    transform = put_under(session.parameters.volume, turn)
    for node in lists:
        node.SetAndObserveTransformNodeID(transform.GetID())
    session.wait()
    ml = session.volume_ml(id_)
    for node in (session.parameters.volume, *lists):
        node.HardenTransform()
    session.wait()
    assert session.phase == "ready"
    assert session.volume_ml(id_) == pytest.approx(ml)
    assert session.shown.is_on_selected(turn[:3, :3] @ centre_ras(spheres, 1)[0] + turn[:3, 3])


@pytest.mark.slow
def test_volumes_are_those_in_the_scene_where_a_transform_makes_the_scan_larger(
    session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    (id_, *_) = annotate(session, spheres)
    ml = session.volume_ml(id_)
    assert ml is not None
    larger = put_under(session.parameters.volume, np.diag([2.0, -1.0, 1.5, 1.0]))
    for state in session.classes:
        for positive in (True, False):
            session.annotations.points_node(state.id, positive).SetAndObserveTransformNodeID(larger.GetID())
    session.wait()
    assert session.volume_ml(id_) == pytest.approx(3.0 * ml)
    session.segments.write()
    session.wait()
    # As Slicer's Segment Statistics does.
    segmentation_node = session.parameters.segmentation
    segmentation_node.HardenTransform()
    labelmap = slicer.vtkOrientedImageData()
    segment_id = segments_of_classes(segmentation_node.GetSegmentation(), [id_])[id_]
    segmentation_node.GetBinaryLabelmapRepresentation(segment_id, labelmap)
    voxels = np.count_nonzero(vtk_to_numpy(labelmap.GetPointData().GetScalars()))
    assert session.volume_ml(id_) == pytest.approx(voxels * np.prod(labelmap.GetSpacing()) / 1000.0)


@pytest.mark.slow
def test_dragging_a_point_moves_the_map_along_and_is_one_step_for_undo(
    session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    (id_, *_) = annotate(session, spheres)
    first, second = centre_ras(spheres, 1)[0], centre_ras(spheres, 2)[0]
    node = session.annotations.points_node(id_, positive=True)
    for share in (0.3, 0.6, 1.0):
        node.SetNthControlPointPositionWorld(0, *(first + share * (second - first)))
        np.testing.assert_allclose(session.classes[0].positive[0], first + share * (second - first))
    session.wait()
    assert session.shown.is_on_selected(second)
    node.InvokeEvent(node.PointEndInteractionEvent)
    session.annotations.undo()
    np.testing.assert_allclose(session.classes[0].positive[0], first)


def test_observers_are_told_also_of_a_rest_that_comes_without_news_from_the_compute_process(
    session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    (id_, *_) = annotate(session, spheres)
    told: list[bool] = []
    session.add_observer(lambda: told.append(session.busy))
    # The outline is drawn in it by the next poll.
    session.annotations.set_class(id_, color=(0.1, 0.2, 0.3))
    assert told[-1]
    session.wait()
    assert not told[-1]


@pytest.mark.slow
def test_a_slider_that_is_dragged_is_one_step(session: SceneSession, spheres: tuple[Volume, np.ndarray]) -> None:
    (id_, *_) = annotate(session, spheres)
    for iso in (0.2, 0.3, 0.4):
        session.annotations.set_class(id_, iso=iso)
    session.wait()
    assert session.chosen_iso(id_) == pytest.approx(0.4)
    session.annotations.undo()
    assert session.classes[0].iso is None


@pytest.mark.slow
def test_what_is_left_to_show_of_older_maps_does_not_keep_an_answer_waiting(
    session: SceneSession, spheres: tuple[Volume, np.ndarray], monkeypatch: pytest.MonkeyPatch
) -> None:
    awaiting = []
    advance = SessionViews.advance

    def watched(views: SessionViews) -> None:
        awaiting.append(session.awaits_maps)
        advance(views)

    monkeypatch.setattr(SessionViews, "advance", watched)
    (id_, *_) = annotate(session, spheres)
    session.annotations.add_points(id_, centre_ras(spheres, 1) + 1.0, positive=True)
    while session.awaits_maps:
        session.poll()
    assert session.views.pending
    session.annotations.add_points(id_, centre_ras(spheres, 1) - 1.0, positive=True)
    session.wait()
    assert awaiting
    assert not any(awaiting)


@pytest.mark.slow
def test_points_beyond_the_volume_are_left_out_and_the_others_count(
    session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    state = session.annotations.add_class("sphere")
    session.annotations.add_points(state.id, np.array([[1000.0, 0.0, 0.0]]), positive=True)
    session.wait()
    assert session.chosen_iso(state.id) is None
    assert session.points_beyond == {state.id: 1}
    session.annotations.add_points(state.id, centre_ras(spheres, 1), positive=True)
    session.wait()
    assert session.chosen_iso(state.id) is not None
    session.annotations.erase_points(np.array([[1000.0, 0.0, 0.0]]), 1.0)
    assert session.points_beyond == {}


@pytest.mark.slow
def test_classes_of_one_name_are_both_segmented(session: SceneSession, spheres: tuple[Volume, np.ndarray]) -> None:
    for id_ in annotate(session, spheres):
        session.annotations.points_node(id_, positive=True).SetName("sphere")  # In the Data module.
    session.segments.write()
    session.wait()
    assert session.take_error() is None
    assert session.parameters.segmentation.GetSegmentation().GetNumberOfSegments() == 3


@pytest.mark.slow
def test_moving_the_volume_keeps_its_features_and_moves_the_segments(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    transform = slicer_app.scene.AddNewNodeByClass("vtkMRMLLinearTransformNode")
    matrix = np.eye(4)
    matrix[:3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    matrix[:3, 3] = [100.0, 20.0, -30.0]
    transform.SetMatrixTransformToParent(vtk_matrix(matrix))
    session.parameters.volume.SetAndObserveTransformNodeID(transform.GetID())
    assert session.phase == "ready"
    state = session.annotations.add_class("sphere")
    session.annotations.add_points(state.id, transform_points(matrix, centre_ras(spheres, 1)), positive=True)
    session.segments.write()
    session.wait()
    (mask,) = segment_masks(session.parameters.segmentation, session.parameters.volume).values()
    assert dice(mask, spheres[1] == 1) > 0.9


@pytest.mark.slow
def test_a_bent_volume_is_refused_with_advice(session: SceneSession, spheres: tuple[Volume, np.ndarray]) -> None:
    id_, *_ = annotate(session, spheres)
    session.annotations.set_close_up(id_, (*centre_ras(spheres, 1)[0].tolist(), 50.0, 50.0, 50.0))
    bend(session.parameters.volume)
    bend(session.annotations.points_node(id_, positive=True))
    session.poll()
    assert session.phase == "no volume"
    assert session.volume_ml(id_) is None
    (error,) = session.errors
    assert "Harden" in error
    assert session.take_error() == error
    session.parameters.volume.Modified()
    assert session.take_error() is None
    session.parameters.volume.SetAndObserveTransformNodeID(None)
    assert session.errors == ()
    session.wait()
    assert session.phase == "ready"


@pytest.mark.slow
def test_other_voxels_need_other_features(session: SceneSession, spheres: tuple[Volume, np.ndarray]) -> None:
    annotate(session, spheres)
    volume = session.parameters.volume
    set_image(volume, spheres[0].array + 1.0, spheres[0].geometry.ijk_to_ras)
    session.wait()
    assert session.phase == "no features"
    assert session.estimate is not None
    assert not session.estimate.cached
    assert session.chosen_iso(session.classes[0].id) is None


@pytest.mark.slow
def test_that_features_cannot_be_kept_is_told_once_and_over_when_they_are(
    session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    annotate(session, spheres)
    session._proxy.not_kept = "Features cannot be kept."
    session.wait()
    session.poll()
    assert session.take_error() == "Features cannot be kept."
    session.poll()
    assert (session.take_error(), session.errors) == (None, ("Features cannot be kept.",))
    session._proxy.not_kept = ""
    session.poll()
    assert session.errors == ()


@pytest.mark.slow
def test_where_the_model_is_removed_that_it_was_damaged_is_over_and_its_download_is_asked_about(
    session: SceneSession, a_cache_of_its_own: Path
) -> None:
    weights = a_cache_of_its_own / "weights" / "dinov2_vits14_pretrain.pth"
    weights.parent.mkdir()
    weights.write_bytes(b"cut off")
    session.parameters.set("grid", 12)
    session.wait()
    assert "damaged" in (session.take_error() or "")
    session.remove_model()
    session.wait()
    assert session.errors == ()
    assert session.estimate is not None
    assert session.estimate.download is not None


@pytest.mark.slow
def test_where_features_are_there_they_stay_as_the_model_is_removed(session: SceneSession, a_cache_of_its_own: Path) -> None:
    weights = a_cache_of_its_own / "weights" / "dinov2_vits14_pretrain.pth"
    weights.parent.mkdir()
    weights.write_bytes(b"as good as any")
    before = session.estimate
    session.remove_model()
    assert not weights.exists()
    assert (session.phase, session.estimate) == ("ready", before)
    assert not session.busy


@pytest.mark.slow
@pytest.mark.parametrize("moment", ["at rest", "while maps are computed", "while segments are computed"])
@pytest.mark.parametrize("deleted", ["volume", "positive", "negative", "segmentation", "parameter node"])
def test_deleting_anything_at_any_moment_leaves_a_session_that_works(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray], deleted: str, moment: str
) -> None:
    ids = annotate(session, spheres)
    session.segments.write()
    session.wait()
    if moment == "while maps are computed":
        session.annotations.set_class(ids[0], iso=0.3)
        session.poll()
    elif moment == "while segments are computed":
        session.annotations.set_class(ids[0], iso=0.3)
        session.segments.write()
    nodes = {
        "volume": session.parameters.volume,
        "positive": session.annotations.points_node(ids[0], positive=True),
        "negative": session.annotations.points_node(ids[0], positive=False),
        "segmentation": session.parameters.segmentation,
        "parameter node": session.parameters.node,
    }
    slicer_app.scene.RemoveNode(nodes[deleted])
    session.wait()
    lost = deleted == "segmentation" and moment == "while segments are computed"
    assert ("was removed meanwhile" in (session.take_error() or "")) == lost
    assert session.take_error() is None
    assert len(session.classes) == {"positive": 2, "parameter node": 0}.get(deleted, 3)
    assert session.phase == ("no volume" if deleted in ("volume", "parameter node") else "ready")
    if session.phase == "ready":
        session.segments.write()
        session.wait()
        masks = segment_masks(session.parameters.segmentation, session.parameters.volume)
        assert dice(masks["sphere 3"], spheres[1] == 3) > 0.85


@pytest.mark.slow
def test_after_the_process_died_features_are_loaded_again(session: SceneSession, spheres: tuple[Volume, np.ndarray]) -> None:
    ids = annotate(session, spheres)
    assert session.compute_pid is not None
    os.kill(session.compute_pid, signal.SIGTERM)
    until = time.monotonic() + LONGEST_WAIT_S
    while session.phase == "ready" and time.monotonic() < until:
        session.poll()
    assert session.phase == "no features"
    assert "ended unexpectedly" in (session.take_error() or "")
    assert len(session.errors) == 1
    session.start_extraction()
    assert session.errors == ()
    session.wait()
    assert session.phase == "ready"
    assert session.chosen_iso(ids[0]) is not None


def test_nothing_to_segment_is_reported_and_nothing_written(session: SceneSession) -> None:
    session.segments.write()
    session.wait()
    assert "nothing to segment" in (session.take_error() or "")
    assert session.parameters.segmentation is None
    session.annotations.add_class()
    assert session.errors == ()


def test_what_cannot_be_shown_in_3d_is_told_until_it_is_switched_off(
    session: SceneSession, spheres: tuple[Volume, np.ndarray], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*args: Any) -> None:
        raise InputError("Slicer's module Volume Rendering is missing.")

    monkeypatch.setattr(ClassRendering, "show", refuse)
    annotate(session, spheres)
    assert session.errors == ("Slicer's module Volume Rendering is missing.",)
    assert session.chosen_iso(session.classes[0].id) is not None
    session.parameters.set("rendering", "off")
    assert session.errors == ()


def test_without_slicer_s_volume_rendering_the_user_is_told_and_everything_else_works(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    slicer_app.app_logic.SetModuleLogic("VolumeRendering", None)
    ids = annotate(session, spheres)
    assert "Volume Rendering" in (session.take_error() or "")
    assert all(session.chosen_iso(id_) is not None for id_ in ids)
    session.segments.write()
    session.wait()
    assert session.segments.of(ids[0]) is not None


def test_a_compute_process_that_does_not_start_is_an_error_for_the_user(
    slicer_app: Any, spheres: tuple[Volume, np.ndarray], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*args: Any) -> None:
        raise InputError("Slicer's Python is not found.")

    monkeypatch.setattr(scene_session, "ComputeClient", refuse)
    session = SceneSession(slicer_app.scene, slicer_app.app_logic, add_parameter_node(slicer_app.scene))
    session.set_volume(add_volume(slicer_app.scene, spheres[0]))
    assert session.take_error() == "Slicer's Python is not found."
    session.start_extraction()
    assert session.take_error() == "Slicer's Python is not found."
    assert session.phase == "no features"
    session.set_volume(None)
    assert session.errors == ()
    session.close()


def test_lists_that_are_deleted_together_with_much_else_are_classes_that_are_removed(
    slicer_app: Any, session: SceneSession
) -> None:
    state = session.annotations.add_class("sphere")
    slicer_app.scene.StartState(slicer_app.scene.BatchProcessState)
    slicer_app.scene.RemoveNode(session.annotations.points_node(state.id, positive=True))
    slicer_app.scene.EndState(slicer_app.scene.BatchProcessState)
    assert session.classes == ()
    session.annotations.undo()
    assert session.classes == (state,)
