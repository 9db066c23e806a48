"""The volume in the panel: which one is taken up, what is asked before a download, and of what the features are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import slicer
from PySide6.QtTest import QTest
from vtkmodules.util.vtkConstants import VTK_UNSIGNED_CHAR
from vtkmodules.vtkCommonDataModel import vtkImageData

from ViTTransferFunction.Logic.core.volumes.missing_intensity import without_intensity_text
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.scene.mrml.nodes import nodes_of_class
from ViTTransferFunction.Logic.scene.views.slice_layer import COMPOSITE_CLASS
from ViTTransferFunction.Testing.support.downloads import DOWNLOAD
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_features
from ViTTransferFunction.Testing.support.scenes import add_volume
from ViTTransferFunction.Testing.support.sequences import Sequence
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras
from ViTTransferFunction.Testing.support.standin.host import Host
from ViTTransferFunction.Testing.support.views import Views
from ViTTransferFunction.Testing.support.widgets import add_class, place, wait_until

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]


def show(volume: Any) -> None:
    """Have the views show a volume, as Slicer does with one that was loaded."""
    slicer.app.applicationLogic().GetSelectionNode().SetActiveVolumeID(volume.GetID())
    QTest.qWait(1)


def add_picture(slicer_app: Any, name: str) -> None:
    """A volume in colour, which the views show."""
    node = slicer_app.scene.AddNewNodeByClass("vtkMRMLVectorVolumeNode", name)
    image = vtkImageData()
    image.SetDimensions(4, 5, 6)
    image.AllocateScalars(VTK_UNSIGNED_CHAR, 3)
    node.SetAndObserveImageData(image)
    show(node)


def test_the_volume_in_the_views_is_chosen_from_the_start(host: Host, volume: Any, slicer_app: Any, spheres: Spheres) -> None:
    add_volume(slicer_app.scene, spheres[0])
    show(volume)
    assert host.open_panel().ui.volumeSelector.currentNode() is volume


def test_a_volume_that_is_loaded_later_is_taken_up(widget: Any, volume: Any) -> None:
    assert widget.panel.session.parameters.volume is None
    QTest.qWait(1)
    assert widget.ui.volumeSelector.currentNode() is volume


def test_of_series_that_are_loaded_while_the_module_is_left_the_one_that_is_shown_is_taken_up(
    widget: Any, host: Host, slicer_app: Any, spheres: Spheres
) -> None:
    """Slicer's module DICOM shows each in turn, and lets the application run in between."""
    host.representation.exit()
    for _ in range(2):
        last = add_volume(slicer_app.scene, spheres[0])
        show(last)
    host.representation.enter()
    assert widget.ui.volumeSelector.currentNode() is last


def test_a_volume_that_is_loaded_later_replaces_none_that_was_chosen(
    widget: Any, volume: Any, slicer_app: Any, spheres: Spheres
) -> None:
    widget.ui.volumeSelector.setCurrentNode(volume)
    show(add_volume(slicer_app.scene, spheres[0]))
    assert widget.ui.volumeSelector.currentNode() is volume


def test_who_chooses_no_volume_has_none_until_another_one_is_shown(
    widget: Any, volume: Any, slicer_app: Any, spheres: Spheres
) -> None:
    show(volume)
    widget.ui.volumeSelector.setCurrentNode(None)
    show(volume)
    add_class(widget)
    QTest.qWait(1)
    assert widget.panel.session.parameters.volume is None
    other = add_volume(slicer_app.scene, spheres[0])
    show(other)
    assert widget.panel.session.parameters.volume is other


def test_why_a_colour_volume_cannot_be_chosen_is_told_until_a_scan_is_there(
    widget: Any, slicer_app: Any, spheres: Spheres
) -> None:
    """Slicer's selector does not list it, and says nothing."""
    for name in ("photograph", "picture"):
        add_picture(slicer_app, name)
        assert f"'{name}' has 3 numbers in each voxel" in widget.ui.messageLabel.text()
    assert "photograph" not in widget.ui.messageLabel.text(), "it is not in the views any more"
    assert widget.ui.volumeSelector.currentNode() is None
    widget.panel.refresh()
    assert widget.ui.messageFrame.isVisible()
    show(add_volume(slicer_app.scene, spheres[0]))
    assert not widget.ui.messageFrame.isVisible()


