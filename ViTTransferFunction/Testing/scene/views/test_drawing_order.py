"""When views are drawn: after what is changed together, and those that the user waits for before others."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.views.awaited_answer import Waiting
from ViTTransferFunction.Logic.scene.views.overlay import COLORS_NAME, VOLUME_NAME
from ViTTransferFunction.Logic.scene.views.rendering import DISPLAY_NAME
from ViTTransferFunction.Logic.scene.views.rendering import VOLUME_NAME as RENDERED_NAME
from ViTTransferFunction.Testing.support.scenes import annotate, open_spheres
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras

pytestmark = pytest.mark.slow


@pytest.fixture
def told() -> list[Waiting]:
    """The views that were told to wait, and those after them; each change once."""
    return []


@pytest.fixture
def session(slicer_app: Any, spheres: Spheres, told: list[Waiting]) -> Iterator[SceneSession]:
    """A session with three classes, all of which are shown."""

    def tell(which: Waiting) -> None:
        if told[-1:] != [which]:
            told.append(which)

    session = open_spheres(slicer_app, spheres, have_views_wait=tell)
    session.select_class(annotate(session, spheres)[0])
    session.wait()
    told.clear()
    yield session
    session.close()


def test_views_are_drawn_after_what_an_answer_changes_and_not_amid_it(
    session: SceneSession, spheres: Spheres, slicer_app: Any
) -> None:
    pauses: list[str] = []
    changed_by_pauses: dict[str, list[int]] = {}
    logic = slicer_app.app_logic
    logic.AddObserver(logic.PauseRenderEvent, lambda *_: pauses.append("pause"))
    logic.AddObserver(logic.ResumeRenderEvent, lambda *_: pauses.pop())
    for name in (VOLUME_NAME, COLORS_NAME, RENDERED_NAME, DISPLAY_NAME):
        node = slicer_app.scene.GetFirstNodeByName(name)
        changes = changed_by_pauses.setdefault(name, [])
        node.AddObserver("AnyEvent", lambda *_, changes=changes: changes.append(len(pauses)))
    session.annotations.add_points(session.classes[0].id, centre_ras(spheres, 1) + 1.0, positive=True)
    session.wait()
    assert pauses == []
    for name in (VOLUME_NAME, COLORS_NAME, RENDERED_NAME):
        assert changed_by_pauses[name], name
    assert {count for changes in changed_by_pauses.values() for count in changes} == {1}


def test_views_may_wait_until_the_answer_to_a_click_is_there_and_3d_views_until_theirs_is(
    session: SceneSession, spheres: Spheres, told: list[Waiting]
) -> None:
    session.annotations.add_points(session.classes[0].id, centre_ras(spheres, 1) + 1.0, positive=True)
    assert told == ["3D", "all"]
    while not session.selected_up_to_date:
        session.poll()
    assert told == ["3D", "all", "3D"]
    session.wait()
    assert told[-1] == "none"
    assert told.count("all") == 1


def test_slices_do_not_wait_for_the_answer_where_they_show_a_change_at_once(session: SceneSession, told: list[Waiting]) -> None:
    session.annotations.set_class(session.classes[0].id, iso=0.6)
    session.wait()
    assert told[0] == "3D"
    assert told[-1] == "none"
    assert "all" not in told


def test_3d_views_do_not_wait_where_they_show_nothing(session: SceneSession, spheres: Spheres, told: list[Waiting]) -> None:
    session.parameters.set("rendering", "off")
    session.wait()
    told.clear()
    session.annotations.add_points(session.classes[0].id, centre_ras(spheres, 1) + 1.0, positive=True)
    while not session.up_to_date:
        session.poll()
    assert told[-1] == "none"


def test_views_are_drawn_after_a_class_was_added_or_taken_back_and_not_amid_that(
    session: SceneSession, slicer_app: Any
) -> None:
    pauses: list[str] = []
    pauses_of_lists: list[int] = []
    logic, scene = slicer_app.app_logic, slicer_app.scene
    logic.AddObserver(logic.PauseRenderEvent, lambda *_: pauses.append("pause"))
    logic.AddObserver(logic.ResumeRenderEvent, lambda *_: pauses.pop())
    for event in (scene.NodeAddedEvent, scene.NodeRemovedEvent):
        scene.AddObserver(event, lambda *_: pauses_of_lists.append(len(pauses)))
    session.annotations.add_class()
    session.annotations.undo()
    assert pauses == []
    assert len(pauses_of_lists) >= 4, "two lists, twice"
    assert 0 not in pauses_of_lists
