"""Slicer's place mode in the panel's hands, and given back as it was, whoever ends it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import slicer
from PySide6.QtTest import QTest

from ViTTransferFunction.Logic.scene.views.rendering_cut import shown_cut
from ViTTransferFunction.Testing.support.standin.host import Host
from ViTTransferFunction.Testing.support.widgets import add_class

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]


@pytest.fixture
def interaction(host: Host) -> Any:
    return slicer.app.applicationLogic().GetInteractionNode()


@pytest.fixture
def selection(host: Host) -> Any:
    return slicer.app.applicationLogic().GetSelectionNode()


@pytest.fixture
def list_of_the_user(host: Host) -> Any:
    return slicer.mrmlScene.AddNewNodeByClass("vtkMRMLMarkupsCurveNode", "aorta")


def begin_a_curve(selection: Any, node: Any) -> None:
    """Have Slicer's own button place points in `node`."""
    selection.SetReferenceActivePlaceNodeClassName("vtkMRMLMarkupsCurveNode")
    selection.SetActivePlaceNodeID(node.GetID())


def test_a_new_class_has_the_tool_in_hand_and_it_follows_the_selection(widget: Any, interaction: Any, selection: Any) -> None:
    first, second = add_class(widget), add_class(widget)
    annotations = widget.panel.session.annotations
    assert interaction.GetCurrentInteractionMode() == interaction.Place
    assert interaction.GetPlaceModePersistence()
    assert selection.GetActivePlaceNodeID() == annotations.points_node(second.id, positive=True).GetID()
    widget.ui.classTable.selectRow(0)
    assert selection.GetActivePlaceNodeID() == annotations.points_node(first.id, positive=True).GetID()
    widget.ui.pointOffButton.click()
    assert selection.GetActivePlaceNodeID() == annotations.points_node(first.id, positive=False).GetID()
    assert not widget.ui.pointOnButton.isChecked()
    widget.ui.pointOffButton.click()
    assert interaction.GetCurrentInteractionMode() == interaction.ViewTransform


def test_a_list_takes_the_points_that_are_clicked_also_where_their_number_was_fixed(widget: Any) -> None:
    added = add_class(widget)
    widget.panel.tools.put_down()
    points = widget.panel.session.annotations.points_node(added.id, positive=True)
    points.SetFixedNumberOfControlPoints(True)
    assert points.AddControlPoint(0.0, 0.0, 0.0) < 0
    widget.ui.pointOnButton.click()
    assert points.AddControlPoint(0.0, 0.0, 0.0) == 0


