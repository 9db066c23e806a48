"""The order in which views are drawn, where that takes its time: slices with the answer to a click, 3D views after them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import slicer
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from ViTTransferFunction.Logic.scene.views.view_sight import sees
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras
from ViTTransferFunction.Testing.support.standin.host import Host
from ViTTransferFunction.Testing.support.standin.views import DrawnView
from ViTTransferFunction.Testing.support.widgets import add_class, place, wait_until

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]

LONG_MS = 60_000
FRAMES_MS = 50
"""In which a view is drawn that does not wait."""


@pytest.fixture
def slow_3d(host: Host, monkeypatch: pytest.MonkeyPatch) -> DrawnView:
    """The 3D view, as if drawing it took its time; while it waits, it does so until it is told."""
    from ViTTransferFunction.Widget import views

    monkeypatch.setattr(views, "SLOW_S", -10.0)
    monkeypatch.setattr(views, "LONGEST_WAIT_3D_MS", LONG_MS)
    return view_3d()


@pytest.fixture
def slow_slices(host: Host, monkeypatch: pytest.MonkeyPatch) -> list[DrawnView]:
    """The slice views, as if a processor drew them; likewise."""
    from ViTTransferFunction.Widget import views

    monkeypatch.setattr(views, "draws_in_software", lambda window: True)
    monkeypatch.setattr(views, "LONGEST_WAIT_MS", LONG_MS)
    return [slice_view(name) for name in ("Red", "Green", "Yellow")]


@pytest.fixture
def order(host: Host) -> Callable[[], Any]:
    """Makes what is tested, once the stand-ins are there."""
    from ViTTransferFunction.Widget.views import DrawingOrder

    return DrawingOrder


@pytest.fixture
def clicked(slow_slices: list[DrawnView], slow_3d: DrawnView, ready: Any, spheres: Spheres) -> Any:
    """The panel, where the first point of a structure has just been placed: its answer is under way, and all views wait."""
    add_class(ready)
    place(ready, tuple(centre_ras(spheres, 1)[0]))
    return ready


def view_3d() -> DrawnView:
    return slicer.app.layoutManager().threeDWidget(0).threeDView()


def slice_view(name: str) -> DrawnView:
    return slicer.app.layoutManager().sliceWidget(name).sliceView()


def drawn() -> list[DrawnView]:
    """The views, each as often as it was drawn, in order."""
    return slicer.app.layoutManager().drawn


def test_slow_views_are_drawn_when_the_answer_is_there_3d_last(
    slow_slices: list[DrawnView], slow_3d: DrawnView, order: Callable[[], Any]
) -> None:
    drawing = order()
    for _ in range(2):
        drawing.have_wait("all")
        for view in (slow_3d, *slow_slices):
            view.scheduleRender()
        QTest.qWait(FRAMES_MS)
        assert drawn() == []
    drawing.have_wait("3D")
    assert drawn() == slow_slices
    drawing.have_wait("none")
    assert drawn() == slow_slices, "what is changed with the answer is drawn in slices first"
    wait_until(lambda: drawn() == [*slow_slices, slow_3d])
    assert not any(view.pauses for view in (slow_3d, *slow_slices))


def test_the_view_with_the_mouse_is_drawn_first(slow_slices: list[DrawnView], order: Callable[[], Any]) -> None:
    red, green, yellow = slow_slices
    yellow.setAttribute(Qt.WidgetAttribute.WA_UnderMouse)
    drawing = order()
    drawing.have_wait("all")
    drawing.have_wait("3D")
    assert drawn() == [yellow, red, green]


def test_quick_views_do_not_wait(host: Host, order: Callable[[], Any], monkeypatch: pytest.MonkeyPatch) -> None:
    from ViTTransferFunction.Widget import views

    monkeypatch.setattr(views, "draws_in_software", lambda window: False)
    order().have_wait("all")
    for view in (view_3d(), slice_view("Red")):
        view.scheduleRender()
    wait_until(lambda: set(drawn()) == {view_3d(), slice_view("Red")})


def test_a_3d_view_that_comes_with_another_layout_looks_at_the_structures(ready: Any, spheres: Spheres) -> None:
    view, centre = slicer.app.layoutManager().threeDWidget(0), tuple(centre_ras(spheres, 1)[0])
    renderer = view.renderWindow().GetRenderers().GetFirstRenderer()
    renderer.GetActiveCamera().SetPosition(0.0, 5000.0, 0.0)
    renderer.GetActiveCamera().SetFocalPoint(5000.0, 5000.0, 0.0)
    view.hide()
    add_class(ready)
    place(ready, centre)
    wait_until(lambda: not ready.panel.session.busy)
    assert not sees(renderer, centre)
    view.show()
    slicer.app.layoutManager().layoutChanged.emit(4)
    wait_until(lambda: sees(renderer, centre))


def test_a_3d_view_that_is_being_turned_does_not_wait(slow_3d: DrawnView, order: Callable[[], Any]) -> None:
    slow_3d.setAttribute(Qt.WidgetAttribute.WA_UnderMouse)
    order().have_wait("3D")
    slow_3d.scheduleRender()
    wait_until(lambda: drawn() == [slow_3d])


def test_slices_in_which_something_is_dragged_do_not_wait(
    slow_slices: list[DrawnView], widget: Any, order: Callable[[], Any]
) -> None:
    window = slicer.util.mainWindow().windowHandle()
    QTest.mousePress(window, Qt.MouseButton.LeftButton)
    order().have_wait("all")
    QTest.mouseRelease(window, Qt.MouseButton.LeftButton)
    slow_slices[0].scheduleRender()
    wait_until(lambda: drawn() == slow_slices[:1])


def test_where_the_answer_takes_long_slices_are_drawn_without_it(
    slow_slices: list[DrawnView], order: Callable[[], Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    from ViTTransferFunction.Widget import views

    monkeypatch.setattr(views, "LONGEST_WAIT_MS", 1)
    drawing = order()
    drawing.have_wait("all")
    slow_slices[0].scheduleRender()
    wait_until(lambda: drawn() == slow_slices[:1])
    drawing.have_wait("all")
    assert slow_slices[0].pauses == 0


def test_where_the_answer_takes_long_3d_views_are_drawn_from_time_to_time(
    slow_3d: DrawnView, order: Callable[[], Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    from ViTTransferFunction.Widget import views

    monkeypatch.setattr(views, "LONGEST_WAIT_3D_MS", 1)
    drawing = order()
    for times in (1, 2):
        drawing.have_wait("3D")
        slow_3d.scheduleRender()
        assert len(drawn()) == times - 1
        wait_until(lambda expected=[slow_3d] * times: drawn() == expected)  # type: ignore[misc]
        assert slow_3d.pauses == 0


@pytest.mark.slow
def test_a_click_has_slices_drawn_with_its_answer_and_3d_views_after_that(
    slow_slices: list[DrawnView], slow_3d: DrawnView, clicked: Any, spheres: Spheres
) -> None:
    session = clicked.panel.session
    wait_until(lambda: not session.busy and slow_3d.pauses == 0)
    add_class(clicked)
    drawn().clear()
    place(clicked, tuple(centre_ras(spheres, 2)[0]))
    # As Slicer does for the point.
    for view in (slow_3d, *slow_slices):
        view.scheduleRender()
    assert drawn() == []
    wait_until(lambda: bool(drawn()))
    assert session.selected_up_to_date
    wait_until(lambda: slow_3d in drawn())
    assert drawn() == [*slow_slices, slow_3d]


@pytest.mark.slow
def test_where_the_scene_is_closed_meanwhile_views_are_drawn_again(
    slow_slices: list[DrawnView], slow_3d: DrawnView, clicked: Any
) -> None:
    views = [slow_3d, *slow_slices]
    assert [view.pauses for view in views] == [1] * len(views)
    slicer.mrmlScene.Clear()
    assert [view.pauses for view in views] == [0] * len(views)
