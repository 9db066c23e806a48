"""Similarity maps and outlines over the slices, seen in the pixels of slice views."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import slicer
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkFiltersCore import vtkAppendPolyData, vtkCleanPolyData, vtkFeatureEdges, vtkMassProperties

from ViTTransferFunction.Logic.core.classes.class_map import ClassMap
from ViTTransferFunction.Logic.core.classes.colors import Color
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry, transform_points
from ViTTransferFunction.Logic.core.volumes.stepped_work import finished
from ViTTransferFunction.Logic.scene.mrml.nodes import nodes_of_class
from ViTTransferFunction.Logic.scene.views.contours import PART_VOXELS, Contours, ShownMap, Surface, iso_surface
from ViTTransferFunction.Logic.scene.views.display import SceneDisplay
from ViTTransferFunction.Logic.scene.views.overlay import SimilarityOverlay, similarity_levels
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image
from ViTTransferFunction.Testing.support.scenes import put_under
from ViTTransferFunction.Testing.support.views import Views, ball, pixels, slice_pixel

RED, GREEN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
SHAPE = (16, 16, 16)
CENTRE_KJI = (7.5, 7.5, 9.5)
RADIUS_MM = 10.0
ANTERIOR = np.array([0.0, 1.0, 0.0])
# Cells of 2.5 mm that fill the box of 40 voxels of 1 mm.
FINE = Geometry((40, 40, 40), np.array([[1.0, 0, 0, -20], [0, 1, 0, -25], [0, 0, 1, 5], [0, 0, 0, 1]]))
CELLS = FINE.resized(SHAPE)
CENTRE_RAS = CELLS.ijk_to_ras_points(np.array([CENTRE_KJI[::-1]]))[0]
SIMILARITY = ball(SHAPE, CENTRE_KJI, RADIUS_MM / 2.5, width=4.0)


@pytest.fixture
def views(slicer_app: Any) -> Views:
    return Views(slicer_app, FINE.shape, FINE.ijk_to_ras)


def a_map(iso: float = 0.5, array: np.ndarray = SIMILARITY, ijk_to_ras: np.ndarray = CELLS.ijk_to_ras) -> ClassMap:
    return ClassMap(array, Geometry(array.shape, ijk_to_ras), iso)


def outlined(color: Color, iso: float = 0.5) -> tuple[Color, Surface]:
    return color, finished(iso_surface(a_map(iso)))


def show(overlay: SimilarityOverlay, views: Views, opacity: float = 0.6, array: np.ndarray = SIMILARITY) -> None:
    overlay.show(views.volume, a_map(array=array), RED, opacity)


def outline(views: Views, contours: Contours, iso: float = 0.5) -> None:
    contours.show(views.volume, [outlined(GREEN, iso)])


def redness(picture: np.ndarray) -> np.ndarray:
    return picture[..., 0].astype(int) - picture[..., 1]


def is_green(picture: np.ndarray) -> np.ndarray:
    return (picture[..., 1] > 200) & (picture[..., 0] < 60)


def under_transform(views: Views) -> np.ndarray:
    """Put the volume under a rotation and a shift; returns the matrix."""
    matrix = np.array([[0.8, -0.6, 0, 12], [0.6, 0.8, 0, -7], [0, 0, 1, 30], [0, 0, 0, 1]])
    put_under(views.volume, matrix)
    return matrix


@pytest.mark.parametrize("dtype", [np.float32, np.uint8])
def test_the_overlay_is_strong_within_the_structure_weaker_at_its_border_and_gone_outside(views: Views, dtype: type) -> None:
    view = views.slice_view()
    array = SIMILARITY if dtype is np.float32 else np.rint(255 * SIMILARITY).astype(np.uint8)
    show(SimilarityOverlay(views.scene, views.app_logic), views, array=array)
    inside = slice_pixel(view, CENTRE_RAS)
    border = slice_pixel(view, CENTRE_RAS + (RADIUS_MM + 1) * ANTERIOR)
    outside = slice_pixel(view, CENTRE_RAS + 1.6 * RADIUS_MM * ANTERIOR)
    shown = redness(pixels(view))
    assert shown[inside] > 100
    assert 10 < shown[border] < 60
    assert shown[outside] == 0


def test_the_overlay_follows_its_opacity(views: Views) -> None:
    view, overlay = views.slice_view(), SimilarityOverlay(views.scene, views.app_logic)
    inside = slice_pixel(view, CENTRE_RAS)
    shown = []
    for opacity in (0.0, 0.3, 0.6):
        show(overlay, views, opacity)
        shown.append(redness(pixels(view))[inside])
    assert shown[0] == 0
    assert shown[2] == pytest.approx(2 * shown[1], abs=6)


def test_the_users_foreground_stays_and_hiding_brings_back_the_picture_that_was_there(views: Views) -> None:
    view, overlay, contours = views.slice_view(), SimilarityOverlay(views.scene, views.app_logic), Contours(views.scene)
    other = views.scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "PET")
    set_image(other, np.arange(8.0).reshape(2, 2, 2), FINE.resized((2, 2, 2)).ijk_to_ras)
    other.CreateDefaultDisplayNodes()
    view.set_foreground_volume_id(other.GetID())
    view.set_foreground_opacity(0.35)
    before = pixels(view)
    show(overlay, views)
    outline(views, contours)
    assert (pixels(view) != before).any()
    assert view.get_foreground_volume_id() == other.GetID()
    overlay.hide()
    contours.hide()
    assert np.array_equal(pixels(view), before)
    assert view.get_foreground_volume_id() == other.GetID()
    assert view.get_foreground_opacity() == 0.35


@pytest.mark.parametrize("iso", [0.3, 0.5, 0.8])
def test_the_outline_lies_where_the_map_crosses_its_iso_value(views: Views, iso: float) -> None:
    view = views.slice_view()
    outline(views, Contours(views.scene), iso)
    row, column = slice_pixel(view, CENTRE_RAS)
    outer, _ = slice_pixel(view, CENTRE_RAS + 10 * ANTERIOR)
    pixels_per_mm = abs(outer - row) / 10
    found = np.flatnonzero(is_green(pixels(view))[:, column])
    # The map falls by 0.1 each millimetre.
    expected = RADIUS_MM + (0.5 - iso) / 0.1
    assert abs(found - row).max() / pixels_per_mm == pytest.approx(expected, abs=0.6)
    assert abs(found - row).min() / pixels_per_mm == pytest.approx(expected, abs=0.6)


def test_overlay_and_outline_move_with_the_volume(views: Views) -> None:
    matrix = under_transform(views)
    view = views.slice_view()
    show(SimilarityOverlay(views.scene, views.app_logic), views)
    outline(views, Contours(views.scene))
    moved = transform_points(matrix, CENTRE_RAS[None])[0]
    inside, above = slice_pixel(view, moved), slice_pixel(view, moved + RADIUS_MM * ANTERIOR)
    shown = pixels(view)
    assert redness(shown)[inside] > 100
    assert is_green(shown)[above[0] - 2 : above[0] + 3, above[1]].any()


def test_overlay_and_outline_lie_right_in_an_oblique_anisotropic_volume(slicer_app: Any) -> None:
    axes = np.array([[1.6, -0.6, 0.3], [1.2, 0.8, -0.4], [0.1, 0.5, 3.0]])
    ijk_to_ras = np.eye(4)
    ijk_to_ras[:3, :3], ijk_to_ras[:3, 3] = axes, [10.0, -30.0, 7.0]
    views = Views(slicer_app, (16, 24, 20), ijk_to_ras)
    similarity = ball((16, 24, 20), (9.0, 15.0, 6.0), 4.0)
    centre = transform_points(ijk_to_ras, np.array([[6.0, 15.0, 9.0]]))[0]
    edge = transform_points(ijk_to_ras, np.array([[6.0, 19.0, 9.0]]))[0]
    view = views.slice_view("Sagittal")
    class_map = a_map(0.5, similarity, ijk_to_ras)
    SimilarityOverlay(views.scene, views.app_logic).show(views.volume, class_map, RED, 0.6)
    Contours(views.scene).show(views.volume, [(GREEN, finished(iso_surface(class_map)))])
    row, column = slice_pixel(view, centre)
    assert redness(pixels(view))[row, column] > 100
    row, column = slice_pixel(view, edge)
    assert is_green(pixels(view))[row - 2 : row + 3, column - 2 : column + 3].any()


def test_outlines_have_the_colours_of_their_classes_and_none_is_left_over(views: Views) -> None:
    view, contours = views.slice_view(), Contours(views.scene)
    slice_pixel(view, CENTRE_RAS)
    contours.show(views.volume, [outlined(GREEN), outlined((1.0, 0.0, 1.0), 0.9)])
    shown = pixels(view)
    assert is_green(shown).any()
    assert ((shown[..., 0] > 200) & (shown[..., 2] > 200) & (shown[..., 1] < 60)).any()
    contours.show(views.volume, [outlined(RED, 0.9)])
    assert not is_green(pixels(view)).any()
    contours.show(views.volume, [])
    assert redness(pixels(view)).max() < 60


def test_the_outline_of_the_class_that_is_overlaid_is_shown_at_once_and_all_others_together(
    views: Views, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[int] = []
    show = Contours.show

    def count(self: Contours, volume: Any, outlines: Any) -> None:
        shown.append(len(outlines))
        show(self, volume, outlines)

    monkeypatch.setattr(Contours, "show", count)
    display = SceneDisplay(views.scene, views.app_logic)
    display.show_maps(views.volume, [ShownMap(name, a_map(), GREEN) for name in "abcde"], "c", 0.5)
    shown.clear()
    while display.pending:
        display.advance()
    # Each time, all views cut all outlines anew.
    assert shown == [1, 5]


def test_of_more_classes_than_there_are_colours_each_has_its_own(views: Views) -> None:
    view, contours = views.slice_view(), Contours(views.scene)
    slice_pixel(view, CENTRE_RAS)
    contours.show(views.volume, [outlined(GREEN), *[(RED, [])] * 299])
    assert is_green(pixels(view)).any()


def test_an_iso_surface_is_closed_where_the_border_of_the_map_cuts_it() -> None:
    similarity = ball(SHAPE, (0.0, 7.5, 7.5), 4.0)
    for array in (similarity, np.rint(255 * similarity).astype(np.uint8).repeat(8, 0).repeat(8, 1).repeat(8, 2)):
        (surface,) = finished(iso_surface(a_map(0.5, array, np.eye(4))))
        triangles = vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(-1, 3)
        edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
        _, counts = np.unique(edges, axis=0, return_counts=True)
        assert (counts == 2).all()
        lowest = vtk_to_numpy(surface.GetPoints().GetData())[:, 2].min()
        assert lowest == pytest.approx(-0.5, abs=2e-3)


@pytest.mark.parametrize("at_end", [False, True])
def test_the_surface_of_a_fine_map_is_half_a_voxel_from_those_within_on_all_sides(at_end: bool) -> None:
    array = np.zeros((4, 5, 6), dtype=np.uint8)
    array[:2, :3, 1:3] = 255
    (surface,) = finished(iso_surface(a_map(0.5, np.flip(array) if at_end else array, np.eye(4))))
    expected = [0.5, 2.5, -0.5, 2.5, -0.5, 1.5] if not at_end else [2.5, 4.5, 1.5, 4.5, 1.5, 3.5]
    assert surface.GetBounds() == pytest.approx(expected, abs=5e-3)


def test_the_surface_of_a_large_map_is_made_in_parts_that_meet() -> None:
    shape, radius = (120, 120, 120), 56.0
    assert np.prod(shape) > PART_VOXELS
    class_map = a_map(0.5, np.rint(255 * ball(shape, (60.0, 60.0, 60.0), radius)).astype(np.uint8), np.eye(4))
    parts = finished(iso_surface(class_map))
    assert len(parts) > 1
    whole = vtkAppendPolyData()
    for part in parts:
        whole.AddInputData(part)
    joined = vtkCleanPolyData()
    joined.SetInputConnection(whole.GetOutputPort())
    joined.SetTolerance(1e-7)
    volume = vtkMassProperties()
    volume.SetInputConnection(joined.GetOutputPort())
    assert volume.GetVolume() == pytest.approx(4.0 / 3.0 * np.pi * radius**3, rel=0.01)
    gaps = vtkFeatureEdges()
    gaps.SetInputConnection(joined.GetOutputPort())
    gaps.FeatureEdgesOff()
    gaps.NonManifoldEdgesOff()
    gaps.Update()
    assert gaps.GetOutput().GetNumberOfCells() == 0


def test_coarse_maps_are_interpolated_trilinearly_for_the_overlay() -> None:
    rising = np.broadcast_to(np.linspace(0.0, 1.0, 9, dtype=np.float32), (9, 9, 9))
    levels, geometry = similarity_levels(a_map(0.5, rising, np.diag([4.0, 4.0, 4.0, 1.0])), 0.3)
    centres = geometry.ijk_to_ras_points(np.array([[i, 3, 3] for i in range(levels.shape[2])]))[:, 0]
    assert levels.shape[2] > 12
    expected = 255 * np.interp(centres, np.arange(9) * 4.0, rising[0, 0])
    assert levels[3, 3][expected > 0.3 * 255] == pytest.approx(expected[expected > 0.3 * 255], abs=1.0)


def test_showing_and_removing_again_and_again_leaves_nothing_behind(views: Views) -> None:
    view = views.slice_view()
    before, picture = views.scene.GetNumberOfNodes(), pixels(view)
    for _ in range(50):
        overlay, contours = SimilarityOverlay(views.scene, views.app_logic), Contours(views.scene)
        show(overlay, views)
        outline(views, contours)
        overlay.remove()
        contours.remove()
    assert views.scene.GetNumberOfNodes() == before
    assert np.array_equal(pixels(view), picture)


def test_an_update_changes_the_nodes_in_place_and_none_is_saved(views: Views) -> None:
    overlay, contours = SimilarityOverlay(views.scene, views.app_logic), Contours(views.scene)
    before = {views.scene.GetNthNode(n).GetID() for n in range(views.scene.GetNumberOfNodes())}
    counts = []
    for opacity in (0.4, 0.5):
        show(overlay, views, opacity)
        outline(views, contours, opacity)
        counts.append(views.scene.GetNumberOfNodes())
    assert counts[0] == counts[1] > len(before)
    added = [views.scene.GetNthNode(n) for n in range(counts[1]) if views.scene.GetNthNode(n).GetID() not in before]
    assert not any(node.GetSaveWithScene() for node in added)


@pytest.mark.parametrize("class_name", ["vtkMRMLLabelMapVolumeNode", "vtkMRMLModelNode", "vtkMRMLColorTableNode"])
def test_what_the_user_deletes_comes_back_with_the_next_update(views: Views, class_name: str) -> None:
    view, overlay, contours = views.slice_view(), SimilarityOverlay(views.scene, views.app_logic), Contours(views.scene)
    show(overlay, views)
    outline(views, contours)
    inside = slice_pixel(view, CENTRE_RAS)
    shown = pixels(view)
    derived = [node for node in nodes_of_class(views.scene, class_name) if "Similarity" in node.GetName()]
    assert derived
    for node in derived:
        views.scene.RemoveNode(node)
    show(overlay, views)
    outline(views, contours)
    assert redness(shown)[inside] > 100
    assert np.array_equal(pixels(view), shown)


def test_a_scene_opened_after_another_was_closed_shows_overlay_and_outline_of_its_own_volume(slicer_app: Any) -> None:
    closed = Views(slicer_app, FINE.shape, FINE.ijk_to_ras)
    overlay, contours = SimilarityOverlay(closed.scene, closed.app_logic), Contours(closed.scene)
    show(overlay, closed)
    outline(closed, contours)
    slicer_app.scene.Clear(False)
    overlay.hide()
    contours.hide()
    views = Views(slicer_app, FINE.shape, FINE.ijk_to_ras)
    view = views.slice_view()
    inside = slice_pixel(view, CENTRE_RAS)
    empty, nodes = pixels(view), views.scene.GetNumberOfNodes()
    assert redness(empty)[inside] == 0
    show(overlay, views)
    outline(views, contours)
    shown = pixels(view)
    assert redness(shown)[inside] > 100
    assert is_green(shown).any()
    overlay.remove()
    contours.remove()
    assert np.array_equal(pixels(view), empty)
    assert views.scene.GetNumberOfNodes() == nodes


def test_no_volume_takes_the_place_of_an_overlay_that_a_saved_scene_view_remembers(
    slicer_app: Any, views: Views, tmp_path: Path
) -> None:
    view, overlay = views.slice_view(), SimilarityOverlay(views.scene, views.app_logic)
    picture = pixels(view)
    show(overlay, views)
    views.scene.AddNode(slicer.vtkMRMLSceneViewNode()).StoreScene()
    assert views.scene.WriteToMRB(str(tmp_path / "saved.mrb"))

    later = Views(type(slicer_app)(), FINE.shape, FINE.ijk_to_ras)
    later.scene.RegisterNodeClass(slicer.vtkMRMLSceneViewNode())
    view = later.slice_view()
    assert later.scene.ReadFromMRB(str(tmp_path / "saved.mrb"), True)
    for _ in range(3):
        node = later.scene.AddNewNodeByClass("vtkMRMLLabelMapVolumeNode")
        set_image(node, np.ones(FINE.shape, dtype=np.uint8), FINE.ijk_to_ras)
        node.CreateDefaultDisplayNodes()
        node.SetSaveWithScene(False)
    (scene_view,) = nodes_of_class(later.scene, "vtkMRMLSceneViewNode")
    scene_view.RestoreScene()
    assert np.array_equal(pixels(view), picture)
