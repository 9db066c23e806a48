"""Pictures while a look is being changed: with fewer rays, and then in full."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from vtkmodules.vtkRenderingCore import vtkRenderer

from ViTTransferFunction.Logic.rendering.appearance import Appearance
from ViTTransferFunction.Logic.rendering.surroundings import Surroundings
from ViTTransferFunction.Logic.scene.views import quick_pictures
from ViTTransferFunction.Logic.scene.views.display import SceneDisplay
from ViTTransferFunction.Logic.scene.views.rendering import ClassRendering
from ViTTransferFunction.Logic.scene.views.view_picture import view_picture
from ViTTransferFunction.Testing.scene.views.test_rendering import (
    BLUE,
    GREEN,
    LEFT,
    NOTHING,
    RED,
    RIGHT,
    Stage,
    appearances,
    two_balls,
)
from ViTTransferFunction.Testing.support.views import PIXELS_3D


@pytest.fixture
def stage(slicer_app: Any, monkeypatch: pytest.MonkeyPatch) -> Stage:
    """Two balls in a view in which every picture takes too long, and a hand that never rests."""
    monkeypatch.setattr(quick_pictures, "GOAL_S", 1e-9)
    monkeypatch.setattr(quick_pictures, "REST_S", 1e9)
    stage = Stage(slicer_app)
    stage.rendering = ClassRendering(stage.scene, slicer_app.app_logic, lambda: [stage.view.render_window()])
    return stage


def distances(stage: Stage) -> list[float]:
    """Of the rays of each volume in the view, in pixels."""
    return [volume.GetMapper().GetImageSampleDistance() for volume in stage.view.renderer().GetVolumes()]


def test_pictures_of_a_changing_look_have_fewer_rays_and_are_like_those_with_all(stage: Stage) -> None:
    shown = stage.show_structures(two_balls(), appearances([RED, GREEN]))
    stage.picture()
    quick = stage.change(shown, appearances([BLUE, GREEN]))
    assert distances(stage) == [quick_pictures.COARSEST]
    window = stage.view.render_window()
    assert window.GetDesiredUpdateRate() == stage.view.interactor().GetDesiredUpdateRate()
    stage.rendering.hide()
    assert window.GetDesiredUpdateRate() == stage.view.interactor().GetStillUpdateRate()
    stage.show_structures(two_balls(), appearances([BLUE, GREEN]))
    full = stage.picture()
    assert distances(stage) == [1.0]
    assert 0.0 < np.abs(quick - full).mean() < 2.0
    for pixel in stage.at(LEFT, RIGHT):
        assert quick[pixel] == pytest.approx(full[pixel], abs=12)


def test_a_look_can_be_changed_where_a_renderer_has_never_drawn(stage: Stage) -> None:
    hidden = vtkRenderer()
    hidden.DrawOff()
    stage.view.render_window().AddRenderer(hidden)
    shown = stage.show_structures(two_balls(), appearances([RED, GREEN]))
    stage.picture()
    assert hidden.GetLastRenderTimeInSeconds() < 0.0
    stage.change(shown, appearances([BLUE, GREEN]))
    assert stage.rendering.drawing_quickly


def test_when_the_hand_rests_the_view_is_drawn_in_full(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    shown = stage.show_structures(two_balls(), appearances([RED, GREEN]))
    full = stage.picture()
    stage.rendering.change(shown.uniforms(appearances([RED, GREEN]), NOTHING))
    stage.rendering.draw_in_full_at_rest()
    assert stage.rendering.drawing_quickly
    assert (stage.picture() != full).any()
    asked = []
    stage.view._displayable_manager_group.AddObserver("UpdateEvent", lambda *_: asked.append(True))
    monkeypatch.setattr(quick_pictures, "REST_S", 0.0)
    stage.rendering.draw_in_full_at_rest()
    assert asked
    assert not stage.rendering.drawing_quickly
    assert np.array_equal(stage.picture(), full)


def test_a_view_that_follows_the_hand_anyway_keeps_its_rays(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(quick_pictures, "GOAL_S", 1e9)
    shown = stage.show_structures(two_balls(), appearances([RED, GREEN]))
    stage.picture()
    stage.change(shown, appearances([BLUE, GREEN]))
    assert distances(stage) == [1.0]
    assert not stage.rendering.drawing_quickly


def test_a_picture_that_is_saved_meanwhile_has_all_rays(stage: Stage) -> None:
    shown = stage.show_structures(two_balls(), appearances([RED, GREEN]))
    window, size = stage.view.render_window(), (2 * PIXELS_3D, 2 * PIXELS_3D)
    stage.picture()
    full = view_picture(window, size)
    stage.change(shown, appearances([RED, GREEN]))
    assert np.array_equal(view_picture(window, size), full)
    assert distances(stage) == [quick_pictures.COARSEST]


def test_another_volume_in_the_view_keeps_its_rays(slicer_app: Any, stage: Stage) -> None:
    slicer_app.volume_rendering.create_display_node(stage.views.volume)
    shown = stage.show_structures(two_balls(), appearances([RED, GREEN]))
    stage.picture()
    stage.change(shown, appearances([BLUE, GREEN]))
    assert sorted(distances(stage)) == [1.0, quick_pictures.COARSEST]


@pytest.mark.parametrize("over", ["hide", "export"])
def test_what_is_hidden_or_left_to_the_scene_is_not_left_with_fewer_rays(stage: Stage, over: str) -> None:
    shown = stage.show_structures(two_balls(), appearances([RED, GREEN]))
    stage.picture()
    stage.change(shown, appearances([BLUE, GREEN]))
    getattr(stage.rendering, over)(*(["left"] if over == "export" else []))
    assert distances(stage) == [1.0] * len(distances(stage))
    assert not stage.rendering.drawing_quickly


def test_the_views_have_something_to_do_until_they_are_drawn_in_full(
    slicer_app: Any, stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = stage.show_structures(two_balls(), appearances([RED, GREEN]))
    stage.rendering.remove()
    display = SceneDisplay(stage.scene, slicer_app.app_logic, lambda: [stage.view.render_window()])
    display.show_rendering(stage.views.volume, shown, appearances([RED, GREEN]), Surroundings(), cut=None)
    stage.picture()
    assert not display.pending
    display.show_rendering(stage.views.volume, shown, [Appearance(BLUE), Appearance(GREEN)], Surroundings(), cut=None)
    display.advance()
    assert display.pending
    monkeypatch.setattr(quick_pictures, "REST_S", 0.0)
    display.advance()
    assert not display.pending
    display.remove()
