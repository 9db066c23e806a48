"""The panel's section about segments: what is asked before corrections are lost, and ways to go on with segments."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import slicer
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QMessageBox

from ViTTransferFunction.Logic.scene.views.rendering import DISPLAY_NAME
from ViTTransferFunction.Testing.support.scenes import add_segment, segment_masks
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras
from ViTTransferFunction.Testing.support.standin.host import NAME, Host
from ViTTransferFunction.Testing.support.widgets import add_class, place, wait_until

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]

SURFACE = "Closed surface"


@pytest.fixture
def segmentation(slicer_app: Any, spheres: Spheres) -> Any:
    """A colleague's segmentation, with one segment."""
    node = slicer_app.scene.AddNewNodeByClass("vtkMRMLSegmentationNode", "of a colleague")
    node.CreateDefaultDisplayNodes()
    add_segment(node, "sphere & more", spheres[1] == 3, spheres[0].geometry.ijk_to_ras)
    return node


@pytest.fixture
def questions(host: Host, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[tuple[str, ...]]]:
    """The questions that were asked about corrections; the first of `answers` is given to each."""
    from ViTTransferFunction.Widget import output_section

    asked: list[tuple[str, ...]] = []

    def answer(names: tuple[str, ...]) -> str | None:
        asked.append(names)
        return ANSWERS.pop(0)

    monkeypatch.setattr(output_section, "ask_about_corrections", answer)
    yield asked
    ANSWERS.clear()


ANSWERS: list[str | None] = []


def names_in(node: Any) -> list[str]:
    segmentation = node.GetSegmentation()
    return [segmentation.GetSegment(id_).GetName() for id_ in segmentation.GetSegmentIDs()]


def test_who_writes_segments_by_the_keyboard_can_write_them_again(ready: Any, host: Host, spheres: Spheres) -> None:
    add_class(ready, "sphere")
    place(ready, tuple(centre_ras(spheres, 1)[0]))
    button = ready.ui.writeSegmentsButton
    wait_until(button.isEnabled)
    host.window.activateWindow()
    button.setFocus()
    wait_until(button.hasFocus)
    QTest.keyClick(button, Qt.Key.Key_Space)
    wait_until(lambda: button.isHidden() or ready.panel.session.segments.exist)
    wait_until(lambda: ready.panel.session.segments.exist and not ready.panel.session.busy and not button.isHidden())
    assert button.hasFocus()


def test_a_question_is_asked_once_and_only_where_something_was_corrected(
    ready: Any, spheres: Spheres, questions: list[tuple[str, ...]]
) -> None:
    ui, session = ready.ui, ready.panel.session
    for label in (1, 2):
        add_class(ready, f"sphere {label}")
        place(ready, tuple(centre_ras(spheres, label)[0]))

    def update() -> None:
        ui.writeSegmentsButton.click()
        wait_until(lambda: not session.busy)
        # What is asked is asked when the event loop comes round.
        QApplication.processEvents()
        wait_until(lambda: not session.busy)

    update()
    update()
    assert questions == []
    node = session.parameters.segmentation
    segment_id = session.segments.of(session.classes[0].id)
    logic = slicer.vtkSlicerSegmentationsModuleLogic
    assert logic.ClearSegment(node, segment_id)
    ANSWERS.append(None)
    update()
    assert questions == [("sphere 1",)]
    assert names_in(node) == ["sphere 1", "sphere 2"]
    assert not segment_masks(node, session.parameters.volume)["sphere 1"].any()
    ANSWERS.append("keep")
    update()
    assert questions == [("sphere 1",)] * 2
    assert names_in(node) == ["sphere 1", "sphere 2", "sphere 1 (2)"]
    assert not segment_masks(node, session.parameters.volume)["sphere 1"].any()
    assert segment_masks(node, session.parameters.volume)["sphere 1 (2)"].any()
    update()
    assert len(questions) == 2
    assert logic.ClearSegment(node, session.segments.of(session.classes[0].id))
    ANSWERS.append("overwrite")
    update()
    assert questions[2:] == [("sphere 1 (2)",)]
    assert names_in(node) == ["sphere 1", "sphere 2", "sphere 1 (2)"]
    assert segment_masks(node, session.parameters.volume)["sphere 1 (2)"].any()


