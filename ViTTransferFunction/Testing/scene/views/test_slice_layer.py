"""A volume over what slice views show, seen in their pixels; what the user chose to see stays as it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import slicer

from ViTTransferFunction.Logic.scene.mrml.nodes import nodes_of_class
from ViTTransferFunction.Logic.scene.views.slice_layer import COMPOSITE_CLASS, SliceLayer
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image
from ViTTransferFunction.Testing.support.views import BACKGROUND_GRAY, Views, pixels, slice_pixel

SHAPE = (32, 32, 32)
INSIDE, OUTSIDE = np.array([16.0, 16.0, 16.0]), np.array([16.0, 28.0, 16.0])
OPACITY = 0.5
FIRST = 3


@pytest.fixture
def views(slicer_app: Any) -> Views:
    return Views(slicer_app, SHAPE)


@pytest.fixture
def layer(views: Views) -> SliceLayer:
    return SliceLayer(views.scene, views.app_logic)


def red_cube(views: Views) -> Any:
    """A label map, red in the middle and transparent about it, which is not saved."""
    return cube(views, (1.0, 0.0, 0.0), slice(10, 22), saved=False)


def cube(views: Views, color: tuple[float, float, float], extent: slice, saved: bool = True) -> Any:
    colors = views.scene.AddNewNodeByClass("vtkMRMLColorTableNode", f"colors {color}")
    colors.SetTypeToUser()
    colors.SetNumberOfColors(2)
    colors.SetColor(0, 0.0, 0.0, 0.0, 0.0)
    colors.SetColor(1, *color, 1.0)
    labels = np.zeros(SHAPE, dtype=np.uint8)
    labels[extent, extent, extent] = 1
    node = views.scene.AddNewNodeByClass("vtkMRMLLabelMapVolumeNode", f"cube {color}")
    set_image(node, labels, np.eye(4))
    node.CreateDefaultDisplayNodes()
    node.GetDisplayNode().SetAndObserveColorNodeID(colors.GetID())
    for derived in (colors, node, node.GetDisplayNode()):
        derived.SetSaveWithScene(saved)
    return node


def add_pet(views: Views) -> Any:
    """The user's foreground: brighter than the background, brighter still at the back."""
    node = views.scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "PET")
    set_image(node, np.indices(SHAPE)[1].astype(np.int16) * 3 + 100, np.eye(4))
    node.CreateDefaultDisplayNodes()
    node.GetDisplayNode().SetAutoWindowLevel(False)
    node.GetDisplayNode().SetWindowLevelMinMax(0.0, 255.0)
    return node


def composite_of(view: Any) -> Any:
    (node,) = [
        node
        for node in nodes_of_class(view.get_view_node().GetScene(), COMPOSITE_CLASS)
        if node.GetLayoutName() == view.get_view_node().GetLayoutName()
    ]
    return node


def chosen_by_the_user(composite: Any) -> tuple[Any, ...]:
    return (
        composite.GetBackgroundVolumeID(),
        composite.GetForegroundVolumeID(),
        composite.GetLabelVolumeID(),
        composite.GetForegroundOpacity(),
        composite.GetLabelOpacity(),
        composite.GetCompositing(),
    )


def volumes_in(composite: Any) -> list[str]:
    """Names of the volumes in the additional layers."""
    count = composite.GetNumberOfAdditionalLayers()
    return [composite.GetNthLayerVolume(FIRST + n).GetName() for n in range(count)]


def redness(view: Any, ras: np.ndarray) -> int:
    pixel = slice_pixel(view, ras)
    shown = pixels(view)[pixel].astype(int)
    return int(shown[0] - shown[1])


def with_pet(views: Views) -> Any:
    """A view with the user's foreground at an opacity of 0.6."""
    view = views.slice_view()
    view.set_foreground_volume_id(add_pet(views).GetID())
    view.set_foreground_opacity(0.6)
    return view


def test_the_layer_lies_over_the_users_foreground_which_shines_through(views: Views, layer: SliceLayer) -> None:
    view = with_pet(views)
    inside, outside = slice_pixel(view, INSIDE), slice_pixel(view, OUTSIDE)
    before, chosen = pixels(view).astype(float), chosen_by_the_user(composite_of(view))
    assert before[inside][0] > BACKGROUND_GRAY + 30
    layer.show(red_cube(views), OPACITY)
    shown = pixels(view)
    expected = (1 - OPACITY) * before[inside] + OPACITY * np.array([255.0, 0.0, 0.0])
    np.testing.assert_allclose(shown[inside], expected, atol=2.0)
    np.testing.assert_array_equal(shown[outside], before[outside])
    assert chosen_by_the_user(composite_of(view)) == chosen
    layer.hide()
    np.testing.assert_array_equal(pixels(view), before)
    assert chosen_by_the_user(composite_of(view)) == chosen


