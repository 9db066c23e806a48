"""A lasso, a box or a line drawn in a slice view becomes corners in the patient, and is seen while it is drawn."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np
import pytest
import vtk

from ViTTransferFunction.Logic.scene.tools.drawing_tool import DrawingTool, Shape
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image
from ViTTransferFunction.Testing.support.views import Views, pixels

COLOR = (0.0, 1.0, 0.0)


class Stage:
    """An axial slice at S = 20 mm, and what the tool says about it."""

    def __init__(self, slicer_app: Any) -> None:
        self.views = Views(slicer_app, (40, 40, 40))
        self.view = self.views.slice_view("Axial")
        self.node = self.view.get_view_node()
        self.node.JumpSliceByOffsetting(0.0, 0.0, 20.0)
        self.interactor = self.view.interactor()
        self.outlines: list[np.ndarray] = []
        self.clicks = 0
        self.draws = 0

    def tool(self, shape: Shape) -> DrawingTool:
        tool = DrawingTool(self.interactor, self.node, self.draw, shape, COLOR, self.outlines.append, self.click)
        tool.activate()
        return tool

    def draw(self) -> None:
        self.draws += 1

    def click(self) -> None:
        self.clicks += 1

    def mouse(self, event: str, x: int, y: int) -> None:
        self.interactor.SetEventInformation(x, y, 0, 0)
        self.interactor.InvokeEvent(event)

    def press_and_move(self, *path: tuple[int, int]) -> None:
        self.mouse("LeftButtonPressEvent", *path[0])
        for position in path[1:]:
            self.mouse("MouseMoveEvent", *position)

    def drag(self, *path: tuple[int, int]) -> None:
        self.press_and_move(*path)
        self.mouse("LeftButtonReleaseEvent", *path[-1])

    def on_screen(self, outline_ras: np.ndarray) -> np.ndarray:
        """Where the slice view shows points (N, 3), in pixels (N, 2)."""
        to_xy = vtk.vtkMatrix4x4()
        vtk.vtkMatrix4x4.Invert(self.node.GetXYToRAS(), to_xy)
        return np.array([to_xy.MultiplyPoint((*point, 1.0))[:2] for point in outline_ras])

    def mm_per_pixel(self) -> float:
        return float(self.node.GetXYToRAS().GetElement(1, 1))

    def text(self) -> str | None:
        """What is written in the view, while anything is."""
        written = self._text_actor()
        return written.GetInput() if written is not None else None

    def box_of_text(self) -> tuple[int, int, int, int]:
        """Where it is written: first and last column and row."""
        written, box = self._text_actor(), [0, 0, 0, 0]
        written.GetBoundingBox(self.view.renderer(), box)
        (x, y), (left, right, bottom, top) = written.GetPosition(), box
        return round(x + left), round(x + right), round(y + bottom), round(y + top)

    def _text_actor(self) -> Any:
        actors = self.view.renderer().GetActors2D()
        return next((actor for actor in actors if isinstance(actor, vtk.vtkTextActor) and actor.GetVisibility()), None)

    def drawn(self) -> np.ndarray:
        """Which pixels have the outline's colour."""
        picture = pixels(self.view).astype(int)
        return picture[..., 1] - picture[..., 0] > 100


@pytest.fixture
def stage(slicer_app: Any) -> Stage:
    return Stage(slicer_app)


def test_what_is_dragged_with_shift_pans_the_view(slicer_app: Any) -> None:
    stage = Stage(slicer_app)
    stage.tool("box")
    before = stage.node.GetXYZOrigin()
    stage.interactor.SetShiftKey(1)
    for event, x in (("LeftButtonPressEvent", 40), ("MouseMoveEvent", 90), ("LeftButtonReleaseEvent", 90)):
        stage.interactor.SetEventPosition(x, 60)
        stage.interactor.InvokeEvent(event)
    assert stage.outlines == []
    assert stage.node.GetXYZOrigin() != before


