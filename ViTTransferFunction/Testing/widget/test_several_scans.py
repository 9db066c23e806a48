"""Several scans in one scene: the panel shows the structures of the one that is chosen."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import slicer
from PySide6.QtWidgets import QComboBox

from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Testing.support.scenes import FollowUp, add_volume, annotate
from ViTTransferFunction.Testing.support.spheres import Spheres
from ViTTransferFunction.Testing.support.standin.node_combo_box import qMRMLNodeComboBox
from ViTTransferFunction.Testing.support.widgets import wait_until

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]


@pytest.fixture
def follow_up(slicer_app: Any, spheres: Spheres) -> FollowUp:
    return FollowUp(slicer_app.scene, spheres)


def rows(ui: Any) -> list[tuple[str, str]]:
    """Names and numbers of points of the table."""
    from ViTTransferFunction.Widget.class_table import NAME, POSITIVE

    table = ui.classTable
    return [(table.item(row, NAME).text(), table.item(row, POSITIVE).text()) for row in range(table.rowCount())]


def test_the_table_shows_the_structures_of_the_scan_that_is_chosen(
    ready: Any, volume: Any, follow_up: FollowUp, spheres: Spheres
) -> None:
    ui, session = ready.ui, ready.panel.session
    annotate(session, spheres)
    session.annotations.add_points(session.classes[0].id, session.classes[1].positive, positive=False)
    of_baseline = rows(ui)
    assert of_baseline == [("sphere 1", "1"), ("sphere 2", "1"), ("sphere 3", "1")]
    ui.volumeSelector.setCurrentNode(follow_up.volume)
    assert rows(ui) == [("sphere 1", "0"), ("sphere 2", "0"), ("sphere 3", "0")]
    ui.classTable.selectRow(1)
    ui.removeClassButton.click()
    follow_up.click(session)
    assert rows(ui) == [("sphere 1", "1"), ("sphere 3", "1")]
    ui.volumeSelector.setCurrentNode(volume)
    assert rows(ui) == of_baseline
    assert not ui.messageLabel.text()
    ui.volumeSelector.setCurrentNode(None)
    assert rows(ui) == []
    assert not ui.pointOnButton.isEnabled()
    ui.volumeSelector.setCurrentNode(follow_up.volume)
    assert rows(ui) == [("sphere 1", "1"), ("sphere 3", "1")]


def test_the_tool_in_hand_works_on_the_scan_that_is_chosen(
    ready: Any, volume: Any, follow_up: FollowUp, spheres: Spheres, slicer_app: Any
) -> None:
    ui, session, selection = ready.ui, ready.panel.session, slicer_app.app_logic.GetSelectionNode()
    annotate(session, spheres)
    ui.pointOnButton.click()
    for chosen in (follow_up.volume, volume, follow_up.volume):
        ui.volumeSelector.setCurrentNode(chosen)
        assert ready.panel.tools.tool == "pointOn"
        points = session.annotations.points_node(session.selected_class.id, positive=True)
        assert selection.GetActivePlaceNodeID() == points.GetID()
        assert points.GetDisplayNode().GetVisibility()


def test_points_of_another_scan_are_added_by_a_menu_that_is_there_when_there_are_some(
    ready: Any, volume: Any, spheres: Spheres, slicer_app: Any
) -> None:
    ui, session = ready.ui, ready.panel.session
    volume.SetName("CT & contrast")
    annotate(session, spheres)
    assert ui.takeOverButton.isHidden()
    ui.volumeSelector.setCurrentNode(add_volume(slicer_app.scene, Volume(spheres[0].array, spheres[0].geometry, "part")))
    assert not ui.takeOverButton.isHidden()
    menu = ui.takeOverButton.menu()
    for _ in range(2):
        menu.aboutToShow.emit()
    (action,) = menu.actions()
    assert action.text() == "CT && contrast"
    action.trigger()
    assert rows(ui) == [("sphere 1", "1"), ("sphere 2", "1"), ("sphere 3", "1")]
    action.trigger()
    assert "all there already" in ui.messageLabel.text()
    ui.undoButton.click()
    assert rows(ui) == [("sphere 1", "0"), ("sphere 2", "0"), ("sphere 3", "0")]


def test_lists_of_scans_such_as_that_above_a_slice_view_have_scans_alone(ready: Any, volume: Any, spheres: Spheres) -> None:
    """Where the chosen scan is removed, they choose one beside it: the view would show what is not for users by itself."""
    of_view = qMRMLNodeComboBox()
    of_view.setProperty("nodeTypes", [f"vtkMRML{kind}VolumeNode" for kind in ("Scalar", "LabelMap", "Vector")])
    of_view.setMRMLScene(slicer.mrmlScene)
    shown = of_view.findChild(QComboBox)
    assert shown is not None
    annotate(ready.panel.session, spheres)
    wait_until(lambda: slicer.mrmlScene.GetNumberOfNodesByClass("vtkMRMLVolumeNode") == 3)
    assert [shown.itemText(index) for index in range(shown.count())] == [volume.GetName()]
    of_view.setMRMLScene(None)
