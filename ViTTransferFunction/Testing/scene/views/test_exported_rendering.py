"""Renderings that stay: saved with the scene, and shown alike by a Slicer that does not have this extension."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import slicer
from vtkmodules.util.numpy_support import vtk_to_numpy

from ViTTransferFunction.Logic.rendering.appearance import Appearance
from ViTTransferFunction.Logic.rendering.composition import own_levels
from ViTTransferFunction.Logic.rendering.intensity_levels import gray_levels
from ViTTransferFunction.Logic.rendering.iso_surfaces import similarity_volume
from ViTTransferFunction.Logic.rendering.structure_volume import StructureVolume
from ViTTransferFunction.Logic.rendering.surroundings import Surroundings
from ViTTransferFunction.Logic.scene.mrml.nodes import nodes_of_class
from ViTTransferFunction.Logic.scene.views.exported_renderings import exported_renderings, remove_exported
from ViTTransferFunction.Logic.scene.views.rendering import ClassRendering
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import image_of, set_image
from ViTTransferFunction.Testing.support.standin.subject_hierarchy import keep_subject_hierarchy
from ViTTransferFunction.Testing.support.views import Views, ball, look_from, pixels

pytest.importorskip("skimage")
from skimage.metrics import structural_similarity

SHAPE = (16, 20, 24)
IJK_TO_RAS = np.array([[-2.0, 0, 0, 30], [0, 2.0, 0, -10], [0, 0, 2.5, 5], [0, 0, 0, 1]])
MIDDLE = (7.0, 9.0, 23.75)
DISTANCE_MM = 110.0

OPEN_ELSEWHERE = """
import sys
import numpy as np, vtk
from vtkmodules.util.numpy_support import vtk_to_numpy
from trame_slicer.core import SlicerApp
from trame_slicer.views import DirectViewFactory, ViewLayoutDefinition
app = SlicerApp()
app.view_manager.register_factory(DirectViewFactory(do_render_offscreen=True))
view = app.view_manager.create_view(ViewLayoutDefinition.threed_view(background_color="#000000"))
assert app.scene.ReadFromMRB(sys.argv[1])
view.get_view_node().SetVolumeRenderingSurfaceSmoothing(True)
view.render_window().SetSize(110, 110)
camera = view.renderer().GetActiveCamera()
x, y, z, distance = map(float, sys.argv[3:])
camera.SetFocalPoint(x, y, z); camera.SetPosition(x, y + distance, z); camera.SetViewUp(0, 0, 1)
view.renderer().ResetCameraClippingRange()
view.render()
grabber = vtk.vtkWindowToImageFilter()
grabber.SetInput(view.render_window()); grabber.ReadFrontBufferOff(); grabber.ShouldRerenderOff(); grabber.Update()
columns, rows, _ = grabber.GetOutput().GetDimensions()
shown = vtk_to_numpy(grabber.GetOutput().GetPointData().GetScalars()).reshape(rows, columns, -1)[..., :3]
assert not any(name.startswith("ViTTransferFunction") for name in sys.modules)
np.save(sys.argv[2], shown)
"""


@pytest.fixture
def views(slicer_app: Any) -> Views:
    return Views(slicer_app, SHAPE, IJK_TO_RAS)


@pytest.fixture
def rendering(views: Views) -> ClassRendering:
    """Two structures of different styles, and something bright around them."""
    maps = [ball(SHAPE, (7.5, 9.5, 6.0), 5.0), ball(SHAPE, (7.5, 9.5, 16.0), 4.0)]
    intensities = np.where(np.arange(SHAPE[0])[:, None, None] < 3, 220.0, 40.0 + 5.0 * np.indices(SHAPE)[2])
    composition = similarity_volume(maps, [0.5, 0.5])
    voxels = composition.voxels(gray_levels(intensities, np.arange(256.0), composition.shape))
    geometry = _geometry().resized(composition.shape)
    structures = StructureVolume(voxels, own_levels(voxels, 2), np.arange(256.0), False, 1.0, geometry)
    looks = [Appearance((0.9, 0.3, 0.2), tone=0.5), Appearance((0.2, 0.6, 0.9), 0.7, "glass")]
    around = Surroundings(((180.0, (0.9, 0.9, 0.8), 0.0), (230.0, (0.9, 0.9, 0.8), 0.5)))
    shown = ClassRendering(views.scene, views.app_logic)
    uniforms = structures.uniforms(looks, around)
    shown.show(views.volume, image_of(voxels), 2, uniforms, geometry.ijk_to_ras)
    return shown


def _box(views: Views) -> Any:
    """Of the left half, without handles in the views."""
    box = views.scene.AddNewNodeByClass("vtkMRMLMarkupsROINode")
    box.CreateDefaultDisplayNodes()
    box.GetDisplayNode().SetVisibility(False)
    box.SetXYZ(MIDDLE[0] + 40.0, MIDDLE[1], MIDDLE[2])
    box.SetRadiusXYZ(42.0, 12.0, 100.0)
    return box


def _plane(views: Views) -> Any:
    """Between the structures, without handles in the views."""
    plane = views.scene.AddNewNodeByClass("vtkMRMLMarkupsPlaneNode")
    plane.CreateDefaultDisplayNodes()
    plane.GetDisplayNode().SetVisibility(False)
    plane.SetOriginWorld(MIDDLE)
    plane.SetNormalWorld([1.0, 0.0, 0.0])
    return plane


def _geometry() -> Any:
    from ViTTransferFunction.Logic.core.volumes.geometry import Geometry

    return Geometry(SHAPE, IJK_TO_RAS)


def test_an_exported_rendering_looks_as_the_live_one_and_stays_when_that_goes(views: Views, rendering: ClassRendering) -> None:
    view = views.view_3d()
    look_from(view, np.array(MIDDLE), DISTANCE_MM)
    live = pixels(view)
    exported = rendering.export("CT structures")
    rendering.remove()
    view.get_view_node().SetVolumeRenderingSurfaceSmoothing(True)
    stayed = pixels(view)
    assert exported.GetName() == "CT structures"
    assert live.max() > 120
    assert structural_similarity(live, stayed, channel_axis=2) >= 0.95


@pytest.mark.parametrize("cut", ["off", "box", "plane"])
def test_an_exported_rendering_is_saved_and_looks_alike_where_this_extension_is_not(
    views: Views, rendering: ClassRendering, tmp_path: Path, cut: str
) -> None:
    """Cut as it was, wherever the box or plane goes afterwards."""
    view = views.view_3d()
    look_from(view, np.array(MIDDLE), DISTANCE_MM)
    live = pixels(view)
    if cut != "off":
        whole = live
        cut_by = {"box": _box, "plane": _plane}[cut](views)
        rendering.cut(cut_by)
        live = pixels(view)
        assert structural_similarity(live, whole, channel_axis=2) < 0.9
    rendering.export("CT structures")
    rendering.remove()
    if cut != "off":
        cut_by.SetCenterWorld(-300.0, 0.0, 0.0)
        views.scene.RemoveNode(cut_by)
    assert views.scene.WriteToMRB(str(tmp_path / "saved.mrb"))
    arguments = [str(tmp_path / "saved.mrb"), str(tmp_path / "shown.npy"), *map(str, (*MIDDLE, DISTANCE_MM))]
    subprocess.run([sys.executable, "-P", "-c", OPEN_ELSEWHERE, *arguments], check=True, cwd=tmp_path, timeout=600)
    elsewhere = np.load(tmp_path / "shown.npy")
    assert structural_similarity(live, elsewhere, channel_axis=2) >= 0.95


def test_only_what_is_exported_is_listed(views: Views, rendering: ClassRendering) -> None:
    keep_subject_hierarchy(views.scene)
    hierarchy = slicer.vtkMRMLSubjectHierarchyNode.GetSubjectHierarchyNode(views.scene)
    image = views.volume.GetImageData()
    live = ClassRendering(views.scene, views.app_logic)
    live.show(views.volume, image, 1, {}, IJK_TO_RAS)
    (shown,) = [node for node in nodes_of_class(views.scene, "vtkMRMLVectorVolumeNode") if node.GetImageData() is image]
    assert shown.GetHideFromEditors()
    assert hierarchy.GetItemByDataNode(shown) == hierarchy.GetInvalidItemID()
    assert live.export("CT structures") is shown
    assert not shown.GetHideFromEditors()
    assert hierarchy.GetItemName(hierarchy.GetItemByDataNode(shown)) == "CT structures"


def test_a_rendering_is_exported_also_where_the_user_deleted_what_displays_its_volume_in_slices(
    views: Views, rendering: ClassRendering
) -> None:
    for display in nodes_of_class(views.scene, "vtkMRMLVectorVolumeDisplayNode"):
        views.scene.RemoveNode(display)
    exported = rendering.export("CT structures")
    assert exported_renderings(views.scene) == [exported]


def test_an_exported_rendering_has_voxels_of_its_own_for_slices_as_well(views: Views, rendering: ClassRendering) -> None:
    (live,) = nodes_of_class(views.scene, "vtkMRMLVectorVolumeNode")
    assert not live.GetVolumeDisplayNode().GetAutoWindowLevel()
    before = vtk_to_numpy(live.GetImageData().GetPointData().GetScalars())
    exported = rendering.export("CT structures")
    after = vtk_to_numpy(exported.GetImageData().GetPointData().GetScalars())
    assert not np.shares_memory(before, after)
    np.testing.assert_array_equal(after, before)
    assert exported.GetVolumeDisplayNode().GetAutoWindowLevel()


def test_what_is_not_shown_is_not_exported(views: Views, rendering: ClassRendering) -> None:
    rendering.hide()
    before = views.scene.GetNumberOfNodes()
    assert rendering.export("CT structures") is None
    assert views.scene.GetNumberOfNodes() == before


@pytest.mark.parametrize("cut", ["off", "box", "plane"])
def test_an_exported_rendering_is_listed_and_removed_with_all_that_displays_it(
    views: Views, rendering: ClassRendering, cut: str
) -> None:
    scene = views.scene
    photo = scene.AddNewNodeByClass("vtkMRMLVectorVolumeNode", "in colours, and somebody else's")
    set_image(photo, np.zeros((*SHAPE, 3), dtype=np.uint8), IJK_TO_RAS)
    views.app_logic.GetModuleLogic("VolumeRendering").CreateDefaultVolumeRenderingNodes(photo)
    assert exported_renderings(scene) == []
    cut_by = {"box": _box, "plane": _plane}[cut](views) if cut != "off" else None
    rendering.cut(cut_by)
    before = scene.GetNumberOfNodes()
    exported = rendering.export("CT structures")
    assert exported_renderings(scene) == [exported]
    own = [node.GetID() for node in nodes_of_class(scene, "vtkMRMLNode") if node.GetName().startswith("CT structures")]
    assert len(own) >= 4
    remove_exported(scene, exported)
    assert exported_renderings(scene) == []
    assert [id_ for id_ in own if scene.GetNodeByID(id_) is not None] == []
    assert scene.GetNumberOfNodes() < before
    assert cut_by is None or scene.IsNodePresent(cut_by)
