"""Which views are drawn first: the one that the user looks at, then the others, without delaying the answer to a click."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from types import SimpleNamespace
from typing import Any

import pytest
import vtk

pytest.importorskip("trame_slicer")

from trame_slicer.rca_view import RemoteThreeDViewFactory

from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S
from ViTTransferFunction.WebApp import rendering_pace
from ViTTransferFunction.WebApp.rendering_pace import (
    PICTURES_PER_S,
    PICTURES_PER_S_ELSEWHERE,
    AfterClicks,
    EnteredFirst,
    PatientThreeDViewFactory,
)


class Pictures:
    """Counts a view's pictures in place of the scheduler, and lets one wait for the next."""

    def __init__(self, entered: bool) -> None:
        self.target_fps = PICTURES_PER_S if entered else PICTURES_PER_S_ELSEWHERE
        self.drawn = 0
        self._event = asyncio.Event()

    def set_streamer(self, streamer: Any) -> None:
        """As adapters of views have it, who send their pictures by it."""

    def schedule_render(self) -> None:
        self.drawn += 1
        self._event.set()

    async def next(self) -> None:
        await asyncio.wait_for(self._event.wait(), LONGEST_WAIT_S)
        self._event.clear()


async def turns_pass() -> None:
    await asyncio.sleep(5 * rendering_pace.STEP_S)


def run(journey: Callable[[], Coroutine[Any, Any, None]]) -> None:
    asyncio.run(journey())


def test_the_view_with_the_mouse_is_drawn_at_once_whatever_is_under_way() -> None:
    async def journey() -> None:
        for kind in (EnteredFirst, AfterClicks):
            pictures = Pictures(entered=True)
            kind(pictures, lambda: True).schedule_render()
            assert pictures.drawn == 1

    run(journey)


def test_other_slice_views_wait_for_the_answer_to_a_click_and_are_drawn_once() -> None:
    async def journey() -> None:
        answered, pictures = asyncio.Event(), Pictures(entered=False)
        view = EnteredFirst(pictures, lambda: not answered.is_set(), LONGEST_WAIT_S)
        view.schedule_render()
        view.schedule_render()
        await turns_pass()
        assert pictures.drawn == 0
        answered.set()
        await pictures.next()
        await turns_pass()
        assert pictures.drawn == 1

    run(journey)


def test_no_view_waits_for_ever() -> None:
    async def journey() -> None:
        pictures = Pictures(entered=False)
        EnteredFirst(pictures, lambda: True, 2 * rendering_pace.STEP_S).schedule_render()
        await pictures.next()

    run(journey)


def test_a_view_that_the_mouse_enters_while_it_waits_is_not_drawn_twice() -> None:
    async def journey() -> None:
        pictures = Pictures(entered=False)
        view = EnteredFirst(pictures, lambda: False)
        view.schedule_render()
        pictures.target_fps = PICTURES_PER_S
        view.schedule_render()
        await turns_pass()
        assert pictures.drawn == 1

    run(journey)


def test_a_3d_view_elsewhere_is_drawn_only_when_what_it_shows_has_settled() -> None:
    async def journey() -> None:
        pictures = Pictures(entered=False)
        view = AfterClicks(pictures, lambda: False)
        view.settle()
        view.schedule_render()
        await turns_pass()
        assert pictures.drawn == 0
        view.settle()
        await pictures.next()

    run(journey)


@pytest.mark.parametrize("entered", [True, False])
def test_a_3d_view_tells_that_it_is_drawn_and_not_of_a_sharp_picture_of_the_same(entered: bool) -> None:
    async def journey() -> None:
        pictures, told = Pictures(entered), list[int]()
        sharpness: Any = SimpleNamespace(drawing=True, change=lambda: told.append(pictures.drawn))
        view = AfterClicks(pictures, lambda: False, sharpness)
        view.schedule_render()
        view.settle()
        await turns_pass()
        assert (pictures.drawn, told) == (0, [])
        sharpness.drawing = False
        view.schedule_render()
        view.settle()
        await pictures.next()
        assert told == [0]

    run(journey)


def test_what_is_translucent_divides_no_rays_also_where_there_is_a_graphics_card(monkeypatch: pytest.MonkeyPatch) -> None:
    renderer = vtk.vtkRenderer()
    renderer.SetUseDepthPeelingForVolumes(True)
    capabilities = "OpenGL renderer string:  a graphics card"
    window = SimpleNamespace(Render=lambda: None, GetNeverRendered=lambda: 0, ReportCapabilities=lambda: capabilities)
    view = SimpleNamespace(renderer=lambda: renderer, render_window=lambda: window, set_scheduled_render=lambda strategy: None)
    created = SimpleNamespace(slicer_view=view, view_adapter=Pictures(entered=False))
    monkeypatch.setattr(RemoteThreeDViewFactory, "__init__", lambda *args, **options: None)
    monkeypatch.setattr(RemoteThreeDViewFactory, "_create_view", lambda *args: created)
    monkeypatch.setattr(rendering_pace, "AfterClicks", lambda *args: None)
    PatientThreeDViewFactory(None, lambda: False)._create_view(None, None, None)
    assert not renderer.GetUseDepthPeelingForVolumes()