def test_segments_that_are_not_those_of_the_structures_are_said_to_be_so(ready: Any, spheres: Spheres) -> None:
    ui, session = ready.ui, ready.panel.session
    add_class(ready, "sphere 1")
    place(ready, tuple(centre_ras(spheres, 1)[0]))
    ui.writeSegmentsButton.click()
    wait_until(lambda: session.segments.exist and not session.busy)
    assert ui.segmentsOutdatedLabel.isHidden()
    ui.largerButton.click()
    assert not ui.segmentsOutdatedLabel.isHidden()
    assert ui.segmentsOutdatedLabel.text().startswith("Not in the segments yet")
    wait_until(lambda: not session.busy)
    ui.writeSegmentsButton.click()
    wait_until(lambda: not session.busy)
    assert ui.segmentsOutdatedLabel.isHidden()
    session.annotations.remove_class(session.classes[0].id)
    wait_until(lambda: not session.busy)
    assert ui.writeSegmentsButton.isEnabled()
    ui.writeSegmentsButton.click()
    wait_until(lambda: not session.busy)
    assert names_in(session.parameters.segmentation) == []
    assert not ui.writeSegmentsButton.isEnabled()


def test_segments_that_are_being_made_are_given_up_by_the_button_beside_their_progress(ready: Any, spheres: Spheres) -> None:
    ui, session = ready.ui, ready.panel.session
    add_class(ready, "sphere 1")
    place(ready, tuple(centre_ras(spheres, 1)[0]))
    wait_until(lambda: not session.busy)
    ui.writeSegmentsButton.click()
    assert (ui.writeSegmentsButton.isHidden(), ui.segmentationProgressRow.isHidden()) == (True, False)
    ui.segmentationCancelButton.click()
    wait_until(lambda: not session.busy)
    assert (ui.writeSegmentsButton.isHidden(), ui.segmentationProgressRow.isHidden()) == (False, True)
    assert not session.segments.exist
    assert not ui.messageLabel.text()


@pytest.mark.parametrize(
    ("pressed", "answer"),
    [("Keep corrections", "keep"), ("Overwrite corrections", "overwrite"), ("Cancel", None), ("", "keep")],
)
def test_the_question_names_the_segments_and_keeps_by_default(
    widget: Any, monkeypatch: pytest.MonkeyPatch, pressed: str, answer: str | None
) -> None:
    from ViTTransferFunction.Widget.output_section import ask_about_corrections

    monkeypatch.setattr(type(slicer.app), "testingEnabled", lambda self: False)
    seen: list[str] = []

    def press() -> None:
        box = next(top for top in QApplication.topLevelWidgets() if isinstance(top, QMessageBox) and top.isVisible())
        seen.append(box.text() if box.textFormat() == Qt.TextFormat.PlainText else "")
        button = next((button for button in box.buttons() if button.text() == pressed), box.defaultButton())
        button.click()

    QTimer.singleShot(0, press)
    assert ask_about_corrections(("liver <b>2</b>", "spleen")) == answer
    assert "liver <b>2</b>, spleen" in seen[0]


def test_a_tested_application_is_not_asked_and_keeps_corrections(widget: Any) -> None:
    from ViTTransferFunction.Widget.output_section import ask_about_corrections

    assert ask_about_corrections(("liver",)) == "keep"


def test_where_the_chosen_segmentation_is_deleted_none_of_others_gets_the_segments(
    widget: Any, segmentation: Any, slicer_app: Any
) -> None:
    chosen = slicer_app.scene.AddNewNodeByClass("vtkMRMLSegmentationNode")
    widget.ui.segmentationSelector.setCurrentNode(chosen)
    assert widget.panel.session.parameters.segmentation is chosen
    slicer_app.scene.RemoveNode(chosen)
    assert widget.panel.session.parameters.segmentation is None
    assert widget.ui.segmentationSelector.currentNode() is None


def test_segments_are_shown_in_3d_as_by_slicers_own_button(widget: Any, segmentation: Any) -> None:
    ui, segments = widget.ui, segmentation.GetSegmentation()
    assert not ui.show3DButton.isEnabled()
    widget.panel.session.set_segmentation(segmentation)
    assert ui.show3DButton.isEnabled()
    ui.show3DButton.click()
    assert segments.ContainsRepresentation(SURFACE)
    ui.show3DButton.click()
    assert not segments.ContainsRepresentation(SURFACE)
    segments.CreateRepresentation(SURFACE)
    widget.panel.refresh()
    assert ui.show3DButton.isChecked()


