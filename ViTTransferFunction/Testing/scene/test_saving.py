"""A scene that is saved while everything is shown: the views do not change, and what the user chose for them is in the file."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import vtk

from ViTTransferFunction.Logic.core.system.file_names import is_device
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.scene.mrml.nodes import nodes_of_class
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.views.slice_layer import COMPOSITE_CLASS
from ViTTransferFunction.Testing.support.scenes import add_volume, annotate, open_spheres, write_all
from ViTTransferFunction.Testing.support.standin.subject_hierarchy import items_without_node, keep_subject_hierarchy
from ViTTransferFunction.Testing.support.views import Views, pixels


def state_of_views(scene: Any) -> dict[str, Any]:
    """What a user sets in slice and 3D views: names of volumes, opacities, smoothing, attributes."""
    (composite,) = nodes_of_class(scene, COMPOSITE_CLASS)
    (view,) = nodes_of_class(scene, "vtkMRMLViewNode")
    ids = (composite.GetBackgroundVolumeID(), composite.GetForegroundVolumeID(), composite.GetLabelVolumeID())
    return {
        "volumes": [id_ and scene.GetNodeByID(id_).GetName() for id_ in ids],
        "opacities": [composite.GetForegroundOpacity(), composite.GetLabelOpacity()],
        "additional layers": composite.GetNumberOfAdditionalLayers(),
        "smoothing": view.GetVolumeRenderingSurfaceSmoothing(),
        "attributes": view.GetAttributeNames(),
    }


@pytest.mark.slow
def test_views_of_a_saved_scene_are_as_the_user_had_them_and_show_the_maps_again_while_a_session_is_open(
    slicer_app: Any, spheres: tuple[Volume, np.ndarray], tmp_path: Path
) -> None:
    views = Views(slicer_app)
    session = open_spheres(slicer_app, spheres)
    view, in_3d = views.slice_view(), views.view_3d()
    view.set_background_volume_id(session.parameters.volume.GetID())
    view.set_foreground_volume_id(add_volume(slicer_app.scene, Volume(*_pet(spheres), "PET")).GetID())
    view.set_foreground_opacity(0.35)
    view.fit_view_to_content()
    chosen = state_of_views(slicer_app.scene)
    annotate(session, spheres)
    shown = state_of_views(slicer_app.scene)
    assert shown["additional layers"] == 1
    assert shown["smoothing"]
    picture = pixels(view)
    assert slicer_app.scene.WriteToMRB(str(tmp_path / "saved.mrb"))
    np.testing.assert_array_equal(pixels(view), picture)
    assert state_of_views(slicer_app.scene) == shown
    session.close()
    assert state_of_views(slicer_app.scene) == chosen
    del in_3d

    later = type(slicer_app)()
    assert later.scene.ReadFromMRB(str(tmp_path / "saved.mrb"))
    parameters = later.scene.GetSingletonNode("ViTTransferFunction", "vtkMRMLScriptedModuleNode")
    session = SceneSession(later.scene, later.app_logic, parameters)
    assert state_of_views(later.scene) == chosen
    session.wait()
    assert state_of_views(later.scene) == shown
    session.close()
    assert state_of_views(later.scene) == chosen


def _pet(spheres: tuple[Volume, np.ndarray]) -> tuple[np.ndarray, Any]:
    volume, labels = spheres
    return 50.0 * labels.astype(np.float32), volume.geometry


@pytest.mark.slow
def test_what_is_shown_is_neither_listed_nor_unsaved(
    slicer_app: Any, spheres: tuple[Volume, np.ndarray], tmp_path: Path
) -> None:
    """In a tree as Slicer's Data module keeps it: what is not saved would leave an entry there each time that it is saved."""
    keep_subject_hierarchy(slicer_app.scene)
    views = Views(slicer_app)
    shown_in = views.slice_view(), views.view_3d()
    session = open_spheres(slicer_app, spheres)
    annotate(session, spheres)
    for number in range(2):
        file = str(tmp_path / f"saved {number}.mrb")
        assert slicer_app.scene.WriteToMRB(file)
        unsaved = vtk.vtkCollection()
        slicer_app.scene.GetStorableNodesModifiedSinceRead(unsaved)
        assert [node.GetName() for node in unsaved if not node.GetSaveWithScene()] == []
        session.close()
        slicer_app.scene.Clear(False)
        assert slicer_app.scene.ReadFromMRB(file)
        assert items_without_node(slicer_app.scene) == []
        parameters = slicer_app.scene.GetSingletonNode("ViTTransferFunction", "vtkMRMLScriptedModuleNode")
        session = SceneSession(slicer_app.scene, slicer_app.app_logic, parameters)
        session.wait()
        assert len(session.annotations.classes) == 3
    session.close()
    del shown_in


@pytest.mark.parametrize(
    "name", ["liver & spleen", "< 2 cm > \"a\" 'b' %20 #1", "4D\\5:6|7?*", "肝臓", "&amp;", "con", "Aux.1"]
)
def test_a_scene_with_structures_of_any_name_is_opened_again(
    slicer_app: Any, spheres: tuple[Volume, np.ndarray], tmp_path: Path, name: str
) -> None:
    session = open_spheres(slicer_app, spheres)
    annotate(session, spheres)
    session.annotations.set_class(session.classes[0].id, name=name)
    session.wait()
    session.parameters.volume.SetName("CT")
    write_all(session)
    names, written = [state.name for state in session.classes], session.segments.of(session.classes[0].id)
    assert names[0] == name
    assert session.file_classes.annotated()[0].request.name == name
    assert slicer_app.scene.WriteToMRB(str(tmp_path / "saved.mrb"))
    with zipfile.ZipFile(tmp_path / "saved.mrb") as archive:
        assert not set("".join(archive.namelist())) & set('<>:"|?*\\'), "Windows takes no such names"
        assert not [file for file in archive.namelist() if is_device(Path(file).name)]
    slicer_app.scene.Clear(False)
    assert slicer_app.scene.ReadFromMRB(str(tmp_path / "saved.mrb"))
    session.wait()
    assert [state.name for state in session.classes] == names
    assert session.segments.of(session.classes[0].id) == written
    session.close()
