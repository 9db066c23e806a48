"""What 3D renderings are cut by."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import vtk
from vtkmodules.util.numpy_support import vtk_to_numpy

from ViTTransferFunction.Logic.scene.interface.parameters import SceneParameters
from ViTTransferFunction.Logic.scene.views.rendering_cut import cut_for_export, shown_cut
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image
from ViTTransferFunction.Testing.support.scenes import MOVED, put_under


def cut_by(scene: Any, name: str) -> tuple[SceneParameters, Any]:
    """Parameters by which renderings are cut by what is called so, and a volume."""
    parameters = SceneParameters(scene.AddNewNodeByClass("vtkMRMLScriptedModuleNode"))
    volume = scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "CT")
    set_image(volume, np.zeros((10, 20, 30), dtype=np.int16), np.eye(4))
    parameters.set("renderingCut", name)
    return parameters, volume


def test_the_box_is_made_around_the_volume_when_wanted_and_hidden_when_not(slicer_app: Any) -> None:
    scene = slicer_app.scene
    parameters = SceneParameters(scene.AddNewNodeByClass("vtkMRMLScriptedModuleNode"))
    volume = scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "CT")
    set_image(volume, np.zeros((10, 20, 30), dtype=np.int16), np.diag([1.0, 1.0, 2.0, 1.0]))
    assert shown_cut(scene, parameters, volume) is None
    parameters.set("renderingCut", "box")
    box: Any = shown_cut(scene, parameters, volume)
    bounds = [0.0] * 6
    box.GetRASBounds(bounds)
    displayed = box.GetDisplayNode()
    assert bounds == pytest.approx([-0.5, 29.5, -0.5, 19.5, -1.0, 19.0])
    assert shown_cut(scene, parameters, volume) is box
    parameters.set("renderingCut", "off")
    assert shown_cut(scene, parameters, volume) is None
    assert not displayed.GetVisibility()
    parameters.set("renderingCut", "box")
    scene.RemoveNode(box)
    assert shown_cut(scene, parameters, volume) is not None


def test_the_plane_goes_through_the_middle_and_gives_way_to_the_box_and_back(slicer_app: Any) -> None:
    scene = slicer_app.scene
    parameters = SceneParameters(scene.AddNewNodeByClass("vtkMRMLScriptedModuleNode"))
    volume = scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "CT")
    set_image(volume, np.zeros((10, 20, 30), dtype=np.int16), np.diag([1.0, 1.0, 2.0, 1.0]))
    parameters.set("renderingCut", "plane")
    plane = shown_cut(scene, parameters, volume)
    assert plane.GetOriginWorld() == pytest.approx([14.5, 9.5, 9.0])
    assert plane.GetNormalWorld() == pytest.approx([0.0, 1.0, 0.0])
    # Across the volume, from left to right and from feet to head.
    corners = vtk.vtkPoints()
    plane.GetPlaneCornerPointsWorld(corners)
    extent = np.ptp(vtk_to_numpy(corners.GetData()), axis=0)
    np.testing.assert_allclose(extent, [30.0, 0.0, 20.0], atol=1e-6)
    parameters.set("renderingCut", "box")
    box = shown_cut(scene, parameters, volume)
    assert box.IsA("vtkMRMLMarkupsROINode")
    assert [bool(node.GetDisplayNode().GetVisibility()) for node in (plane, box)] == [False, True]
    parameters.set("renderingCut", "plane")
    assert shown_cut(scene, parameters, volume) is plane
    assert [bool(node.GetDisplayNode().GetVisibility()) for node in (plane, box)] == [True, False]


@pytest.mark.parametrize("name", ["box", "plane"])
def test_what_the_user_hides_stays_hidden_and_cuts_until_it_is_chosen_again(slicer_app: Any, name: str) -> None:
    scene = slicer_app.scene
    parameters, volume = cut_by(scene, name)
    cut = shown_cut(scene, parameters, volume)
    assert cut.GetDisplayNode().GetVisibility()
    cut.GetDisplayNode().SetVisibility(False)
    assert shown_cut(scene, parameters, volume) is cut
    assert not cut.GetDisplayNode().GetVisibility()
    parameters.set("renderingCut", "off")
    assert shown_cut(scene, parameters, volume) is None
    parameters.set("renderingCut", name)
    assert shown_cut(scene, parameters, volume) is cut
    assert cut.GetDisplayNode().GetVisibility()


def test_without_a_rendering_there_is_nothing_that_would_cut_it(slicer_app: Any) -> None:
    scene = slicer_app.scene
    parameters, volume = cut_by(scene, "box")
    box: Any = shown_cut(scene, parameters, volume)
    parameters.set("rendering", "off")
    assert shown_cut(scene, parameters, volume) is None
    assert not box.GetDisplayNode().GetVisibility()
    parameters.set("rendering", "similarity")
    assert shown_cut(scene, parameters, volume) is box
    assert box.GetDisplayNode().GetVisibility()


@pytest.mark.parametrize("cut", ["box", "plane"])
def test_what_cut_another_volume_comes_to_one_that_lies_elsewhere_and_stays_where_it_is_put_there(
    slicer_app: Any, cut: str
) -> None:
    scene = slicer_app.scene
    parameters = SceneParameters(scene.AddNewNodeByClass("vtkMRMLScriptedModuleNode"))
    parameters.set("renderingCut", cut)
    volumes = [scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", name) for name in ("here", "there")]
    for volume, shift_mm in zip(volumes, (0.0, 500.0), strict=True):
        moved = np.eye(4)
        moved[2, 3] = shift_mm
        set_image(volume, np.zeros((10, 20, 30), dtype=np.int16), moved)
    here, there = volumes
    node = shown_cut(scene, parameters, here)
    scene.RemoveNode(here)
    assert shown_cut(scene, parameters, there) is node
    assert node.GetCenterWorld() == pytest.approx([14.5, 9.5, 504.5])
    node.SetCenterWorld(0.0, 0.0, 0.0)
    shown_cut(scene, parameters, there)
    assert node.GetCenterWorld() == pytest.approx([0.0, 0.0, 0.0])


@pytest.mark.parametrize("cut", ["box", "plane"])
def test_what_cuts_stays_where_it_is_when_its_middle_lies_in_the_next_volume_too(slicer_app: Any, cut: str) -> None:
    scene = slicer_app.scene
    parameters = SceneParameters(scene.AddNewNodeByClass("vtkMRMLScriptedModuleNode"))
    parameters.set("renderingCut", cut)
    baseline, follow_up = (scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", name) for name in ("baseline", "follow-up"))
    for volume in (baseline, follow_up):
        set_image(volume, np.zeros((10, 20, 30), dtype=np.int16), np.eye(4))
    node = shown_cut(scene, parameters, baseline)
    node.SetCenterWorld(25.0, 5.0, 1.0)
    assert shown_cut(scene, parameters, follow_up) is node
    assert node.GetCenterWorld() == pytest.approx([25.0, 5.0, 1.0])


def test_the_plane_is_moved_by_handles_along_its_normal_and_tilted_and_hides_nothing(slicer_app: Any) -> None:
    scene = slicer_app.scene
    parameters, volume = cut_by(scene, "plane")
    display = shown_cut(scene, parameters, volume).GetDisplayNode()
    assert display.GetHandlesInteractive()
    assert display.GetTranslationHandleVisibility()
    assert display.GetRotationHandleVisibility()
    assert not display.GetScaleHandleVisibility()
    assert list(display.GetTranslationHandleComponentVisibility())[:3] == [False, False, True]
    assert list(display.GetRotationHandleComponentVisibility())[:3] == [True, True, False]
    assert not display.GetFillVisibility()
    assert not display.GetPropertiesLabelVisibility()


@pytest.mark.parametrize("cut", ["box", "plane"])
def test_what_cuts_an_exported_rendering_is_where_the_live_one_was_and_out_of_sight(slicer_app: Any, cut: str) -> None:
    scene = slicer_app.scene
    parameters, volume = cut_by(scene, cut)
    node = shown_cut(scene, parameters, volume)
    put_under(node, MOVED)
    node.SetCenterWorld([25.0, 5.0, 1.0])
    own = cut_for_export(scene, node, "CT structures cut")
    node.SetCenterWorld([0.0, 0.0, 0.0])
    assert own.GetName() == "CT structures cut"
    assert own.GetCenterWorld() == pytest.approx([25.0, 5.0, 1.0])
    assert node.GetDisplayNode().GetVisibility()
    assert not own.GetDisplayNode().GetVisibility()
