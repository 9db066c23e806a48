"""Regions, outlines and diameters become points of a class: drawn ones, and Slicer's closed curves, boxes and lines."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import vtk

from ViTTransferFunction.Logic.core.classes.diameter_points import points_of_diameter
from ViTTransferFunction.Logic.core.classes.region_points import points_of_outline
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.geometry import SMALL_SCAN_MM, Geometry, transform_points
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image
from ViTTransferFunction.Testing.support.scenes import MOVED, OBLIQUE, add_hanging_point, add_parameter_node, put_under

SQUARE = np.array([[0.0, 5.0, 0.0], [40.0, 5.0, 0.0], [40.0, 5.0, 40.0], [0.0, 5.0, 40.0]])


@pytest.fixture
def session(slicer_app: Any) -> Iterator[SceneSession]:
    """A session with one class and without a volume, which starts no compute process."""
    session = SceneSession(slicer_app.scene, slicer_app.app_logic, add_parameter_node(slicer_app.scene))
    session.annotations.add_class("liver")
    yield session
    session.close()


def points_of(session: SceneSession, positive: bool = True) -> np.ndarray:
    (state,) = session.classes
    return np.array(state.positive if positive else state.negative).reshape(-1, 3)


def test_a_region_is_a_few_points_of_its_inside_and_one_step(session: SceneSession) -> None:
    (state,) = session.classes
    session.regions.add_region(state.id, SQUARE, positive=True)
    session.regions.add_region(state.id, SQUARE + np.array([100.0, 0.0, 0.0]), positive=False)
    for positive, left in ((True, 0.0), (False, 100.0)):
        in_square = points_of(session, positive) - [left, 5.0, 0.0]
        assert len(in_square) == 8
        np.testing.assert_allclose(in_square[:, 1], 0.0, atol=1e-9)
        assert ((in_square[:, [0, 2]] > 1.0) & (in_square[:, [0, 2]] < 39.0)).all()
    session.annotations.undo()
    assert (len(points_of(session)), len(points_of(session, positive=False))) == (8, 0)
    session.annotations.undo()
    assert len(points_of(session)) == 0


def test_of_a_region_that_leaves_the_volume_the_points_within_it_count(slicer_app: Any, session: SceneSession) -> None:
    geometry = Geometry((32, 40, 48), OBLIQUE)
    volume = slicer_app.scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "CT")
    set_image(volume, np.arange(np.prod(geometry.shape), dtype=np.int16).reshape(geometry.shape), OBLIQUE)
    shift = np.eye(4)
    shift[:3, 3] = [70.0, 0.0, -30.0]
    put_under(volume, shift)
    session.set_volume(volume)
    (state,) = session.classes
    # Half of it lies beside the voxels.
    corners = geometry.ijk_to_ras_points(np.array([[-20.0, 5, 16], [20.0, 5, 16], [20.0, 35, 16], [-20.0, 35, 16]]))
    session.regions.add_region(state.id, corners + shift[:3, 3], positive=True)
    points = points_of(session)
    assert 1 <= len(points) < 8
    assert geometry.contains(points - shift[:3, 3]).all()
    with pytest.raises(InputError, match="no points were added"):
        session.regions.add_region(state.id, corners - [500.0, 0.0, 0.0], positive=True)
    assert len(points_of(session)) == len(points)


def test_a_region_that_was_drawn_as_a_straight_line_in_the_volume_is_not_said_to_lie_beside_it(session: SceneSession) -> None:
    (state,) = session.classes
    there_and_back = np.array([[10.0, 5.0, 0.0], [10.0, 5.0, 40.0], [10.0, 5.0, 20.0]])
    for line in (there_and_back, SQUARE[[0, 0, 3, 3]], SQUARE[[0, 2]]):
        with pytest.raises(InputError, match="encloses nothing"):
            session.regions.add_region(state.id, line, positive=True)


def add_curve(scene: Any, name: str, *points: np.ndarray) -> Any:
    curve = scene.AddNewNodeByClass("vtkMRMLMarkupsClosedCurveNode", name)
    for point in points:
        curve.AddControlPointWorld(vtk.vtkVector3d(*point))
    return curve


def test_a_closed_curve_gives_points_of_its_inside_and_stays(slicer_app: Any, session: SceneSession) -> None:
    curve = add_curve(slicer_app.scene, "around", *SQUARE)
    assert [session.regions.markups(positive) for positive in (True, False)] == [{curve.GetID(): "around"}] * 2
    session.regions.add_markup(session.classes[0].id, curve.GetID(), positive=False)
    points = points_of(session, positive=False)
    assert len(points) == 8
    np.testing.assert_allclose(points[:, 1], 5.0, atol=1e-6)
    # The curve bulges beyond its corners, which are 28 mm from the middle.
    assert np.linalg.norm(points - [20.0, 5.0, 20.0], axis=1).max() < 28.0
    assert curve.GetNumberOfControlPoints() == 4


def test_a_closed_curve_on_a_structure_is_its_outline(slicer_app: Any, session: SceneSession) -> None:
    curve = add_curve(slicer_app.scene, "around", *SQUARE)
    session.regions.add_markup(session.classes[0].id, curve.GetID(), positive=True)
    from_middle = [np.linalg.norm(points_of(session, positive) - [20.0, 5.0, 20.0], axis=1) for positive in (True, False)]
    assert from_middle[0].max() < 28.0 < from_middle[1].min()
    session.annotations.undo()
    assert session.classes[0].positive == session.classes[0].negative == ()


def test_an_outline_is_points_within_and_around_it_in_one_step(session: SceneSession) -> None:
    (state,) = session.classes
    session.regions.add_outline(state.id, SQUARE)
    inside, outside = points_of_outline(SQUARE, 1.0)
    np.testing.assert_allclose(points_of(session), inside)
    np.testing.assert_allclose(points_of(session, positive=False), outside)
    session.annotations.undo()
    assert session.classes[0].positive == session.classes[0].negative == ()


def test_of_an_outline_at_the_volumes_border_the_points_within_it_count(slicer_app: Any, session: SceneSession) -> None:
    volume = slicer_app.scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "CT")
    set_image(volume, np.arange(40**3, dtype=np.int16).reshape(40, 40, 40), np.eye(4))
    session.set_volume(volume)
    (state,) = session.classes
    square = np.array([[0.0, 0.0, 20.0], [30.0, 0.0, 20.0], [30.0, 30.0, 20.0], [0.0, 30.0, 20.0]])
    session.regions.add_outline(state.id, square)
    inside, outside = points_of_outline(square, 1.0)
    np.testing.assert_allclose(points_of(session), inside)
    within = ((outside > -0.5) & (outside < 39.5)).all(axis=1)
    assert 0 < within.sum() < len(outside)
    np.testing.assert_allclose(points_of(session, positive=False), outside[within])
    with pytest.raises(InputError, match="outline lies in the volume, so no points were added"):
        session.regions.add_outline(state.id, square + 100.0)


def test_a_box_gives_points_in_all_of_it_wherever_it_was_turned_to(slicer_app: Any, session: SceneSession) -> None:
    box = slicer_app.scene.AddNewNodeByClass("vtkMRMLMarkupsROINode", "box")
    size_mm = np.array([60.0, 30.0, 20.0])
    box.SetSizeWorld(*size_mm)
    box.SetCenterWorld(5.0, 6.0, 7.0)
    turned = np.eye(4)
    turned[:3, :3] = OBLIQUE[:3, :3] / np.linalg.norm(OBLIQUE[:3, :3], axis=0)
    put_under(box, turned)
    assert session.regions.markups(positive=True) == session.regions.markups(positive=False) == {box.GetID(): "box"}
    session.regions.add_markup(session.classes[0].id, box.GetID(), positive=True)
    points = points_of(session)
    in_box = points @ turned[:3, :3] - [5.0, 6.0, 7.0]
    assert len(points) == 8
    assert (np.abs(in_box) < 0.5 * size_mm - 2.0).all()
    assert (np.ptp(in_box, axis=0) > 0.4 * size_mm).all()


@pytest.mark.parametrize("matrix", [np.diag([2.0, 2.0, 2.0, 1.0]), np.diag([0.5, 3.0, -1.0, 1.0])])
def test_points_in_a_box_stay_within_it_whatever_transform_makes_it_larger(
    slicer_app: Any, session: SceneSession, matrix: np.ndarray
) -> None:
    box = slicer_app.scene.AddNewNodeByClass("vtkMRMLMarkupsROINode", "box")
    box.SetCenter(5.0, 0.0, 0.0)
    box.SetSize(40.0, 30.0, 20.0)
    put_under(box, matrix)
    session.regions.add_markup(session.classes[0].id, box.GetID(), positive=True)
    in_box = transform_points(np.linalg.inv(matrix), points_of(session)) - [5.0, 0.0, 0.0]
    assert len(in_box) == 8
    assert (np.abs(in_box) < [20.0, 15.0, 10.0]).all()


def test_only_markups_that_enclose_something_are_offered(slicer_app: Any, session: SceneSession) -> None:
    add_curve(slicer_app.scene, "two points", *SQUARE[:2])
    slicer_app.scene.AddNewNodeByClass("vtkMRMLMarkupsROINode", "not placed")
    slicer_app.scene.AddNewNodeByClass("vtkMRMLMarkupsCurveNode", "open")
    hidden = add_curve(slicer_app.scene, "of another module", *SQUARE)
    hidden.SetHideFromEditors(True)
    assert session.regions.markups(positive=True) == session.regions.markups(positive=False) == {}


ENDS = np.array([[10.0, 5.0, -4.0], [50.0, 35.0, -4.0]])
"""Where a structure begins and ends."""
INSIDE, OUTSIDE = points_of_diameter(ENDS, 1.0)


def test_a_diameter_is_points_along_it_and_beyond_its_ends_in_one_step(session: SceneSession) -> None:
    (state,) = session.classes
    other = session.annotations.add_class("lung")
    before = session.classes
    seen: list[Any] = []
    session.add_observer(lambda: seen.append(session.classes[0]))
    session.regions.add_diameter(state.id, ENDS)
    np.testing.assert_allclose(session.classes[0].positive, INSIDE)
    np.testing.assert_allclose(session.classes[0].negative, OUTSIDE)
    assert session.classes[1] == other
    assert all(each == session.classes[0] for each in seen)
    session.annotations.undo()
    assert session.classes == before


def test_points_of_a_diameter_are_removed_one_by_one_before_what_was_there(session: SceneSession) -> None:
    (state,) = session.classes
    session.annotations.add_points(state.id, ENDS[:1] + 100.0, positive=False)
    before = session.classes
    session.regions.add_diameter(state.id, ENDS)
    for _ in (*INSIDE, *OUTSIDE):
        assert session.classes != before
        session.annotations.remove_last_point(state.id)
    assert session.classes == before


def test_a_diameter_after_a_point_and_a_point_after_it_are_steps_of_their_own(session: SceneSession) -> None:
    (state,) = session.classes
    session.annotations.add_points(state.id, ENDS[:1], positive=True)
    session.regions.add_diameter(state.id, ENDS)
    session.annotations.add_points(state.id, ENDS[1:], positive=True)
    counts = []
    for _ in range(3):
        session.annotations.undo()
        counts.append(len(points_of(session)))
    assert counts == [1 + len(INSIDE), 1, 0]


def test_a_hidden_class_is_shown_again_by_a_diameter(session: SceneSession) -> None:
    (state,) = session.classes
    session.annotations.set_class(state.id, visible=False)
    session.regions.add_diameter(state.id, ENDS)
    assert session.classes[0].visible


def test_of_a_diameter_that_leaves_the_volume_the_points_within_it_count(slicer_app: Any, session: SceneSession) -> None:
    volume = slicer_app.scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "CT")
    set_image(volume, np.arange(40**3, dtype=np.int16).reshape(40, 40, 40), np.eye(4))
    session.set_volume(volume)
    (state,) = session.classes
    in_all, out_of_all = (np.array([[20.0, 20.0, 20.0], [x, 20.0, 20.0]]) for x in (39.0, 60.0))
    inside, outside = points_of_diameter(in_all, 1.0)
    session.regions.add_diameter(state.id, in_all)
    np.testing.assert_allclose(points_of(session), inside)
    np.testing.assert_allclose(points_of(session, positive=False), outside[:1])
    session.annotations.undo()
    inside, outside = points_of_diameter(out_of_all, 1.0)
    session.regions.add_diameter(state.id, out_of_all)
    np.testing.assert_allclose(points_of(session), inside[inside[:, 0] < 39.5])
    assert 0 < len(points_of(session)) < len(inside)
    np.testing.assert_allclose(points_of(session, positive=False), outside[:1])
    session.annotations.undo()
    before = session.classes
    with pytest.raises(InputError, match="diameter lies in the volume, so no points were added"):
        session.regions.add_diameter(state.id, np.array([[60.0, 20.0, 20.0], [90.0, 20.0, 20.0]]))
    with pytest.raises(InputError, match="mm long"):
        session.regions.add_diameter(state.id, np.array([[20.0, 20.0, 20.0], [20.1, 20.0, 20.0]]))
    assert session.classes == before


def test_a_line_gives_the_points_of_a_diameter_where_the_scene_has_it_and_stays(slicer_app: Any, session: SceneSession) -> None:
    line = slicer_app.scene.AddNewNodeByClass("vtkMRMLMarkupsLineNode", "longest")
    for end in ENDS:
        line.AddControlPoint(vtk.vtkVector3d(*end))
    put_under(line, MOVED)
    assert session.regions.markups(positive=True) == {line.GetID(): "longest"}
    assert session.regions.markups(positive=False) == {}
    session.regions.add_markup(session.classes[0].id, line.GetID(), positive=True)
    ends = ENDS @ MOVED[:3, :3].T + MOVED[:3, 3]
    inside, outside = points_of_diameter(ends, 1.0)
    np.testing.assert_allclose(points_of(session), inside)
    np.testing.assert_allclose(points_of(session, positive=False), outside)
    assert line.GetNumberOfControlPoints() == 2


def test_a_line_whose_end_still_hangs_on_the_mouse_is_not_offered(slicer_app: Any, session: SceneSession) -> None:
    line = slicer_app.scene.AddNewNodeByClass("vtkMRMLMarkupsLineNode", "in the making")
    line.AddControlPointWorld(vtk.vtkVector3d(*ENDS[0]))
    assert session.regions.markups(positive=True) == {}
    add_hanging_point(slicer_app.scene, line)
    assert line.GetNumberOfControlPoints() == 2
    assert session.regions.markups(positive=True) == {}
    line.SetNthControlPointPositionWorld(1, *ENDS[1])
    assert session.regions.markups(positive=True) == {line.GetID(): "in the making"}
    line.UnsetNthControlPointPosition(0)
    assert session.regions.markups(positive=True) == {}


def test_in_a_small_specimen_what_is_drawn_is_the_same_points_as_in_a_body(slicer_app: Any, session: SceneSession) -> None:
    scene, (state,) = slicer_app.scene, session.classes
    volume = scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "CT")
    # Lopsided, so that rounding does not decide which of several places is first.
    outline = np.array([[40.0, 45.0, 50.0], [56.0, 45.0, 50.0], [58.0, 59.0, 50.0], [41.0, 58.0, 50.0]])
    found: list[list[np.ndarray]] = []
    # The smallest scan in which lengths are those of bodies, and one that is 32 times smaller.
    for scale in (SMALL_SCAN_MM / 96.0, SMALL_SCAN_MM / 96.0 / 32.0):
        geometry = Geometry((22, 23, 24), np.diag([*[4.0 * scale] * 3, 1.0]))
        voxels = np.arange(np.prod(geometry.shape), dtype=np.int16).reshape(geometry.shape)
        set_image(volume, voxels, geometry.ijk_to_ras)
        session.set_volume(None)
        session.set_volume(volume)
        box = scene.AddNewNodeByClass("vtkMRMLMarkupsROINode", "within")
        box.SetCenterWorld(scale * np.array([60.0, 62.0, 64.0]))
        box.SetSizeWorld(scale * np.array([20.0, 23.0, 27.0]))
        markups = add_curve(scene, "around", *(scale * outline)), box
        steps = [
            lambda: session.regions.add_region(state.id, scale * outline, positive=True),  # noqa: B023
            lambda: session.regions.add_outline(state.id, scale * outline),  # noqa: B023
            lambda: session.regions.add_diameter(state.id, scale * outline[:2] * [1.0, 1.1, 1.0]),  # noqa: B023
            *(lambda node=node: session.regions.add_markup(state.id, node.GetID(), positive=True) for node in markups),
        ]
        points = []
        for step in steps:
            step()
            points.append(np.concatenate([points_of(session), points_of(session, positive=False)]) / scale)
            session.annotations.undo()
        found.append(points)
    for body, specimen in zip(*found, strict=True):
        assert len(body) > 3
        np.testing.assert_allclose(specimen, body, atol=1e-4)


def test_a_scan_is_as_small_as_it_lies_in_the_scene(slicer_app: Any, session: SceneSession) -> None:
    assert session.body_scale == 1.0
    geometry = Geometry((22, 23, 24), np.diag([4.0, 4.0, 4.0, 1.0]))
    volume = slicer_app.scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "CT")
    set_image(volume, np.arange(np.prod(geometry.shape), dtype=np.int16).reshape(geometry.shape), geometry.ijk_to_ras)
    session.set_volume(volume)
    assert session.body_scale == 1.0
    put_under(volume, np.diag([0.1, 0.1, 0.1, 1.0]))
    assert session.body_scale == pytest.approx(0.1 * 96.0 / SMALL_SCAN_MM)
