"""Ctrl and the wheel in Slicer's own slice view: over the structure they change its size, elsewhere the view zooms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.scene.tools.size_wheel import STILL_MM, SizeWheel
from ViTTransferFunction.Testing.support.views import SLICE_PIXELS, Views

MIDDLE = SLICE_PIXELS // 2
STRUCTURE_MM = 5.0
"""Radius of the structure, in the middle of the view."""


class Hand:
    """A user with a mouse over a slice view of Slicer, and what the wheel does to the structure."""

    def __init__(self, view: Any) -> None:
        self.view = view
        self.selected: str | None = "liver"
        self.radius_mm = STRUCTURE_MM
        self.notches: list[int] = []
        node = view.get_view_node()
        self.pixels_per_mm = SLICE_PIXELS / node.GetFieldOfView()[0]
        self._centre = np.array(node.GetXYToRAS().MultiplyPoint((MIDDLE, MIDDLE, 0.0, 1.0))[:3])
        self.body_scale = 1.0
        self.tool = SizeWheel(
            view.interactor(), node, lambda: self.selected, self._is_over, lambda: self.body_scale, self.notches.append
        )
        self.tool.activate()

    def _is_over(self, point_ras: np.ndarray) -> bool:
        return float(np.linalg.norm(point_ras - self._centre)) <= self.radius_mm

    def turn(self, event: str, beside_mm: float = 0.0, ctrl: int = 1, shift: int = 0) -> bool:
        """Turn the wheel by a notch, so far from the middle; returns whether the view zoomed or went to another slice."""
        node, view = self.view.get_view_node(), self.view.interactor()
        before = node.GetFieldOfView(), node.GetSliceOffset()
        view.SetEventInformation(MIDDLE + round(beside_mm * self.pixels_per_mm), MIDDLE, ctrl, shift)
        view.InvokeEvent(event)
        return (node.GetFieldOfView(), node.GetSliceOffset()) != before


FORWARD, BACKWARD = "MouseWheelForwardEvent", "MouseWheelBackwardEvent"


@pytest.fixture
def hand(slicer_app: Any) -> Hand:
    return Hand(Views(slicer_app).slice_view())


def test_over_the_structure_notches_change_its_size_and_the_view_stays(hand: Hand) -> None:
    assert not hand.turn(FORWARD)
    assert not hand.turn(BACKWARD)
    assert not hand.turn(FORWARD)
    assert hand.notches == [1, -1, 1]


def test_elsewhere_the_view_zooms_as_slicer_has_it(hand: Hand) -> None:
    assert hand.turn(FORWARD, beside_mm=2 * STRUCTURE_MM)
    assert hand.turn(BACKWARD, beside_mm=2 * STRUCTURE_MM)
    assert hand.notches == []


def test_without_ctrl_the_wheel_goes_through_slices_and_with_shift_it_is_not_ours(hand: Hand) -> None:
    assert hand.turn(FORWARD, ctrl=0)
    hand.turn(FORWARD, shift=1)
    assert hand.notches == []


def test_what_began_over_the_structure_goes_on_when_its_border_has_passed_the_mouse(hand: Hand) -> None:
    hand.turn(BACKWARD)
    hand.radius_mm = -1.0
    assert not hand.turn(BACKWARD, beside_mm=0.5 * STILL_MM)
    assert hand.notches == [-1, -1]
    assert hand.turn(BACKWARD, beside_mm=2.0 * STILL_MM)
    assert hand.turn(BACKWARD)
    assert hand.notches == [-1, -1]


def test_a_structure_that_is_selected_meanwhile_has_to_be_pointed_at(hand: Hand) -> None:
    hand.turn(FORWARD)
    hand.selected, hand.radius_mm = "spleen", -1.0
    assert hand.turn(FORWARD)
    assert hand.notches == [1]


def test_without_a_structure_the_view_zooms(hand: Hand) -> None:
    hand.selected = None
    assert hand.turn(FORWARD)
    assert hand.notches == []


def test_the_wheel_is_the_views_again_when_the_tool_is_put_down(hand: Hand) -> None:
    hand.tool.deactivate()
    assert hand.turn(FORWARD)
    assert hand.notches == []


def test_in_a_small_specimen_the_mouse_is_moved_as_soon_as_in_a_body(hand: Hand) -> None:
    hand.turn(BACKWARD)
    hand.radius_mm, hand.body_scale = -1.0, 0.1
    assert hand.turn(BACKWARD, beside_mm=0.5 * STILL_MM), "the view zooms"
    assert hand.notches == [-1]