def test_fading_the_foreground_fades_the_layer_neither_out_nor_in(views: Views, layer: SliceLayer) -> None:
    view, volume = with_pet(views), red_cube(views)
    layer.show(volume, OPACITY)
    reds = []
    for foreground_opacity in (0.0, 0.5, 1.0):
        view.set_foreground_opacity(foreground_opacity)
        layer.show(volume, OPACITY)
        reds.append(redness(view, INSIDE))
        assert view.get_foreground_opacity() == foreground_opacity
    np.testing.assert_allclose(reds, 255 * OPACITY, atol=2.0)


def test_another_opacity_is_taken_on_by_the_layer_alone(views: Views, layer: SliceLayer) -> None:
    view, volume = with_pet(views), red_cube(views)
    layer.show(volume, OPACITY)
    layer.show(volume, 0.2)
    assert redness(view, INSIDE) == pytest.approx(255 * 0.2, abs=2.0)
    assert view.get_foreground_opacity() == 0.6


def test_a_view_that_appears_later_shows_the_layer(views: Views, layer: SliceLayer) -> None:
    layer.show(red_cube(views), OPACITY)
    assert redness(views.slice_view("Coronal"), INSIDE) > 100
    views.scene.StartState(views.scene.BatchProcessState)
    view = views.slice_view("Sagittal")
    views.scene.EndState(views.scene.BatchProcessState)
    assert redness(view, INSIDE) > 100


def test_who_takes_the_layer_away_gets_it_back_only_after_it_was_hidden(views: Views, layer: SliceLayer) -> None:
    view, volume = views.slice_view(), red_cube(views)
    layer.show(volume, OPACITY)
    composite_of(view).SetNthLayerVolumeID(FIRST, None)
    layer.show(volume, 0.7)
    assert redness(view, INSIDE) == 0
    layer.hide()
    layer.show(volume, OPACITY)
    assert redness(view, INSIDE) > 100


def test_layers_of_others_keep_their_volumes_and_opacities(views: Views, layer: SliceLayer) -> None:
    view = views.slice_view()
    composite = composite_of(view)
    below, above = cube(views, (0.0, 1.0, 0.0), slice(4, 30)), cube(views, (0.0, 0.0, 1.0), slice(4, 8))
    composite.SetNthLayerVolumeID(FIRST, below.GetID())
    outside = slice_pixel(view, OUTSIDE)
    green = pixels(view)[outside]
    assert green[1] > 200
    layer.show(red_cube(views), OPACITY)
    np.testing.assert_array_equal(pixels(view)[outside], green)
    composite.SetNthLayerOpacity(FIRST + 2, 0.3)
    composite.SetNthLayerVolumeID(FIRST + 2, above.GetID())
    layer.hide()
    assert volumes_in(composite) == [below.GetName(), above.GetName()]
    assert [composite.GetNthLayerOpacity(FIRST + n) for n in range(3)] == [1.0, 0.3, 1.0]


@pytest.mark.parametrize("hidden_before", [False, True])
def test_a_view_from_which_the_user_takes_the_volume_is_empty_and_nothing_is_logged(
    views: Views, layer: SliceLayer, hidden_before: bool, capfd: pytest.CaptureFixture[str]
) -> None:
    view = views.slice_view()
    layer.show(red_cube(views), OPACITY)
    pixels(view)
    if hidden_before:
        layer.hide()
    capfd.readouterr()
    view.set_background_volume_id(None)
    assert not pixels(view).any()
    assert "ERROR" not in capfd.readouterr().err
    view.set_background_volume_id(views.volume.GetID())
    assert (redness(view, INSIDE) > 100) is not hidden_before


def test_a_view_that_shows_a_foreground_alone_shows_the_layer_too(views: Views, layer: SliceLayer) -> None:
    view = with_pet(views)
    view.set_background_volume_id(None)
    assert redness(view, INSIDE) == 0
    layer.show(red_cube(views), OPACITY)
    assert redness(view, INSIDE) > 30