@pytest.mark.parametrize("until", ["a scan is there", "the scene is closed"])
def test_why_a_label_map_cannot_be_chosen_is_told_until(widget: Any, slicer_app: Any, spheres: Spheres, until: str) -> None:
    """Slicer has another place for the label map in the views (`qSlicerVolumesReader`)."""
    node = slicer_app.scene.AddNewNodeByClass("vtkMRMLLabelMapVolumeNode", "liver labels")
    image = vtkImageData()
    image.SetDimensions(4, 5, 6)
    image.AllocateScalars(VTK_UNSIGNED_CHAR, 1)
    node.SetAndObserveImageData(image)
    slicer.app.applicationLogic().GetSelectionNode().SetActiveLabelVolumeID(node.GetID())
    QTest.qWait(1)
    assert "'liver labels' is a label map" in widget.ui.messageLabel.text()
    assert widget.panel.session.parameters.volume is None
    if until == "a scan is there":
        show(add_volume(slicer_app.scene, spheres[0]))
    else:
        slicer_app.scene.Clear(False)
    assert not widget.ui.messageFrame.isVisible()


def test_why_a_colour_volume_cannot_be_chosen_is_told_until_a_scan_is_chosen_in_its_place(
    widget: Any, volume: Any, slicer_app: Any, spheres: Spheres
) -> None:
    add_volume(slicer_app.scene, spheres[0])
    add_picture(slicer_app, "picture")
    assert widget.ui.messageFrame.isVisible()
    widget.ui.volumeSelector.setCurrentNode(volume)
    assert not widget.ui.messageFrame.isVisible()


def test_beside_a_volume_that_is_chosen_nothing_is_told_of_a_colour_volume(widget: Any, volume: Any, slicer_app: Any) -> None:
    QTest.qWait(1)
    assert widget.ui.volumeSelector.currentNode() is volume
    node = slicer_app.scene.AddNewNodeByClass("vtkMRMLVectorVolumeNode")
    image = vtkImageData()
    image.AllocateScalars(VTK_UNSIGNED_CHAR, 3)
    node.SetAndObserveImageData(image)
    show(node)
    assert not widget.ui.messageFrame.isVisible()


def test_the_views_show_the_scan_that_is_chosen(widget: Any, volume: Any, slicer_app: Any) -> None:
    view = shown_elsewhere(slicer_app)
    widget.ui.volumeSelector.setCurrentNode(volume)
    assert view.get_background_volume_id() == volume.GetID()


def test_with_a_tool_in_hand_it_is_told_once_that_the_views_show_another_scan(
    widget: Any, volume: Any, slicer_app: Any
) -> None:
    widget.ui.volumeSelector.setCurrentNode(volume)
    view = shown_elsewhere(slicer_app)
    told = f"No slice view shows '{volume.GetName()}'"
    assert told not in widget.ui.messageLabel.text()
    add_class(widget)
    assert widget.panel.tools.tool == "pointOn"
    assert told in widget.ui.messageLabel.text()
    widget.ui.messageCloseButton.click()
    widget.panel.refresh()
    assert told not in widget.ui.messageLabel.text()
    widget.ui.pointOnButton.click()
    widget.ui.pointOnButton.click()
    assert told in widget.ui.messageLabel.text()
    view.set_background_volume_id(volume.GetID())
    widget.panel.refresh()
    assert told not in widget.ui.messageLabel.text()


def test_it_is_told_before_the_next_click_when_another_scan_is_loaded_with_a_tool_in_hand(
    widget: Any, volume: Any, slicer_app: Any
) -> None:
    ui = widget.ui
    ui.volumeSelector.setCurrentNode(volume)
    add_class(widget)
    wait_until(lambda: not widget.panel.session.busy)
    view = shown_elsewhere(slicer_app)
    wait_until(lambda: f"No slice view shows '{volume.GetName()}'" in ui.messageLabel.text())
    view.set_background_volume_id(volume.GetID())
    wait_until(lambda: not ui.messageFrame.isVisible())


def shown_elsewhere(slicer_app: Any) -> Any:
    """A slice view of the layout that shows another scan."""
    view = Views(slicer_app).slice_view()
    view.get_view_node().SetMappedInLayout(True)
    return view


