"""The panel while the compute process works for it: progress, cancelling, results, and a window that always reacts."""

from __future__ import annotations

import itertools
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import slicer
from PySide6.QtCore import QEventLoop, QObject, Qt, QTimerEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QScrollArea

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.scene.classes.class_nodes import class_nodes_of_all
from ViTTransferFunction.Logic.scene.classes.of_volume import volume_of
from ViTTransferFunction.Testing.support.known_features import GRID
from ViTTransferFunction.Testing.support.scenes import add_volume
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras
from ViTTransferFunction.Testing.support.standin.host import Host
from ViTTransferFunction.Testing.support.widgets import add_class, place, text, wait_until

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]

POLL_MS = 10
"""How often the panel asks the compute process for news."""
SLOW_BEATS = 100
OF_A_FREE_LOOP = 4.0
"""How often the quick one of two timers fires for each time that the slow one does, at least, where the loop is free."""
PATIENCE_S = 300.0


@pytest.mark.slow
def test_buttons_are_enabled_as_they_become_useful(ready: Any, spheres: Spheres) -> None:
    ui = ready.ui
    assert not ui.writeSegmentsButton.isEnabled()
    add_class(ready)
    assert all(getattr(ui, f"{name}Button").isEnabled() for name in ("pointOn", "pointOff", "brushOn", "brushOff", "eraser"))
    assert ui.removeClassButton.isEnabled()
    assert ui.undoButton.isEnabled()
    assert not ui.redoButton.isEnabled()
    assert not ui.removeLastButton.isEnabled()
    assert not ui.writeSegmentsButton.isEnabled()
    place(ready, tuple(centre_ras(spheres, 1)[0]))
    assert ui.removeLastButton.isEnabled()
    assert ui.writeSegmentsButton.isEnabled()


@pytest.mark.slow
def test_what_features_cost_is_shown_before_they_are_computed(widget: Any, volume: Any) -> None:
    widget.ui.volumeSelector.setCurrentNode(volume)
    wait_until(lambda: widget.panel.session.estimate is not None)
    assert "of memory" in widget.ui.estimateLabel.text()
    assert widget.ui.extractButton.isEnabled()


@pytest.mark.slow
def test_a_running_extraction_shows_its_progress_and_can_be_cancelled(widget: Any, volume: Any, questions: list[str]) -> None:
    widget.ui.volumeSelector.setCurrentNode(volume)
    widget.ui.extractButton.click()
    assert widget.ui.extractionProgressRow.isVisible()
    assert not widget.ui.extractionStartRow.isVisible()
    widget.ui.extractionCancelButton.click()
    wait_until(lambda: widget.panel.session.phase == "no features")
    assert widget.ui.extractionStartRow.isVisible()


def test_an_error_is_shown_once_in_the_panel(widget: Any, slicer_app: Any, spheres: Spheres) -> None:
    constant = add_volume(slicer_app.scene, spheres[0])
    slicer.util.arrayFromVolume(constant)[:] = 7
    widget.ui.volumeSelector.setCurrentNode(constant)
    wait_until(lambda: widget.ui.messageFrame.isVisible())
    assert "is constant: every finite voxel is 7" in widget.ui.messageLabel.text()
    assert widget.ui.estimateLabel.text() == "This volume cannot be used as it is."
    widget.ui.messageCloseButton.click()
    widget.panel.refresh()
    assert not widget.ui.messageFrame.isVisible()


def test_an_error_of_a_volume_goes_with_it(widget: Any, slicer_app: Any, spheres: Spheres) -> None:
    constant = add_volume(slicer_app.scene, spheres[0])
    slicer.util.arrayFromVolume(constant)[:] = 7
    widget.ui.volumeSelector.setCurrentNode(constant)
    wait_until(lambda: widget.ui.messageFrame.isVisible())
    slicer.util.arrayFromVolume(constant)[0] = 8
    slicer.util.arrayFromVolumeModified(constant)
    wait_until(lambda: not widget.ui.messageFrame.isVisible())
    wait_until(lambda: widget.panel.session.phase == "no features")