@pytest.mark.parametrize("event", ["MouseWheelForwardEvent", "MouseWheelBackwardEvent"])
def test_the_wheel_leads_to_another_slice_but_not_while_something_is_drawn_in_one(stage: Stage, event: str) -> None:
    stage.tool("lasso")
    stage.press_and_move((40, 60), (90, 60), (90, 100))
    stage.mouse(event, 90, 100)
    stage.mouse("LeftButtonReleaseEvent", 90, 100)
    assert stage.node.GetSliceOffset() == pytest.approx(20.0)
    np.testing.assert_allclose(stage.outlines[0][:, 2], 20.0)
    stage.mouse(event, 90, 100)
    assert stage.node.GetSliceOffset() != pytest.approx(20.0)


def test_the_second_press_of_a_double_click_begins_a_region_as_well(slicer_app: Any) -> None:
    stage = Stage(slicer_app)
    stage.tool("box")
    stage.mouse("LeftButtonDoubleClickEvent", 40, 60)
    stage.mouse("MouseMoveEvent", 90, 100)
    stage.mouse("LeftButtonReleaseEvent", 90, 100)
    assert len(stage.outlines) == 1


def test_a_lasso_is_the_way_of_the_mouse_in_the_plane_of_the_slice(stage: Stage) -> None:
    stage.tool("lasso")
    way = [(40, 40), (90, 45), (80, 90), (50, 80)]
    stage.drag(*way)
    (outline,) = stage.outlines
    np.testing.assert_allclose(stage.on_screen(outline), way, atol=1e-6)
    np.testing.assert_allclose(outline[:, 2], 20.0)


def test_a_box_has_its_corners_where_the_button_was_pressed_and_released(stage: Stage) -> None:
    stage.tool("box")
    stage.drag((90, 40), (20, 20), (31, 99), (30, 100))
    (outline,) = stage.outlines
    corners = stage.on_screen(outline)
    np.testing.assert_allclose(corners.min(axis=0), [30, 40], atol=1e-6)
    np.testing.assert_allclose(corners.max(axis=0), [90, 100], atol=1e-6)
    assert len(corners) == 4


def test_a_line_has_its_ends_where_the_button_was_pressed_and_released(stage: Stage) -> None:
    stage.tool("line")
    stage.drag((90, 40), (20, 20), (31, 99), (30, 100))
    (ends,) = stage.outlines
    np.testing.assert_allclose(stage.on_screen(ends), [(90, 40), (30, 100)], atol=1e-6)
    np.testing.assert_allclose(ends[:, 2], 20.0)


@pytest.mark.parametrize("shape", get_args(Shape))
def test_a_click_draws_nothing_and_is_told_of(stage: Stage, shape: Shape) -> None:
    stage.tool(shape)
    stage.drag((40, 40))
    stage.drag((40, 40), (42, 41))
    assert stage.outlines == []
    assert stage.clicks == 2
    stage.drag((40, 40), (90, 45), (80, 90))
    assert len(stage.outlines) == 1
    assert stage.clicks == 2


def test_the_outline_is_seen_while_it_is_drawn_and_not_after(stage: Stage) -> None:
    tool = stage.tool("box")
    assert not stage.drawn().any()
    stage.press_and_move((40, 50), (60, 60), (100, 90))
    drawn = stage.drawn()
    rows, columns = np.nonzero(drawn)
    assert [columns.min(), columns.max(), rows.min(), rows.max()] == pytest.approx([40, 100, 50, 90], abs=2)
    assert drawn[50:54, 70].any()
    assert not drawn[70, 70]
    assert stage.draws == 2
    stage.mouse("LeftButtonReleaseEvent", 100, 90)
    assert stage.draws == 3
    assert not stage.drawn().any()
    stage.press_and_move((40, 50), (100, 90))
    tool.deactivate()
    assert not stage.drawn().any()
    stage.mouse("LeftButtonReleaseEvent", 100, 90)
    assert len(stage.outlines) == 1