def test_another_scan_that_is_chosen_does_not_stay_small_in_the_views(
    widget: Any, volume: Any, slicer_app: Any, spheres: Spheres
) -> None:
    widget.ui.volumeSelector.setCurrentNode(volume)
    seen, other = shown_elsewhere(slicer_app).get_view_node(), add_volume(slicer_app.scene, spheres[0])
    for composite in nodes_of_class(slicer_app.scene, COMPOSITE_CLASS):
        composite.SetBackgroundVolumeID(other.GetID())
    seen.SetFieldOfView(5000.0, 5000.0, 1.0)
    widget.ui.volumeSelector.setCurrentNode(other)
    assert seen.GetFieldOfView()[0] < 500.0


def test_a_name_with_which_slicer_opens_no_saved_scene_is_told_once_until_it_is_another(widget: Any, volume: Any) -> None:
    message = widget.ui.messageLabel
    volume.SetName("CT Head & Neck")
    widget.ui.volumeSelector.setCurrentNode(volume)
    assert "such as CT Head & Neck" in message.text()
    widget.ui.messageCloseButton.click()
    add_class(widget)
    assert not message.text()
    volume.SetName("CT Head & Chest")
    assert "such as CT Head & Chest" in message.text()
    volume.SetName("CT Head and Neck")
    assert not message.text()


def test_of_several_volumes_none_is_guessed(widget: Any, volume: Any, slicer_app: Any, spheres: Spheres) -> None:
    add_volume(slicer_app.scene, spheres[0])
    QTest.qWait(1)
    assert widget.panel.session.parameters.volume is None


@pytest.mark.parametrize("chosen", range(3))
def test_where_the_chosen_volume_is_deleted_no_other_one_takes_its_place(
    widget: Any, slicer_app: Any, spheres: Spheres, chosen: int
) -> None:
    volumes = [add_volume(slicer_app.scene, spheres[0]) for _ in range(3)]
    widget.ui.volumeSelector.setCurrentNode(volumes[chosen])
    slicer_app.scene.RemoveNode(volumes[chosen])
    assert widget.panel.session.parameters.volume is None
    assert widget.ui.volumeSelector.currentNode() is None


def test_what_a_download_is_and_that_this_is_research_is_said_before_it(host: Host) -> None:
    from ViTTransferFunction.Logic.scene.feature_wording import download_question

    question = download_question(DOWNLOAD)
    for fact in (
        "dinov2_vits14 (https://github.com/facebookresearch/dinov2)",
        "Licence: Apache-2.0",
        "88 MB",
        "SHA-256: b938bf1bc15c",
        "from dl.fbaipublicfiles.com",
        "/cache/weights/dinov2_vits14_pretrain.pth",
        "choose it under Advanced, Weights",
        "research use only",
        "not a medical device",
    ):
        assert fact in question