@pytest.mark.parametrize("mode", ["Add", "Subtract", "ReverseAlpha"])
def test_where_layers_are_not_blended_in_order_the_view_is_as_without_it(views: Views, layer: SliceLayer, mode: str) -> None:
    view = with_pet(views)
    composite = composite_of(view)
    composite.SetCompositing(getattr(composite, mode))
    before = pixels(view)
    layer.show(red_cube(views), OPACITY)
    np.testing.assert_array_equal(pixels(view), before)
    composite.SetCompositing(composite.Alpha)
    assert redness(view, INSIDE) > 100
    composite.SetCompositing(getattr(composite, mode))
    np.testing.assert_array_equal(pixels(view), before)


def test_a_view_is_modified_once_when_the_layer_comes_and_not_by_updates(views: Views, layer: SliceLayer) -> None:
    composite, volume = composite_of(views.slice_view()), red_cube(views)
    modified: list[str] = []
    composite.AddObserver("ModifiedEvent", lambda caller, event: modified.append(event))
    layer.show(volume, OPACITY)
    assert len(modified) == 1
    layer.show(volume, OPACITY)
    assert len(modified) == 1
    layer.hide()
    assert len(modified) == 2


@pytest.fixture
def another_slicer(slicer_app: Any) -> Views:
    """Started anew, without our module; with the same view."""
    return Views(type(slicer_app)(), SHAPE)


def test_a_saved_scene_shows_what_the_user_chose_and_has_no_trace_of_the_layer(
    views: Views, layer: SliceLayer, tmp_path: Path, another_slicer: Views
) -> None:
    view = with_pet(views)
    slice_pixel(view, INSIDE)
    chosen_picture = pixels(view)
    layer.show(red_cube(views), OPACITY)
    shown = pixels(view)
    assert views.scene.WriteToMRB(str(tmp_path / "saved.mrb"))
    np.testing.assert_array_equal(pixels(view), shown)

    view = another_slicer.slice_view()
    assert another_slicer.scene.ReadFromMRB(str(tmp_path / "saved.mrb"), True)
    composite = composite_of(view)
    for role, name in (("Background", "CT"), ("Foreground", "PET")):
        assert another_slicer.scene.GetNodeByID(getattr(composite, f"Get{role}VolumeID")()).GetName() == name
    assert composite.GetForegroundOpacity() == 0.6
    assert composite.GetLabelVolumeID() is None
    np.testing.assert_array_equal(pixels(view), chosen_picture)
    # Nothing waits for a volume to take the identifier that the layer's had.
    for _ in range(3):
        red_cube(another_slicer)
    np.testing.assert_array_equal(pixels(view), chosen_picture)
    assert composite.GetNumberOfAdditionalLayers() == 0


def test_a_scene_saved_with_a_foreground_that_is_missing_opens_without_errors(
    views: Views, tmp_path: Path, another_slicer: Views, capfd: pytest.CaptureFixture[str]
) -> None:
    # As our module left it when it still showed its volume in the foreground.
    view = views.slice_view()
    view.set_foreground_volume_id(red_cube(views).GetID())
    assert views.scene.WriteToMRB(str(tmp_path / "saved.mrb"))
    view = another_slicer.slice_view()
    capfd.readouterr()
    assert another_slicer.scene.ReadFromMRB(str(tmp_path / "saved.mrb"), True)
    layer = SliceLayer(another_slicer.scene, another_slicer.app_logic)
    layer.show(red_cube(another_slicer), OPACITY)
    assert redness(view, INSIDE) > 100
    assert "ERROR" not in capfd.readouterr().err
    assert composite_of(view).GetForegroundVolumeID() is None


def scene_view(views: Views) -> Any:
    """The scene as it is now, kept to be restored."""
    node = views.scene.AddNode(slicer.vtkMRMLSceneViewNode())
    node.StoreScene()
    return node


def test_a_scene_view_shows_the_layer_only_while_it_is_shown(views: Views, layer: SliceLayer) -> None:
    view, volume = views.slice_view(), red_cube(views)
    without = scene_view(views)
    layer.show(volume, OPACITY)
    with_layer = scene_view(views)
    without.RestoreScene()
    assert redness(view, INSIDE) > 100
    layer.hide()
    with_layer.RestoreScene()
    layer.hide()
    assert redness(view, INSIDE) == 0


def test_the_layer_is_there_again_after_a_file_was_added_to_the_scene(views: Views, layer: SliceLayer, tmp_path: Path) -> None:
    view = views.slice_view()
    assert views.scene.WriteToMRB(str(tmp_path / "saved.mrb"))
    layer.show(red_cube(views), OPACITY)
    assert views.scene.ReadFromMRB(str(tmp_path / "saved.mrb"))
    assert redness(view, INSIDE) > 100
    layer.hide()
    assert composite_of(view).GetNumberOfAdditionalLayers() == 0