def test_what_is_drawn_is_given_up_where_the_button_was_released_elsewhere_as_in_a_message_that_came_up(stage: Stage) -> None:
    """With a button held, a mouse enters no view."""
    stage.tool("lasso")
    stage.press_and_move((40, 50), (60, 60), (100, 90))
    stage.interactor.InvokeEvent("EnterEvent")
    assert not stage.drawn().any()
    stage.mouse("MouseMoveEvent", 20, 90)
    assert not stage.drawn().any()
    assert (stage.outlines, stage.clicks) == ([], 0)


def test_a_line_is_seen_with_its_length_until_the_tool_is_given_up(stage: Stage) -> None:
    tool = stage.tool("line")
    before = pixels(stage.view)
    stage.press_and_move((40, 50), (60, 60), (100, 90))
    drawn = stage.drawn()
    rows, columns = np.nonzero(drawn)
    assert [columns.min(), columns.max(), rows.min(), rows.max()] == pytest.approx([40, 100, 50, 90], abs=2)
    assert drawn[68:73, 70].any()
    assert not drawn[50:54, 70].any()
    length_mm = np.hypot(60, 40) * stage.mm_per_pixel()
    assert stage.text() == f"{length_mm:.1f} mm"
    tool.deactivate()
    assert (pixels(stage.view) == before).all()
    stage.mouse("LeftButtonReleaseEvent", 100, 90)
    assert stage.outlines == []
    stage.tool("box")
    stage.press_and_move((40, 50), (100, 90))
    assert stage.text() is None


@pytest.mark.parametrize("gray", [0, 255])
@pytest.mark.parametrize("end", [(120, 60), (60, 120), (30, 60), (60, 30), (158, 158), (2, 158), (2, 2), (158, 2)])
def test_the_length_of_a_line_can_be_read_on_black_and_white_wherever_it_ends(
    stage: Stage, gray: int, end: tuple[int, int]
) -> None:
    set_image(stage.views.volume, np.full((40, 40, 40), gray, np.int16), np.eye(4))
    stage.tool("line")
    stage.press_and_move((80, 80), end)
    picture = pixels(stage.view)
    left, right, bottom, top = stage.box_of_text()
    # All of it is seen, beside the end.
    assert left >= 0
    assert bottom >= 0
    assert max(right, top) <= 160
    beside = max(left - end[0], end[0] - right, 0), max(bottom - end[1], end[1] - top, 0)
    assert np.hypot(*beside) < 30
    written = picture[bottom : top + 1, left : right + 1].min(axis=2)
    assert 0.05 < (written > 200).mean() < 0.5
    assert (written < 130).mean() > 0.5


def test_the_length_of_a_line_has_its_size_on_screens_with_dense_pixels(stage: Stage) -> None:
    stage.tool("line")
    heights = []
    for dpi in (72, 144):
        stage.view.render_window().SetDPI(dpi)
        stage.press_and_move((80, 60), (100, 60))
        _, _, bottom, top = stage.box_of_text()
        heights.append(top - bottom)
        assert bottom - 60 == pytest.approx(14 * dpi / 72, abs=3)
    assert heights[1] / heights[0] == pytest.approx(2.0, abs=0.2)


def test_the_view_does_not_react_while_the_user_draws(stage: Stage) -> None:
    reactions: list[str] = []
    for event in ("LeftButtonPressEvent", "MouseMoveEvent", "LeftButtonReleaseEvent"):
        stage.interactor.AddObserver(event, lambda caller, name: reactions.append(name), 50.0)
    tool = stage.tool("lasso")
    stage.drag((40, 40), (90, 45), (80, 90))
    assert reactions == []
    stage.mouse("MouseMoveEvent", 70, 10)
    assert reactions == ["MouseMoveEvent"]
    tool.deactivate()
    stage.drag((40, 40), (90, 45))
    assert len(reactions) == 4


def test_a_line_across_a_small_specimen_has_a_length_too(stage: Stage) -> None:
    stage.node.SetFieldOfView(*(np.array(stage.node.GetFieldOfView()) / 1000.0))
    stage.tool("line")
    stage.press_and_move((40, 50), (100, 90))
    assert stage.text() == f"{np.hypot(60, 40) * stage.mm_per_pixel():.2g} mm"