def test_who_declines_a_download_is_where_they_were(widget: Any, volume: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def decline(text: str, title: str) -> bool:
        asked.append(text)
        return False

    monkeypatch.setattr(slicer.util, "confirmOkCancelDisplay", decline)
    widget.ui.volumeSelector.setCurrentNode(volume)
    widget.ui.extractButton.click()
    wait_until(lambda: bool(asked))
    QTest.qWait(50)
    session = widget.panel.session
    assert session.phase == "no features"
    assert not session.busy
    assert not widget.ui.messageFrame.isVisible()
    assert widget.ui.extractButton.isEnabled()
    assert len(asked) == 1


def test_a_download_is_asked_about_once(
    widget: Any, volume: Any, questions: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    session, started = widget.panel.session, []
    monkeypatch.setattr(session, "start_extraction", lambda: started.append("extraction"))
    widget.ui.volumeSelector.setCurrentNode(volume)
    for count in (1, 2):
        widget.ui.extractButton.click()
        wait_until(lambda count=count: len(started) == count)  # type: ignore[misc]
    assert len(questions) == 1


def test_nothing_looks_begun_while_a_download_is_asked_about(widget: Any, volume: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[tuple[bool, bool]] = []

    def decline(text: str, windowTitle: str = "") -> bool:
        shown.append((widget.ui.extractionStartRow.isVisible(), widget.ui.extractionProgressRow.isVisible()))
        return False

    monkeypatch.setattr(slicer.util, "confirmOkCancelDisplay", decline)
    widget.ui.volumeSelector.setCurrentNode(volume)
    widget.ui.extractButton.click()
    wait_until(lambda: bool(shown))
    assert shown == [(True, False)]


def test_nothing_is_begun_for_another_volume_that_is_chosen_while_a_download_is_asked_about(
    widget: Any, volume: Any, slicer_app: Any, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    session, asked, started = widget.panel.session, [], []
    other = add_volume(slicer_app.scene, spheres[0])

    def agree(text: str, windowTitle: str = "") -> bool:
        asked.append(text)
        widget.ui.volumeSelector.setCurrentNode(other)
        return True

    monkeypatch.setattr(slicer.util, "confirmOkCancelDisplay", agree)
    monkeypatch.setattr(session, "start_extraction", lambda: started.append("extraction"))
    widget.ui.volumeSelector.setCurrentNode(volume)
    widget.ui.extractButton.click()
    wait_until(lambda: bool(asked))
    assert started == []


def test_what_was_pressed_and_cancelled_before_its_cost_is_known_is_not_begun(
    widget: Any, volume: Any, questions: list[str]
) -> None:
    session = widget.panel.session
    widget.ui.volumeSelector.setCurrentNode(volume)
    widget.ui.extractButton.click()
    widget.ui.extractionCancelButton.click()
    assert widget.ui.extractionStartRow.isVisible()
    wait_until(lambda: session.estimate is not None and not session.busy)
    QTest.qWait(1)
    assert questions == []


def test_nothing_follows_a_press_once_the_module_is_unloaded(widget: Any, volume: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """By then, the widgets are gone."""
    from ViTTransferFunction.Widget.volume_section import VolumeSection

    widget.ui.volumeSelector.setCurrentNode(volume)
    widget.ui.extractButton.click()
    slicer.app.moduleManager().unload("ViTTransferFunction")
    refreshed: list[VolumeSection] = []
    monkeypatch.setattr(VolumeSection, "refresh", lambda section: refreshed.append(section))
    QTest.qWait(1)
    assert refreshed == []


def test_what_was_pressed_for_one_volume_is_not_done_for_the_next(
    widget: Any, volume: Any, slicer_app: Any, spheres: Spheres, questions: list[str]
) -> None:
    session, other = widget.panel.session, add_volume(slicer_app.scene, spheres[0])
    widget.ui.volumeSelector.setCurrentNode(volume)
    widget.ui.extractButton.click()
    widget.ui.volumeSelector.setCurrentNode(other)
    assert widget.ui.extractButton.isVisible()
    wait_until(lambda: session.estimate is not None and not session.busy)
    QTest.qWait(1)
    assert session.phase == "no features"
    assert questions == []


@pytest.mark.slow
def test_nothing_is_asked_where_nothing_is_downloaded(
    widget: Any, volume: Any, questions: list[str], real_weights: Path
) -> None:
    widget.panel.session.parameters.set("weightsPath", str(real_weights))
    widget.ui.volumeSelector.setCurrentNode(volume)
    widget.ui.extractButton.click()
    wait_until(lambda: widget.panel.session.phase == "extracting")
    widget.ui.extractionCancelButton.click()
    assert questions == []


def test_after_weights_were_refused_the_button_looks_for_them_again(
    widget: Any, volume: Any, questions: list[str], tmp_path: Path
) -> None:
    session, ui = widget.panel.session, widget.ui
    missing = tmp_path / "weights"
    session.parameters.set("weightsPath", str(missing))
    ui.volumeSelector.setCurrentNode(volume)
    wait_until(lambda: ui.messageFrame.isVisible())
    assert "There is no weights file" in ui.messageLabel.text()
    ui.extractButton.click()
    assert not ui.messageFrame.isVisible()
    assert ui.extractionStartRow.isHidden()
    wait_until(lambda: ui.messageFrame.isVisible() and ui.extractionStartRow.isVisible())
    assert ui.estimateLabel.text() == "", "nothing is being estimated"
    missing.mkdir()
    ui.extractButton.click()
    wait_until(lambda: ui.messageFrame.isVisible() and "holds no weights" in ui.messageLabel.text())
    session.parameters.set("weightsPath", "")
    assert not ui.messageFrame.isVisible()


@pytest.mark.slow
def test_a_scene_that_is_added_leaves_volume_and_segmentation_as_they_were_chosen(
    ready: Any, volume: Any, slicer_app: Any, tmp_path: Path
) -> None:
    theirs = type(slicer_app)()
    theirs.scene.AddNewNodeByClass("vtkMRMLModelNode", "theirs")
    assert theirs.scene.WriteToMRB(str(tmp_path / "theirs.mrb"))
    session, ui = ready.panel.session, ready.ui
    segmentation = slicer_app.scene.AddNewNodeByClass("vtkMRMLSegmentationNode", "mine")
    ui.segmentationSelector.setCurrentNode(segmentation)
    assert slicer_app.scene.ReadFromMRB(str(tmp_path / "theirs.mrb"))
    wait_until(lambda: session.phase == "ready")
    assert slicer_app.scene.GetFirstNodeByName("theirs") is not None
    assert (session.parameters.volume, session.parameters.segmentation) == (volume, segmentation)
    assert (ui.volumeSelector.currentNode(), ui.segmentationSelector.currentNode()) == (volume, segmentation)
    ui.volumeSelector.setCurrentNode(None)
    assert session.parameters.volume is None


def test_points_beyond_the_volume_are_told_until_they_are_gone(ready: Any, spheres: Spheres) -> None:
    label = ready.ui.pointWarningsLabel
    add_class(ready, "liver")
    place(ready, tuple(centre_ras(spheres, 1)[0]))
    assert not label.isVisible()
    place(ready, (1000.0, 0.0, 0.0))
    assert label.text() == "⚠ liver: 1 point outside the volume does not count."
    place(ready, (2000.0, 0.0, 0.0))
    assert label.text() == "⚠ liver: 2 points outside the volume do not count."
    assert label.isVisible()
    ready.ui.removeLastButton.click()
    ready.ui.removeLastButton.click()
    assert not label.isVisible()


def test_points_where_the_scan_was_masked_are_told_until_they_are_gone(widget: Any, slicer_app: Any, spheres: Spheres) -> None:
    (volume, labels), label = spheres, widget.ui.pointWarningsLabel
    masked = replace(volume, array=np.where(labels == 2, np.nan, volume.array).astype(np.float32))
    widget.ui.volumeSelector.setCurrentNode(add_volume(slicer_app.scene, masked))
    annotations, id_ = widget.panel.session.annotations, add_class(widget, "liver").id
    annotations.add_points(id_, centre_ras(spheres, 1), positive=True)
    annotations.add_points(id_, centre_ras(spheres, 2), positive=False)
    assert label.isHidden()
    annotations.add_points(id_, centre_ras(spheres, 2), positive=True)
    assert label.text() == f"⚠ liver: {without_intensity_text(1)}"
    annotations.add_points(id_, centre_ras(spheres, 2), positive=True)
    assert label.text() == f"⚠ liver: {without_intensity_text(2)}"
    assert label.isVisible()
    annotations.undo()
    annotations.undo()
    assert label.isHidden()


def test_who_clicks_without_features_is_told_what_is_missing(widget: Any, volume: Any) -> None:
    ui, session = widget.ui, widget.panel.session
    ui.volumeSelector.setCurrentNode(volume)
    wait_until(lambda: session.phase == "no features" and session.estimate is not None and not session.busy)
    add_class(widget)
    assert ui.extractionStatusLabel.isHidden()
    place(widget, (0.0, 0.0, 0.0))
    assert ui.extractionStatusLabel.text() == "Points show their structure once the features are computed."
    assert ui.extractionStatusLabel.isVisible()
    session.annotations.undo()
    assert ui.extractionStatusLabel.isHidden()


@pytest.fixture
def sequence(slicer_app: Any, spheres: Spheres) -> Sequence:
    volume, labels = spheres
    cache_known_features(volume, labels)
    return Sequence(slicer_app.scene, [volume, Volume(volume.array + 1.0, volume.geometry, volume.name)])


def test_the_panel_says_of_which_frame_the_features_are(widget: Any, sequence: Sequence) -> None:
    ui, session = widget.ui, widget.panel.session
    session.parameters.set("grid", GRID)
    ui.volumeSelector.setCurrentNode(sequence.volume)
    wait_until(lambda: session.phase == "ready")
    assert ui.extractionStatusLabel.text() == "✔ Features are ready: Frame 1 of 2"
    sequence.show(2)
    assert ui.extractionStatusLabel.text().startswith("The image has changed")
    wait_until(lambda: session.phase == "no features" and session.estimate is not None)
    assert ui.estimateLabel.text().startswith("Frame 2 of 2: ")
    sequence.show(1)
    wait_until(lambda: session.phase == "ready")
    assert ui.extractionStatusLabel.text() == "✔ Features are ready: Frame 1 of 2"