@pytest.mark.slow
def test_without_a_map_there_is_no_threshold_to_see_or_to_set(ready: Any, spheres: Spheres) -> None:
    """Not that of the structure that was selected before, nor the one that the slider begins with."""
    ui, session = ready.ui, ready.panel.session

    def shows_threshold() -> set[bool]:
        return {ui.thresholdSlider.isEnabled(), ui.thresholdSlider.spinBoxVisible, ui.thresholdAutomaticCheckBox.isEnabled()}

    assert shows_threshold() == {False}
    clicked = add_class(ready)
    assert shows_threshold() == {False}
    place(ready, tuple(centre_ras(spheres, 1)[0]))
    wait_until(lambda: session.chosen_iso(clicked.id) is not None)
    assert shows_threshold() == {True}
    add_class(ready)
    assert shows_threshold() == {False}
    session.select_class(clicked.id)
    assert shows_threshold() == {True}


@pytest.mark.slow
def test_the_threshold_is_automatic_until_it_is_touched_and_can_become_so_again(ready: Any, spheres: Spheres) -> None:
    ui, session = ready.ui, ready.panel.session
    state = add_class(ready)
    place(ready, tuple(centre_ras(spheres, 1)[0]))
    wait_until(lambda: session.chosen_iso(state.id) is not None)
    chosen = session.chosen_iso(state.id)
    assert ui.thresholdSlider.value == pytest.approx(chosen, abs=1e-3)
    assert text(ui.classTable, 0, 5) == f"({chosen:.2f})"
    ui.thresholdSlider.value = 0.875
    assert session.classes[0].iso == 0.875
    assert not ui.thresholdAutomaticCheckBox.isChecked()
    assert text(ui.classTable, 0, 5) == "0.88"
    ui.thresholdAutomaticCheckBox.click()
    assert session.classes[0].iso is None


def test_segments_are_written_where_the_user_says_and_updated_there(ready: Any, spheres: Spheres) -> None:
    ui, session = ready.ui, ready.panel.session
    add_class(ready, "sphere")
    place(ready, tuple(centre_ras(spheres, 1)[0]))
    segmentation = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLSegmentationNode", "mine")
    ui.segmentationSelector.setCurrentNode(segmentation)
    assert ui.writeSegmentsButton.text() == "Create segments"
    wait_until(lambda: not session.busy)
    ui.writeSegmentsButton.click()
    wait_until(lambda: not session.busy)
    assert segmentation.GetSegmentation().GetNthSegment(0).GetName() == "sphere"
    assert ui.writeSegmentsButton.text() == "Update segments"


def test_the_compute_process_starts_a_moment_after_the_panel_was_opened_and_ends_with_it(host: Host) -> None:
    widget = host.open_panel()
    session = widget.panel.session
    assert session.compute_pid is None
    wait_until(lambda: session.compute_pid is not None)
    slicer.mrmlScene.Clear()
    assert session.compute_pid is None
    assert widget.panel.session.compute_pid is None


def test_who_computes_features_by_the_keyboard_goes_on_by_it(widget: Any, host: Host, volume: Any, real_weights: Path) -> None:
    session, ui = widget.panel.session, widget.ui
    session.parameters.set("weightsPath", str(real_weights))
    ui.volumeSelector.setCurrentNode(volume)
    wait_until(ui.extractButton.isEnabled)
    host.window.activateWindow()
    ui.extractButton.setFocus()
    wait_until(ui.extractButton.hasFocus)
    QTest.keyClick(ui.extractButton, Qt.Key.Key_Space)
    wait_until(ui.extractionCancelButton.hasFocus)
    QTest.keyClick(ui.extractionCancelButton, Qt.Key.Key_Space)
    wait_until(lambda: session.phase == "no features" and not session.busy)
    wait_until(ui.extractButton.hasFocus)
    # Of so many cells, they take a moment; those of `GRID` are in the cache.
    session.parameters.set("grid", 20)
    wait_until(lambda: session.estimate is not None and ui.extractButton.isEnabled())
    QTest.keyClick(ui.extractButton, Qt.Key.Key_Space)
    wait_until(ui.extractionCancelButton.hasFocus)
    wait_until(lambda: session.phase == "ready")
    wait_until(ui.addClassButton.hasFocus)


def test_the_panel_is_not_scrolled_when_features_are_computed(widget: Any, host: Host, volume: Any, real_weights: Path) -> None:
    session, ui = widget.panel.session, widget.ui
    session.parameters.set("weightsPath", str(real_weights))
    ui.volumeSelector.setCurrentNode(volume)
    wait_until(ui.extractButton.isEnabled)
    host.window.resize(host.window.width(), 260)
    host.window.activateWindow()
    ui.extractButton.setFocus()
    wait_until(ui.extractButton.hasFocus)
    area = host.window.centralWidget()
    assert isinstance(area, QScrollArea)
    bar = area.verticalScrollBar()
    wait_until(lambda: bar.maximum() > 0)
    bar.setValue(0)
    QTest.mouseClick(ui.extractButton, Qt.MouseButton.LeftButton)
    wait_until(ui.extractionCancelButton.hasFocus)
    assert bar.value() == 0
    QTest.mouseClick(ui.extractionCancelButton, Qt.MouseButton.LeftButton)
    wait_until(lambda: session.phase == "no features" and not session.busy)
    assert bar.value() == 0


