"""A point placed on a surface in a 3D view is moved inside; one placed in a slice view stays where it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.class_map import ClassMap
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.scene.annotation.surface_points import (
    REACH_MM,
    REACH_VOXELS,
    moved_inside,
    placed_in_3d_view,
)
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.scenes import annotate, bend, put_under
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras
from ViTTransferFunction.Testing.support.views import Views, ball, look_from, pixel_3d, pixels

GRID = Geometry((30, 30, 40), np.array([[0.0, 1.5, 0, 30], [-1.0, 0, 0.0, -10], [0, 0, 2.0, 5], [0, 0, 0, 1]]))
MIDDLE_KJI, RADIUS_VOXELS = (15.0, 15.0, 12.0), 8.0
MIDDLE_RAS = GRID.ijk_to_ras_points(np.array([MIDDLE_KJI[::-1]]))[0]
A_BALL = ClassMap(ball(GRID.shape, MIDDLE_KJI, RADIUS_VOXELS), GRID, 0.5)


def beside_middle(voxels: float) -> np.ndarray:
    """A point so many voxels along J from the middle of the ball."""
    return GRID.ijk_to_ras_points(np.array([MIDDLE_KJI[::-1]]) + np.array([0.0, voxels, 0.0]))[0]


def from_middle_mm(point_ras: np.ndarray) -> float:
    return float(np.linalg.norm(point_ras - MIDDLE_RAS))


@pytest.mark.parametrize("voxels", [RADIUS_VOXELS - 0.3, RADIUS_VOXELS + 0.3])
@pytest.mark.parametrize("dtype", [np.float32, np.uint8])
def test_a_point_on_a_surface_goes_inside_by_no_more_than_its_reach(voxels: float, dtype: type) -> None:
    array = A_BALL.array if dtype is np.float32 else np.rint(A_BALL.array * 255).astype(np.uint8)
    placed = beside_middle(voxels)
    moved = moved_inside(placed, [ClassMap(array, GRID, 0.5)], np.eye(4), 1.0)
    assert np.linalg.norm(moved - placed) <= REACH_MM
    assert from_middle_mm(moved) < from_middle_mm(placed) - 4.0


def test_in_a_fine_scan_a_point_goes_no_further_than_a_dozen_voxels() -> None:
    fine = Geometry((64, 64, 64), np.diag([0.1, 0.1, 0.1, 1.0]))
    placed = np.array([5.9, 3.15, 3.15])
    moved = moved_inside(placed, [ClassMap(ball(fine.shape, (31.5, 31.5, 31.5), 28.0), fine, 0.5)], np.eye(4), 1.0)
    assert 0.8 < np.linalg.norm(moved - placed) <= REACH_VOXELS * 0.1 + 1e-6


def test_in_a_small_specimen_a_point_goes_as_much_less_far() -> None:
    placed = beside_middle(RADIUS_VOXELS - 0.3)
    moved = moved_inside(placed, [A_BALL], np.eye(4), 0.5)
    assert 1.0 < np.linalg.norm(moved - placed) <= 0.5 * REACH_MM


def test_a_point_on_a_vessel_goes_to_its_middle_and_not_beyond() -> None:
    kji = np.indices(GRID.shape, dtype=np.float32)
    # A tube of 4.5 mm along I, whose axis is at K = 15 and J = 15.
    tube = (np.hypot((kji[0] - 15.0) * 2.0, (kji[1] - 15.0) * 1.5) <= 2.3).astype(np.float32)
    moved = moved_inside(GRID.ijk_to_ras_points(np.array([[20.0, 16.4, 15.0]]))[0], [ClassMap(tube, GRID, 0.5)], np.eye(4), 1.0)
    np.testing.assert_allclose(GRID.ras_to_ijk(moved[None])[0, 1:], [15.0, 15.0], atol=1e-6)


@pytest.mark.parametrize("voxels", [0.0, RADIUS_VOXELS - 3.0, RADIUS_VOXELS + 8.0, 500.0])
def test_a_point_inside_and_one_far_from_any_surface_stay(voxels: float) -> None:
    placed = beside_middle(voxels)
    assert moved_inside(placed, [A_BALL], np.eye(4), 1.0) is placed


def test_of_two_surfaces_the_nearer_one_has_the_point() -> None:
    other = ClassMap(ball(GRID.shape, (15.0, 15.0, 28.0), RADIUS_VOXELS - 1.0), GRID, 0.5)
    placed = GRID.ijk_to_ras_points(np.array([[12.0 + RADIUS_VOXELS - 0.2, 15.0, 15.0]]))[0]
    for maps in ([A_BALL, other], [other, A_BALL]):
        assert from_middle_mm(moved_inside(placed, maps, np.eye(4), 1.0)) < from_middle_mm(placed) - 4.0


def test_a_point_goes_straight_into_a_thin_structure_at_the_edge_of_the_scan_whatever_is_elsewhere() -> None:
    array = np.zeros(GRID.shape, dtype=np.float32)
    array[:, 14:17] = 1.0
    thin, elsewhere = ClassMap(array, GRID, 0.5), ClassMap(ball(GRID.shape, (15.0, 15.0, 34.0), 4.0), GRID, 0.5)
    placed = GRID.ijk_to_ras_points(np.array([[2.0, 13.4, 15.0]]))[0]
    moved = moved_inside(placed, [elsewhere, thin], np.eye(4), 1.0)
    np.testing.assert_allclose(GRID.ras_to_ijk(moved[None]), [[2.0, 15.0, 15.0]])


def start_placing(slicer_app: Any, session: SceneSession, id_: str, positive: bool) -> None:
    """Take the tool into the hand, as the panel does."""
    selection, interaction = slicer_app.app_logic.GetSelectionNode(), slicer_app.app_logic.GetInteractionNode()
    selection.SetReferenceActivePlaceNodeClassName("vtkMRMLMarkupsFiducialNode")
    selection.SetActivePlaceNodeID(session.annotations.points_node(id_, positive).GetID())
    interaction.SetPlaceModePersistence(1)
    interaction.SetCurrentInteractionMode(interaction.Place)


def click(view: Any, row: int, column: int) -> None:
    interactor = view.interactor()
    for event in ("EnterEvent", "MouseMoveEvent", "LeftButtonPressEvent", "LeftButtonReleaseEvent"):
        interactor.SetEventInformation(column, row, 0, 0)
        interactor.InvokeEvent(event)


@pytest.mark.slow
def test_a_click_on_a_sphere_in_3d_is_a_point_inside_it_also_where_the_volume_was_moved(
    slicer_app: Any, session: SceneSession, spheres: Spheres
) -> None:
    first, *_ = annotate(session, spheres)
    shift = np.eye(4)
    shift[:3, 3] = [30.0, -20.0, 10.0]
    put_under(session.parameters.volume, shift)
    for id_, label in zip([state.id for state in session.classes], (1, 2, 3), strict=True):
        node = session.annotations.points_node(id_, positive=True)
        node.SetNthControlPointPositionWorld(0, *(centre_ras(spheres, label)[0] + shift[:3, 3]))
    session.wait()
    centre = centre_ras(spheres, 2)[0] + shift[:3, 3]
    view = Views(slicer_app).view_3d()
    look_from(view, centre, 150.0)
    pixels(view)
    start_placing(slicer_app, session, first, positive=False)
    click(view, *pixel_3d(view, centre))
    (point,) = session.classes[0].negative
    # The sphere has a radius of 16 mm.
    assert 16.0 - 2.5 * REACH_MM < np.linalg.norm(np.array(point) - centre) < 16.0 - 0.5 * REACH_MM
    session.annotations.undo()
    assert session.classes[0].negative == ()


def test_a_point_is_placed_in_a_3d_view_while_points_are_placed_and_the_mouse_is_over_something_there(
    slicer_app: Any, session_without_volume: SceneSession
) -> None:
    crosshair = slicer_app.scene.GetSingletonNode("default", "vtkMRMLCrosshairNode")
    interaction = slicer_app.app_logic.GetInteractionNode()
    crosshair.SetCursorPositionRAS(MIDDLE_RAS)
    assert not placed_in_3d_view(slicer_app.scene, slicer_app.app_logic)
    id_ = session_without_volume.annotations.add_class().id
    start_placing(slicer_app, session_without_volume, id_, positive=True)
    assert placed_in_3d_view(slicer_app.scene, slicer_app.app_logic)
    crosshair.SetCursorPositionInvalid()
    assert not placed_in_3d_view(slicer_app.scene, slicer_app.app_logic)
    crosshair.SetCursorPositionRAS(MIDDLE_RAS)
    interaction.SetCurrentInteractionMode(interaction.ViewTransform)
    assert not placed_in_3d_view(slicer_app.scene, slicer_app.app_logic)


@pytest.mark.parametrize("nothing", ["no volume", "a bent volume"])
def test_where_a_3d_view_shows_no_structures_a_point_stays_where_it_was_placed(
    slicer_app: Any, session: SceneSession, nothing: str
) -> None:
    start_placing(slicer_app, session, session.annotations.add_class().id, positive=True)
    slicer_app.scene.GetSingletonNode("default", "vtkMRMLCrosshairNode").SetCursorPositionRAS(MIDDLE_RAS)
    assert placed_in_3d_view(slicer_app.scene, slicer_app.app_logic)
    if nothing == "no volume":
        session.parameters.set_reference("volume", None)
    else:
        bend(session.parameters.volume)
    assert session.shown.settled(MIDDLE_RAS) is MIDDLE_RAS


@pytest.mark.slow
def test_a_click_on_the_border_in_a_slice_stays_where_it_is(slicer_app: Any, session: SceneSession, spheres: Spheres) -> None:
    first, *_ = annotate(session, spheres)
    view = Views(slicer_app).slice_view("Axial")
    border = centre_ras(spheres, 2)[0] + [16.0, 0.0, 0.0]
    view.get_view_node().JumpSliceByCentering(*border)
    start_placing(slicer_app, session, first, positive=False)
    click(view, 80, 80)
    (point,) = session.classes[0].negative
    assert np.linalg.norm(np.array(point) - border) < 2.0
    xyz = np.array(view.get_view_node().GetXYToRAS().MultiplyPoint((80.0, 80.0, 0.0, 1.0))[:3])
    np.testing.assert_allclose(point, xyz, atol=1e-6)
