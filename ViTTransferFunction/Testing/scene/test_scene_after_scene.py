"""A session while scenes are closed, saved and opened: each is taken up, and nothing of those before stays."""

from __future__ import annotations

import gc
import os
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import vtk

from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.scene.annotation_tool import AnnotationTool
from ViTTransferFunction.Logic.scene.mrml.nodes import nodes_of_class
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.tools.slice_tools import SliceTools
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image
from ViTTransferFunction.Testing.support.known_features import GRID
from ViTTransferFunction.Testing.support.scenes import add_volume, annotate, segment_masks


def test_volumes_of_a_scene_that_was_closed_are_kept_by_nobody(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    annotate(session, spheres)
    left = [weakref.ref(node) for node in nodes_of_class(slicer_app.scene, "vtkMRMLVolumeNode")]
    slicer_app.scene.Clear(False)
    session.wait()
    gc.collect()
    assert [volume() for volume in left if volume() is not None] == []


def test_a_scan_that_is_removed_while_another_one_is_chosen_is_kept_by_nobody(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    tool = AnnotationTool(slicer_app.app_logic, SliceTools(tuple), lambda: 1.0, pytest.fail, lambda: None)
    tool.session = session
    annotate(session, spheres)
    session.wait()
    tool.toggle("pointOn")
    tool.put_down()
    image = vtk.vtkWeakReference()
    image.Set(session.parameters.volume.GetImageData())
    session.set_volume(add_volume(slicer_app.scene, Volume(-spheres[0].array, spheres[0].geometry, "other")))
    session.wait()
    slicer_app.scene.RemoveNode(slicer_app.scene.GetFirstNodeByName(spheres[0].name))
    session.wait()
    gc.collect()
    assert image.Get() is None


@pytest.mark.slow
def test_closing_the_scene_leaves_a_session_for_the_next_one(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    annotate(session, spheres)
    slicer_app.scene.Clear(False)
    session.wait()
    assert (session.phase, session.classes, session.take_error()) == ("no volume", (), None)
    assert not session.annotations.can_undo
    session.parameters.set("grid", GRID)
    session.set_volume(add_volume(slicer_app.scene, spheres[0]))
    annotate(session, spheres)
    assert all(session.chosen_iso(state.id) is not None for state in session.classes)


@pytest.mark.slow
def test_closing_the_scene_while_features_are_loaded_stops_that(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    set_image(session.parameters.volume, spheres[0].array, spheres[0].geometry.ijk_to_ras)
    assert session.busy
    slicer_app.scene.Clear(False)
    session.wait()
    assert (session.phase, session.progress) == ("no volume", None)


@pytest.mark.slow
def test_a_saved_scene_carries_on_where_it_was_left(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray], tmp_path: Path
) -> None:
    (id_, *_) = annotate(session, spheres)
    session.annotations.set_class(id_, opacity=0.4, proximity=0.2, color=(0.2, 0.4, 0.6))
    session.select_class(session.classes[1].id)
    session.segments.write()
    session.wait()
    before = session.classes, session.selected_class
    masks = segment_masks(session.parameters.segmentation, session.parameters.volume)
    assert slicer_app.scene.WriteToMRB(str(tmp_path / "tomorrow.mrb"))
    slicer_app.scene.Clear(False)
    session.wait()
    assert slicer_app.scene.ReadFromMRB(str(tmp_path / "tomorrow.mrb"))
    session.wait()
    assert session.take_error() is None
    assert session.phase == "ready"
    assert (session.classes, session.selected_class) == before
    assert session.chosen_iso(id_) is not None
    again = segment_masks(session.parameters.segmentation, session.parameters.volume)
    for name, mask in masks.items():
        np.testing.assert_array_equal(again[name], mask)


@pytest.mark.slow
def test_a_scene_that_is_loaded_in_place_of_another_is_taken_up(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray], tmp_path: Path
) -> None:
    (id_, *_) = annotate(session, spheres)
    saved = session.classes
    assert slicer_app.scene.WriteToMRB(str(tmp_path / "yesterday.mrb"))
    session.annotations.remove_class(id_)
    session.set_volume(None)
    session.wait()
    replaces_what_is_there = True
    assert slicer_app.scene.ReadFromMRB(str(tmp_path / "yesterday.mrb"), replaces_what_is_there)
    session.wait()
    assert session.phase == "ready"
    assert session.classes == saved
    assert session.chosen_iso(id_) is not None
    assert not session.annotations.can_undo


@pytest.mark.slow
def test_scene_after_scene_leaves_no_node_no_observer_and_no_memory_behind(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    counts = []
    for _ in range(16):
        slicer_app.scene.Clear(False)
        session.parameters.set("grid", GRID)
        session.parameters.set("refinement", "none")
        session.set_volume(add_volume(slicer_app.scene, spheres[0]))
        annotate(session, spheres)
        gc.collect()
        counts.append((slicer_app.scene.GetNumberOfNodes(), session.observer_count, resident_bytes()))
    nodes, observers, memory = zip(*counts, strict=True)
    assert len(set(nodes[1:])) == 1
    assert len(set(observers[1:])) == 1
    # A copy of the volume that stays behind in each of the last twelve scenes would be 3 MB.
    assert memory[-1] - memory[3] < 2e6


def resident_bytes() -> int:
    """Memory of this process."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