def test_closing_the_scene_while_features_are_computed_cancels_it(widget: Any, volume: Any, questions: list[str]) -> None:
    session = widget.panel.session
    widget.ui.volumeSelector.setCurrentNode(volume)
    widget.ui.extractButton.click()
    wait_until(lambda: session.phase == "extracting")
    slicer.mrmlScene.Clear()
    assert session.compute_pid is None
    assert widget.panel.session is not session
    assert widget.ui.volumeSelector.currentNode() is None
    assert widget.ui.extractionStartRow.isVisible()
    assert widget.ui.classTable.rowCount() == 0
    add_class(widget)
    assert len(widget.panel.session.classes) == 1


@pytest.mark.slow
@pytest.mark.parametrize("elsewhere", [False, True])
def test_a_scene_that_is_opened_in_place_of_another_carries_on_where_it_was_saved(
    ready: Any, host: Host, spheres: Spheres, tmp_path: Path, elsewhere: bool
) -> None:
    add_class(ready, "sphere")
    place(ready, tuple(centre_ras(spheres, 1)[0]))
    assert slicer.mrmlScene.WriteToMRB(str(tmp_path / "yesterday.mrb"))
    add_class(ready, "of today")
    if elsewhere:
        host.representation.exit()
    assert slicer.mrmlScene.ReadFromMRB(str(tmp_path / "yesterday.mrb"), True)
    if elsewhere:
        host.representation.enter()
    session = ready.panel.session
    wait_until(lambda: session.phase == "ready" and not session.busy)
    assert ready.ui.volumeSelector.currentNode().GetName() == "spheres"
    assert [text(ready.ui.classTable, row, 1) for row in range(ready.ui.classTable.rowCount())] == ["sphere"]
    assert text(ready.ui.classTable, 0, 6) != "–"
    assert not ready.ui.undoButton.isEnabled()


@pytest.mark.slow
@pytest.mark.parametrize("elsewhere", [False, True])
def test_a_scene_that_is_added_to_another_leaves_what_is_worked_on(
    ready: Any, host: Host, volume: Any, spheres: Spheres, tmp_path: Path, elsewhere: bool
) -> None:
    add_class(ready, "sphere")
    place(ready, tuple(centre_ras(spheres, 1)[0]))
    assert slicer.mrmlScene.WriteToMRB(str(tmp_path / "yesterday.mrb"))
    add_class(ready, "of today")
    ready.panel.session.parameters.set("onlyAnnotatedParts", False)
    if elsewhere:
        host.representation.exit()
    assert slicer.mrmlScene.ReadFromMRB(str(tmp_path / "yesterday.mrb"), False)
    if elsewhere:
        host.representation.enter()
    session = ready.panel.session
    wait_until(lambda: session.phase == "ready" and not session.busy)
    assert ready.ui.volumeSelector.currentNode() is volume
    names = [text(ready.ui.classTable, row, 1) for row in range(ready.ui.classTable.rowCount())]
    assert names == ["sphere", "of today"]
    assert session.selected_class.name == "of today"
    assert not ready.ui.onlyAnnotatedPartsCheckBox.isChecked()
    assert not ready.ui.messageLabel.text()
    added = volume_of(class_nodes_of_all(session.parameters.node)[-1])
    ready.ui.volumeSelector.setCurrentNode(added)
    assert [state.name for state in session.classes] == ["sphere"]


@pytest.mark.slow
def test_features_arrive_also_while_the_user_is_in_another_module(widget: Any, host: Host, volume: Any) -> None:
    widget.ui.volumeSelector.setCurrentNode(volume)
    host.representation.exit()
    widget.panel.session.parameters.set("grid", GRID)
    wait_until(lambda: widget.panel.session.phase == "ready")
    host.representation.enter()
    assert widget.ui.extractionStatusLabel.isVisible()
    assert not widget.ui.extractionStartRow.isVisible()
    assert not widget.ui.extractionProgressRow.isVisible()