@pytest.mark.parametrize("name", ["Red", "3D"])
def test_a_view_hears_of_the_mouse_that_rests_in_it_when_a_tool_for_points_is_taken(
    widget: Any, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Slicer places no point, by however many clicks, before the mouse has been moved in place mode."""
    add_class(widget)
    QTest.qWait(1)
    manager = slicer.app.layoutManager()
    view = manager.threeDWidget(0).threeDView() if name == "3D" else manager.sliceWidget(name).sliceView()
    monkeypatch.setattr(view, "underMouse", lambda: True)
    moves: list[str] = []
    view.interactor().AddObserver("MouseMoveEvent", lambda caller, event: moves.append(widget.panel.tools.tool))
    for button in (widget.ui.pointOffButton, widget.ui.brushOnButton, widget.ui.pointOnButton, widget.ui.pointOnButton):
        button.click()
        QTest.qWait(1)
    assert moves == ["pointOff", "pointOn"]


def end_in_a_view(widget: Any, host: Host) -> None:
    """A right click, or Esc: what vtkSlicerMarkupsWidget does then."""
    slicer.app.applicationLogic().GetInteractionNode().SwitchToViewTransformMode()


def take_another_mouse_mode(widget: Any, host: Host) -> None:
    interaction = slicer.app.applicationLogic().GetInteractionNode()
    interaction.SetCurrentInteractionMode(interaction.AdjustWindowLevel)


LEAVING: dict[str, Callable[[Any, Host], None]] = {
    "the button": lambda widget, host: widget.ui.pointOnButton.click(),
    "another tool of the panel": lambda widget, host: widget.ui.brushOnButton.click(),
    "the view": end_in_a_view,
    "another mouse mode": take_another_mouse_mode,
    "another module": lambda widget, host: host.representation.exit(),
    "the class removed": lambda widget, host: widget.ui.removeClassButton.click(),
    "the module unloaded": lambda widget, host: slicer.app.moduleManager().unload("ViTTransferFunction"),
}


@pytest.mark.parametrize("way", LEAVING)
@pytest.mark.parametrize("persistence", [0, 1])
def test_what_the_user_had_is_there_again_after(
    widget: Any, host: Host, interaction: Any, selection: Any, list_of_the_user: Any, way: str, persistence: int
) -> None:
    add_class(widget)
    widget.ui.pointOnButton.click()
    begin_a_curve(selection, list_of_the_user)
    interaction.SetPlaceModePersistence(persistence)
    widget.ui.pointOffButton.click()
    widget.ui.pointOnButton.click()
    assert interaction.GetPlaceModePersistence()
    LEAVING[way](widget, host)
    assert widget.panel.tools.tool in (None, "brushOn")
    assert not widget.ui.pointOnButton.isChecked()
    assert interaction.GetCurrentInteractionMode() != interaction.Place
    assert interaction.GetPlaceModePersistence() == persistence
    assert selection.GetActivePlaceNodeID() == list_of_the_user.GetID()
    assert selection.GetActivePlaceNodeClassName() == "vtkMRMLMarkupsCurveNode"


def test_a_closed_scene_ends_placing(widget: Any, interaction: Any) -> None:
    add_class(widget)
    slicer.mrmlScene.Clear(False)
    assert widget.panel.tools.tool is None
    assert interaction.GetCurrentInteractionMode() == interaction.ViewTransform
    assert not interaction.GetPlaceModePersistence()


def test_another_list_being_placed_in_takes_the_tool_out_of_the_hand_and_goes_on(
    widget: Any, interaction: Any, selection: Any, list_of_the_user: Any
) -> None:
    add_class(widget)
    begin_a_curve(selection, list_of_the_user)
    assert widget.panel.tools.tool is None
    assert not widget.ui.pointOnButton.isChecked()
    assert not interaction.GetPlaceModePersistence()
    assert interaction.GetCurrentInteractionMode() == interaction.Place
    assert selection.GetActivePlaceNodeID() == list_of_the_user.GetID()


def duplicate(widget: Any) -> None:
    widget.ui.duplicateClassButton.click()


def bring_back_another(widget: Any) -> None:
    annotations, selected = widget.panel.session.annotations, widget.panel.session.selected_class
    other = annotations.add_class("another")
    annotations.remove_class(other.id)
    widget.ui.undoButton.click()
    assert widget.panel.session.selected_class == selected


def cut_the_rendering(widget: Any) -> None:
    volume, parameters = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLScalarVolumeNode"), widget.panel.session.parameters
    parameters.set("renderingCut", "plane")
    assert shown_cut(slicer.mrmlScene, parameters, volume) is parameters.rendering_plane


@pytest.mark.parametrize("make_markups", [duplicate, bring_back_another, cut_the_rendering])
@pytest.mark.parametrize("tool", ["pointOn", "pointOff"])
def test_the_tool_stays_in_hand_and_on_the_selected_class_when_markups_are_made(
    widget: Any, interaction: Any, selection: Any, make_markups: Callable[[Any], None], tool: str
) -> None:
    add_class(widget)
    if tool == "pointOff":
        widget.ui.pointOffButton.click()
    make_markups(widget)
    session = widget.panel.session
    assert widget.panel.tools.tool == tool
    assert getattr(widget.ui, f"{tool}Button").isChecked()
    assert interaction.GetCurrentInteractionMode() == interaction.Place
    assert interaction.GetPlaceModePersistence()
    points = session.annotations.points_node(session.selected_class.id, tool == "pointOn")
    assert selection.GetActivePlaceNodeID() == points.GetID()
    assert selection.GetActivePlaceNodeClassName() == "vtkMRMLMarkupsFiducialNode"


def test_what_the_user_places_elsewhere_goes_on_when_markups_are_made(
    widget: Any, interaction: Any, selection: Any, list_of_the_user: Any
) -> None:
    begin_a_curve(selection, list_of_the_user)
    interaction.SetCurrentInteractionMode(interaction.Place)
    cut_the_rendering(widget)
    widget.panel.session.annotations.add_class()
    assert interaction.GetCurrentInteractionMode() == interaction.Place
    assert selection.GetActivePlaceNodeID() == list_of_the_user.GetID()
    assert selection.GetActivePlaceNodeClassName() == "vtkMRMLMarkupsCurveNode"


def test_where_the_list_in_hand_is_deleted_clicks_place_nothing(widget: Any, interaction: Any, selection: Any) -> None:
    selected = add_class(widget)
    widget.ui.pointOffButton.click()
    slicer.mrmlScene.RemoveNode(widget.panel.session.annotations.points_node(selected.id, positive=False))
    assert widget.panel.tools.tool is None
    assert not widget.ui.pointOffButton.isChecked()
    assert interaction.GetCurrentInteractionMode() == interaction.ViewTransform
    assert not selection.GetActivePlaceNodeID()


def remove_its_list(widget: Any) -> None:
    session = widget.panel.session
    slicer.mrmlScene.RemoveNode(session.annotations.points_node(session.selected_class.id, positive=True))


@pytest.mark.parametrize("remove", [lambda widget: widget.ui.undoButton.click(), remove_its_list])
def test_where_the_list_in_hand_goes_clicks_place_nothing_in_another_structure(
    widget: Any, interaction: Any, selection: Any, remove: Callable[[Any], None]
) -> None:
    for _ in range(2):
        add_class(widget)
    remove(widget)
    assert widget.panel.tools.tool is None
    assert not widget.ui.pointOnButton.isChecked()
    assert interaction.GetCurrentInteractionMode() == interaction.ViewTransform
    assert not interaction.GetPlaceModePersistence()
    assert not selection.GetActivePlaceNodeID()


@pytest.mark.parametrize("mode", ["Place", "AdjustWindowLevel"])
@pytest.mark.parametrize("tool", ["brushOn", "outline", "eraser"])
def test_a_tool_of_slicer_s_takes_the_one_for_slices_out_of_the_hand_and_goes_on(
    widget: Any, interaction: Any, tool: str, mode: str
) -> None:
    add_class(widget)
    widget.panel.tools.toggle(tool)
    interaction.SetCurrentInteractionMode(getattr(interaction, mode))
    assert widget.panel.tools.tool is None
    assert not getattr(widget.ui, f"{tool}Button").isChecked()
    assert interaction.GetCurrentInteractionMode() == getattr(interaction, mode)


@pytest.mark.parametrize("mode", ["Place", "AdjustWindowLevel"])
def test_a_tool_for_slices_takes_one_of_slicer_s_out_of_the_hand(widget: Any, interaction: Any, mode: str) -> None:
    add_class(widget)
    widget.panel.tools.put_down()
    interaction.SetCurrentInteractionMode(getattr(interaction, mode))
    widget.ui.brushOnButton.click()
    assert widget.panel.tools.tool == "brushOn"
    assert interaction.GetCurrentInteractionMode() == interaction.ViewTransform


def test_slicer_s_own_button_places_nothing_in_a_structure_afterwards(widget: Any, selection: Any) -> None:
    add_class(widget)
    widget.ui.pointOnButton.click()
    assert selection.GetActivePlaceNodeID() is None


@pytest.mark.parametrize("mode", ["Place", "ViewTransform"])
def test_what_markups_were_told_of_a_structure_s_list_ends_when_the_module_is_opened(
    host: Host, widget: Any, interaction: Any, selection: Any, mode: str
) -> None:
    """Otherwise clicks add points to it, at once or by Slicer's own button, while the panel shows no tool in hand."""
    added = add_class(widget)
    points = widget.panel.session.annotations.points_node(added.id, positive=True)
    host.representation.exit()
    selection.SetActivePlaceNodeID(points.GetID())
    interaction.SetPlaceModePersistence(1)
    interaction.SetCurrentInteractionMode(getattr(interaction, mode))
    host.representation.enter()
    assert interaction.GetCurrentInteractionMode() == interaction.ViewTransform
    assert not selection.GetActivePlaceNodeID()
    assert widget.panel.tools.tool is None


def test_single_points_that_the_user_asks_for_meanwhile_stay_so(widget: Any, interaction: Any) -> None:
    interaction.SetPlaceModePersistence(1)
    add_class(widget)
    interaction.SetPlaceModePersistence(0)
    widget.ui.pointOnButton.click()
    assert not interaction.GetPlaceModePersistence()


@pytest.mark.parametrize("replaces", [True, False])
def test_a_scene_that_was_saved_while_placing_does_not_go_on_placing(
    widget: Any, interaction: Any, selection: Any, tmp_path: Path, replaces: bool
) -> None:
    add_class(widget)
    assert slicer.mrmlScene.WriteToMRB(str(tmp_path / "saved.mrb"))
    widget.ui.pointOnButton.click()
    assert slicer.mrmlScene.ReadFromMRB(str(tmp_path / "saved.mrb"), replaces)
    assert interaction.GetCurrentInteractionMode() == interaction.ViewTransform
    assert not interaction.GetPlaceModePersistence()
    assert not selection.GetActivePlaceNodeID()
    assert not widget.ui.pointOnButton.isChecked()
    widget.ui.pointOnButton.click()
    points = widget.panel.session.annotations.points_node(widget.panel.session.classes[0].id, positive=True)
    assert selection.GetActivePlaceNodeID() == points.GetID()


def test_a_scene_that_was_saved_while_the_user_placed_elsewhere_goes_on_placing_there(
    widget: Any, interaction: Any, selection: Any, list_of_the_user: Any, tmp_path: Path
) -> None:
    begin_a_curve(selection, list_of_the_user)
    interaction.SetPlaceModePersistence(1)
    interaction.SetCurrentInteractionMode(interaction.Place)
    assert slicer.mrmlScene.WriteToMRB(str(tmp_path / "saved.mrb"))
    interaction.SwitchToViewTransformMode()
    assert slicer.mrmlScene.ReadFromMRB(str(tmp_path / "saved.mrb"), True)
    assert widget.panel.session is not None
    assert interaction.GetCurrentInteractionMode() == interaction.Place
    assert interaction.GetPlaceModePersistence()
    assert slicer.mrmlScene.GetNodeByID(selection.GetActivePlaceNodeID()).GetName() == "aorta"


def test_the_tool_stays_in_hand_when_a_scene_is_added_that_says_nothing_of_the_mouse(
    widget: Any, interaction: Any, selection: Any, tmp_path: Path
) -> None:
    selected = add_class(widget)
    (tmp_path / "added.mrml").write_text('<MRML version="Slicer4.4.0"></MRML>')
    slicer.mrmlScene.SetURL(str(tmp_path / "added.mrml"))
    assert slicer.mrmlScene.Import()
    assert widget.ui.pointOnButton.isChecked()
    assert interaction.GetCurrentInteractionMode() == interaction.Place
    points = widget.panel.session.annotations.points_node(selected.id, positive=True)
    assert selection.GetActivePlaceNodeID() == points.GetID()
