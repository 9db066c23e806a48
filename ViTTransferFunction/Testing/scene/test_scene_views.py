"""Scene views, as Slicer has them from 5.10 on: sequences of all that says how something is displayed, ours among it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import slicer

from ViTTransferFunction.Logic.scene.mrml.nodes import nodes_of_class
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.scenes import annotate, write_all
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras
from ViTTransferFunction.Testing.support.views import Views, pixels, slice_pixel


class SceneViews:
    """Slicer's module Scene Views."""

    def __init__(self, app: Any) -> None:
        app.scene.RegisterNodeClass(slicer.vtkMRMLSequenceBrowserNode())
        # The application's logic does not keep those of its modules.
        self._sequences = app.register_module_logic(slicer.vtkSlicerSequencesLogic())
        self._logic = app.register_module_logic(slicer.vtkSlicerSceneViewsModuleLogic())

    def add(self, name: str) -> None:
        """Keep how everything is displayed, and all views."""
        self._logic.CreateSceneView(name, "", 0, None, True, True)

    def restore(self, number: int) -> None:
        """Bring it back, from 0."""
        assert self._logic.RestoreSceneView(number)


def derived(scene: Any) -> list[str]:
    """Names of the nodes that show what can be computed again."""
    ours = (node for node in nodes_of_class(scene, "vtkMRMLNode") if "ViTTransferFunction" in (node.GetID() or ""))
    return [node.GetName() for node in ours if not node.IsA("vtkMRMLScriptedModuleNode")]


@pytest.fixture
def scene_views(slicer_app: Any) -> SceneViews:
    return SceneViews(slicer_app)


def test_a_scene_view_from_before_takes_nothing_away_for_good(
    slicer_app: Any, scene_views: SceneViews, session: SceneSession, spheres: Spheres
) -> None:
    view = Views(slicer_app).slice_view()
    view.set_background_volume_id(session.parameters.volume.GetID())
    view.fit_view_to_content()
    scene_views.add("before")
    annotate(session, spheres)
    inside = slice_pixel(view, centre_ras(spheres, 1)[0])
    shown = pixels(view)[inside]
    assert len(set(shown.tolist())) > 1
    scene_views.add("after")
    before = session.classes
    for number in (0, 1):
        scene_views.restore(number)
        session.wait()
        assert session.classes == before
    slice_pixel(view, centre_ras(spheres, 1)[0])
    assert pixels(view)[inside].tolist() == shown.tolist()
    write_all(session)
    assert session.parameters.segmentation.GetSegmentation().GetNumberOfSegments() == 3


def test_scene_views_are_saved_and_bring_nothing_of_ours_into_another_slicer(
    slicer_app: Any, scene_views: SceneViews, session: SceneSession, spheres: Spheres, tmp_path: Path
) -> None:
    annotate(session, spheres)
    scene_views.add("structures")
    assert derived(slicer_app.scene)
    assert slicer_app.scene.WriteToMRB(str(tmp_path / "saved.mrb"))

    later = type(slicer_app)()
    views = SceneViews(later)
    assert later.scene.ReadFromMRB(str(tmp_path / "saved.mrb"), True)
    views.restore(0)
    assert derived(later.scene) == []
    node = later.scene.GetSingletonNode("ViTTransferFunction", "vtkMRMLScriptedModuleNode")
    opened = SceneSession(later.scene, later.app_logic, node)
    opened.wait()
    assert [state.name for state in opened.classes] == ["sphere 1", "sphere 2", "sphere 3"]
    views.restore(0)
    opened.wait()
    assert opened.up_to_date
    opened.close()
    assert derived(later.scene) == []