def test_the_application_ends_while_features_are_computed(host: Host, volume: Any) -> None:
    widget = host.open_panel()
    session = widget.panel.session
    widget.ui.volumeSelector.setCurrentNode(volume)
    widget.ui.extractButton.click()
    slicer.app.moduleManager().unload("ViTTransferFunction")
    assert session.compute_pid is None
    assert widget.panel.shortcuts.installed == []


class Beats(QObject):
    """Two timers of the event loop, one as frequent as can be and one as frequent as the panel asks for news.

    Where the loop is free, the quick one fires many times for each time that the slow one does. Where it stands still, both are
    overdue when it goes on, and fire once each. That does not depend on how fast the computer is; but the loop stands still as
    well where others use it so much that this program gets no time for a while.
    """

    def __init__(self) -> None:
        super().__init__()
        self._loop = QEventLoop()
        self._quick, self._slow = self.startTimer(1), self.startTimer(POLL_MS)
        self._count: Counter[int] = Counter()

    def timerEvent(self, event: QTimerEvent) -> None:  # noqa: N802
        self._count[event.timerId()] += 1
        if self._count[self._slow] == SLOW_BEATS:
            self._loop.quit()

    def quick_for_each_slow(self) -> float:
        """Let the application run until the slow timer has fired often; how often the quick one did for each time."""
        self._count.clear()
        self._loop.exec()
        return self._count[self._quick] / self._count[self._slow]


def test_the_window_never_stands_still_while_features_are_computed(
    widget: Any, slicer_app: Any, spheres: Spheres, real_weights: Path
) -> None:
    array = np.tile(spheres[0].array, (3, 3, 3))
    volume = add_volume(slicer_app.scene, Volume(array, Geometry(array.shape, spheres[0].geometry.ijk_to_ras), "large"))
    widget.panel.session.parameters.set("weightsPath", str(real_weights))
    widget.ui.volumeSelector.setCurrentNode(volume)
    beats = Beats()
    until = time.monotonic() + PATIENCE_S
    # Cells of another number each time, whose features are not cached.
    for cells in itertools.count(48):
        of_a_free_loop = beats.quick_for_each_slow()
        if of_a_free_loop >= OF_A_FREE_LOOP:
            measured = beats_while_extracting(widget, beats, cells)
            if max(measured) > 0.5 * of_a_free_loop:
                return
            assert beats.quick_for_each_slow() < OF_A_FREE_LOOP, f"{measured} instead of {of_a_free_loop}"
        assert time.monotonic() < until, "other programs use the processors so much that any loop stands still"


def beats_while_extracting(widget: Any, beats: Beats, cells: int) -> list[float]:
    """How often the quick timer fired for each time that the slow one did, again and again until there are features."""
    session = widget.panel.session
    session.parameters.set("grid", cells)
    wait_until(lambda: session.phase == "no features" and widget.ui.extractButton.isEnabled())
    widget.ui.extractButton.click()
    wait_until(lambda: session.progress is not None and session.progress.done > 0)
    measured = [beats.quick_for_each_slow()]
    assert session.phase == "extracting"
    while session.phase == "extracting":
        measured.append(beats.quick_for_each_slow())
    # The last one went on when they were there.
    return measured[:-1]


def test_what_a_poll_raises_is_told_once_until_the_user_goes_on_and_polls_go_on(
    widget: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    logged: list[BaseException] = []
    monkeypatch.setattr(sys, "excepthook", lambda kind, error, trace: logged.append(error))
    panel, polls = widget.panel, list[object]()

    def fail(events: object) -> None:
        polls.append(events)
        raise RuntimeError("shapes do not fit")

    add_class(widget)
    wait_until(lambda: not panel.session.busy)
    monkeypatch.setattr(panel.session, "_take_in", fail)
    wait_until(lambda: len(polls) >= 3)
    assert [str(error) for error in logged] == ["shapes do not fit"]
    assert "unexpected went wrong (RuntimeError: shapes do not fit)" in widget.ui.messageLabel.text()
    widget.ui.messageCloseButton.click()
    before = len(polls)
    wait_until(lambda: len(polls) >= before + 2)
    assert not widget.ui.messageFrame.isVisible()
    add_class(widget)
    wait_until(lambda: len(logged) == 2)
    assert widget.ui.messageFrame.isVisible()
    monkeypatch.undo()
    add_class(widget)
    assert not widget.ui.messageFrame.isVisible()
