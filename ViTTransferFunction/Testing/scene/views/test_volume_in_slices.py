"""Which scan the slice views show when another one is chosen to be segmented."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.scene.mrml.nodes import nodes_of_class
from ViTTransferFunction.Logic.scene.views.slice_layer import COMPOSITE_CLASS
from ViTTransferFunction.Logic.scene.views.volume_in_slices import fit_in_slices, is_in_slices, show_in_slices
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image
from ViTTransferFunction.Testing.support.views import BACKGROUND_GRAY, Views, pixels

WHITE = 255
FAR_RAS = (500.0, 500.0, 500.0)


@pytest.fixture
def views(slicer_app: Any) -> Views:
    """A scan, which views show."""
    return Views(slicer_app)


@pytest.fixture
def in_layout(views: Views) -> list[Any]:
    """Two slice views of the layout."""
    made = [views.slice_view(orientation) for orientation in ("Axial", "Coronal")]
    for view in made:
        view.get_view_node().SetMappedInLayout(True)
    return made


def where(view: Any) -> tuple[float, ...]:
    """Where a view is in the patient, and how much of it is seen."""
    node = view.get_view_node()
    return (*(node.GetSliceToRAS().GetElement(axis, 3) for axis in range(3)), *node.GetFieldOfView())


def add_scan(views: Views, origin_ras: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Any:
    """Another scan, white everywhere."""
    node = views.scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "MR")
    ijk_to_ras = np.eye(4)
    ijk_to_ras[:3, 3] = origin_ras
    set_image(node, np.full((32, 32, 32), WHITE, dtype=np.int16), ijk_to_ras)
    node.CreateDefaultDisplayNodes()
    node.GetDisplayNode().SetAutoWindowLevel(False)
    node.GetDisplayNode().SetWindowLevelMinMax(0.0, 255.0)
    return node


def test_a_scan_that_no_view_shows_is_shown_in_all_where_they_are(views: Views, in_layout: list[Any]) -> None:
    scan, places = add_scan(views), [where(view) for view in in_layout]
    for composite in nodes_of_class(views.scene, COMPOSITE_CLASS):
        composite.SetForegroundVolumeID(views.volume.GetID())
        composite.SetForegroundOpacity(1.0)
    assert not is_in_slices(views.scene, views.app_logic, scan)
    show_in_slices(views.scene, views.app_logic, scan)
    assert is_in_slices(views.scene, views.app_logic, scan)
    for view in in_layout:
        assert pixels(view).max() == WHITE
        assert not (pixels(view) == BACKGROUND_GRAY).all(axis=-1).any()
    assert [where(view) for view in in_layout] == places


def test_views_go_to_a_scan_that_is_elsewhere(views: Views, in_layout: list[Any]) -> None:
    scan = add_scan(views, FAR_RAS)
    show_in_slices(views.scene, views.app_logic, scan)
    for view in in_layout:
        assert pixels(view).max() == WHITE


@pytest.mark.parametrize("layer", ["Background", "Foreground"])
def test_where_a_view_shows_it_all_stay_as_they_are(views: Views, in_layout: list[Any], layer: str) -> None:
    scan = add_scan(views)
    one, other = nodes_of_class(views.scene, COMPOSITE_CLASS)
    assert len(in_layout) == 2
    getattr(one, f"Set{layer}VolumeID")(scan.GetID())
    one.SetForegroundOpacity(0.5)
    show_in_slices(views.scene, views.app_logic, scan)
    assert other.GetBackgroundVolumeID() == views.volume.GetID()
    assert getattr(one, f"Get{layer}VolumeID")() == scan.GetID()


def test_a_foreground_that_cannot_be_seen_does_not_count(views: Views, in_layout: list[Any]) -> None:
    scan = add_scan(views)
    for composite in nodes_of_class(views.scene, COMPOSITE_CLASS):
        composite.SetForegroundVolumeID(scan.GetID())
        composite.SetForegroundOpacity(0.0)
    assert not is_in_slices(views.scene, views.app_logic, scan)
    assert len(in_layout) == 2


def test_views_of_other_layouts_do_not_count_and_show_it_as_well(views: Views, in_layout: list[Any]) -> None:
    hidden, scan = views.slice_view("Sagittal"), add_scan(views)
    hidden.get_view_node().SetMappedInLayout(False)
    *_, of_hidden = nodes_of_class(views.scene, COMPOSITE_CLASS)
    of_hidden.SetForegroundVolumeID(scan.GetID())
    assert not is_in_slices(views.scene, views.app_logic, scan)
    show_in_slices(views.scene, views.app_logic, scan)
    shown = [composite.GetBackgroundVolumeID() for composite in nodes_of_class(views.scene, COMPOSITE_CLASS)]
    assert shown == [scan.GetID() for _ in (*in_layout, hidden)]


def test_a_view_that_does_not_show_what_is_loaded_stays_as_it_is(views: Views, in_layout: list[Any]) -> None:
    scan, (kept, other) = add_scan(views), nodes_of_class(views.scene, COMPOSITE_CLASS)
    kept.SetDoPropagateVolumeSelection(False)
    show_in_slices(views.scene, views.app_logic, scan)
    assert [composite.GetBackgroundVolumeID() for composite in (kept, other)] == [views.volume.GetID(), scan.GetID()]
    assert len(in_layout) == 2


def test_without_slice_views_there_is_nothing_to_do(views: Views) -> None:
    scan = add_scan(views)
    show_in_slices(views.scene, views.app_logic, scan)
    assert is_in_slices(views.scene, views.app_logic, scan)


@pytest.mark.parametrize(("beside_mm", "is_there"), [(1.0, True), (500.0, False)])
def test_a_scan_that_is_small_in_views_is_shown_as_large_as_can_be_on_the_slices_that_they_are_on_if_it_is_there(
    views: Views, in_layout: list[Any], beside_mm: float, is_there: bool
) -> None:
    for view in in_layout:
        views.app_logic.GetSliceLogicByLayoutName(view.get_view_node().GetLayoutName()).FitSliceToBackground()
    fitted = [view.get_view_node().GetFieldOfView()[0] for view in in_layout]
    offsets = []
    for view in in_layout:
        node = view.get_view_node()
        offset = node.GetSliceOffset()
        node.SetSliceOffset(offset + beside_mm)
        offsets.append(offset + beside_mm if is_there else offset)
        node.SetFieldOfView(*(3.0 * size for size in node.GetFieldOfView()[:2]), node.GetFieldOfView()[2])
    fit_in_slices(views.scene, views.app_logic, views.volume)
    assert [view.get_view_node().GetFieldOfView()[0] for view in in_layout] == pytest.approx(fitted)
    assert [view.get_view_node().GetSliceOffset() for view in in_layout] == pytest.approx(offsets)


@pytest.mark.parametrize(("zoom", "fused"), [((0.5, 0.5), False), ((3.0, 0.9), False), ((3.0, 3.0), True)])
def test_a_view_that_is_near_or_shows_another_scan_as_well_stays_as_it_is(
    views: Views, in_layout: list[Any], zoom: tuple[float, float], fused: bool
) -> None:
    other = add_scan(views)
    for view, composite in zip(in_layout, nodes_of_class(views.scene, COMPOSITE_CLASS), strict=True):
        node = view.get_view_node()
        views.app_logic.GetSliceLogicByLayoutName(node.GetLayoutName()).FitSliceToBackground()
        width, height, depth = node.GetFieldOfView()
        node.SetFieldOfView(zoom[0] * width, zoom[1] * height, depth)
        composite.SetForegroundVolumeID(other.GetID() if fused else None)
    places = [where(view) for view in in_layout]
    fit_in_slices(views.scene, views.app_logic, views.volume)
    assert [where(view) for view in in_layout] == places