def test_segments_are_edited_by_hand_with_volume_and_segmentation_chosen(
    widget: Any, volume: Any, segmentation: Any, host: Host
) -> None:
    assert not widget.ui.editSegmentsButton.isEnabled()
    session = widget.panel.session
    session.set_volume(volume)
    session.set_segmentation(segmentation)
    add_class(widget)
    widget.ui.editSegmentsButton.click()
    assert slicer.util.selectedModule() == "SegmentEditor"
    assert not host.representation.isEntered
    assert widget.panel.tools.tool is None
    parameters = slicer.modules.segmenteditor.parameterSetNode
    assert parameters.GetSegmentationNode() is segmentation
    assert parameters.GetSourceVolumeNode() is volume


def test_the_segment_of_the_selected_structure_is_in_hand_in_the_segment_editor(ready: Any, spheres: Spheres) -> None:
    ui, session = ready.ui, ready.panel.session
    for label in (1, 2):
        add_class(ready, f"sphere {label}")
        place(ready, tuple(centre_ras(spheres, label)[0]))
    ui.writeSegmentsButton.click()
    wait_until(lambda: session.segments.exist and not session.busy)
    ui.editSegmentsButton.click()
    chosen = slicer.modules.segmenteditor.parameterSetNode.GetSelectedSegmentID()
    assert session.parameters.segmentation.GetSegmentation().GetSegment(chosen).GetName() == "sphere 2"


def test_while_the_segment_editor_is_open_maps_do_not_hide_what_is_cut_off_a_segment(ready: Any, spheres: Spheres) -> None:
    ui, session, modules = ready.ui, ready.panel.session, slicer.util.moduleSelector()
    add_class(ready, "sphere")
    place(ready, tuple(centre_ras(spheres, 1)[0]))
    wait_until(lambda: not session.busy)
    assert all(visibilities_of_maps())
    modules.selectModule("SegmentEditor")
    assert all(visibilities_of_maps())  # There is no segment that they could hide.
    modules.selectModule(NAME)
    ui.writeSegmentsButton.click()
    wait_until(lambda: session.segments.exist and not session.busy)
    assert all(visibilities_of_maps())
    ui.editSegmentsButton.click()
    assert not any(visibilities_of_maps())
    session.parameters.set("overlayOpacity", 0.25)
    wait_until(lambda: not session.busy)
    assert not any(visibilities_of_maps())
    modules.selectModule(NAME)
    wait_until(lambda: not session.busy)
    assert all(visibilities_of_maps())


def test_the_segment_editor_may_be_left_when_the_scene_was_closed(ready: Any, spheres: Spheres) -> None:
    modules = slicer.util.moduleSelector()
    add_class(ready, "sphere")
    place(ready, tuple(centre_ras(spheres, 1)[0]))
    ready.ui.writeSegmentsButton.click()
    wait_until(lambda: ready.panel.session.segments.exist and not ready.panel.session.busy)
    ready.ui.editSegmentsButton.click()
    slicer.mrmlScene.Clear(0)
    modules.selectModule(NAME)
    assert not ready.panel.session.views.give_way


def visibilities_of_maps() -> list[bool]:
    """Of the outlines in slices, and of the structures in 3D."""
    outlines = slicer.mrmlScene.GetFirstNodeByName("Similarity contours")
    rendering = slicer.mrmlScene.GetFirstNodeByName(DISPLAY_NAME)
    return [bool(display.GetVisibility()) for display in (outlines.GetDisplayNode(), rendering)]


def test_a_structure_begins_from_a_segment_of_the_menu(widget: Any, volume: Any, segmentation: Any, spheres: Spheres) -> None:
    ui, session = widget.ui, widget.panel.session
    assert not ui.continueSegmentButton.isEnabled()
    assert ui.segmentationSelectorLabel.text().rstrip(":") in ui.continueSegmentButton.toolTip()
    session.set_volume(volume)
    session.set_segmentation(segmentation)
    assert ui.continueSegmentButton.isEnabled()
    assert "begins with points in a segment" in ui.continueSegmentButton.toolTip()
    menu = ui.continueSegmentButton.menu()
    for _ in range(2):
        menu.aboutToShow.emit()
    (action,) = menu.actions()
    assert action.text() == "sphere && more"
    action.trigger()
    wait_until(lambda: bool(session.classes))
    (state,) = session.classes
    assert state.name == "sphere & more"
    kji = spheres[0].geometry.nearest_voxels(np.array(state.positive))
    assert (spheres[1][tuple(kji.T)] == 3).all()
    assert ui.undoButton.isEnabled()
    ui.undoButton.click()
    assert session.classes == ()
