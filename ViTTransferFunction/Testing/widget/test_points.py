"""Points saved and loaded in the panel."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

from ViTTransferFunction.Logic.files.annotation_files import read_annotations
from ViTTransferFunction.Testing.support.scenes import MOVED, annotate, put_under
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]


class Answers:
    """What the user answers when asked for a file, and which name they were offered."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.offered = ""
        self.read = ""

    def path_to_write(self, title: str, name: str, *_: Any) -> str:
        self.offered = name
        return str(self.folder / name)

    def path_to_read(self, *_: Any) -> str:
        return self.read


@pytest.fixture
def answers(ready: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Answers:
    from ViTTransferFunction.Widget import points_section

    answers = Answers(tmp_path)
    monkeypatch.setattr(points_section, "ask_path_to_write", answers.path_to_write)
    monkeypatch.setattr(points_section, "ask_path_to_read", answers.path_to_read)
    return answers


def test_points_are_saved_as_the_scan_lies_in_its_file_and_loaded_in_one_step_for_undo(
    ready: Any, volume: Any, answers: Answers, spheres: Spheres
) -> None:
    ui, session = ready.ui, ready.panel.session
    assert not ui.savePointsButton.isEnabled()
    annotate(session, spheres)
    put_under(volume, MOVED)
    for state in session.classes:
        for polarity in ("positive", "negative"):
            node = session.annotations.points_node(state.id, polarity == "positive")
            node.SetAndObserveTransformNodeID(volume.GetTransformNodeID())
    volume.SetName("CT 3.2")
    session.wait()
    before = session.classes
    ui.savePointsButton.click()
    assert answers.offered == "CT 3.2.annotations.json"
    saved = read_annotations(answers.folder / answers.offered, spheres[0].geometry)
    for label, each in enumerate(saved, start=1):
        assert each.request.positive == pytest.approx(centre_ras(spheres, label))
    answers.read = str(answers.folder / answers.offered)
    ui.loadPointsButton.click()
    assert session.classes == before
    assert "are all there already" in ui.messageLabel.text()
    for state in session.classes:
        session.annotations.step_size(state.id, 1)
    changed = session.classes
    ui.loadPointsButton.click()
    names = [state.name for state in session.classes]
    assert names == [f"sphere {label}{again}" for again in ("", " (2)") for label in (1, 2, 3)]
    for old, new in zip(before, session.classes[3:], strict=True):
        assert new.positive[0] == pytest.approx(old.positive[0])
    session.annotations.undo()
    assert session.classes == changed


def test_nothing_is_saved_or_loaded_where_the_user_cancels(
    ready: Any, answers: Answers, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    from ViTTransferFunction.Widget import points_section

    monkeypatch.setattr(points_section, "ask_path_to_write", lambda *_: "")
    annotate(ready.panel.session, spheres)
    before = ready.panel.session.classes
    ready.ui.savePointsButton.click()
    ready.ui.loadPointsButton.click()
    assert not list(answers.folder.iterdir())
    assert ready.panel.session.classes == before
    assert not ready.ui.messageLabel.text()


def test_why_points_were_not_saved_is_told_until_they_are(ready: Any, answers: Answers, spheres: Spheres) -> None:
    ui = ready.ui
    annotate(ready.panel.session, spheres)
    elsewhere, answers.folder = answers.folder, answers.folder / "a file"
    answers.folder.touch()
    for _ in range(2):
        ui.savePointsButton.click()
        assert ui.messageLabel.text().count("Cannot write") == 1
    answers.folder = elsewhere
    ui.savePointsButton.click()
    assert (elsewhere / answers.offered).is_file()
    assert not ui.messageFrame.isVisible()


def test_points_of_another_scan_are_refused_in_the_panel(ready: Any, answers: Answers) -> None:
    path = answers.folder / "other.annotations.json"
    path.write_text('{"coordinate_system": "RAS", "classes": [{"name": "liver", "positive": [[1000, 0, 0]]}]}')
    answers.read = str(path)
    ready.ui.loadPointsButton.click()
    assert "1 of 1 points of class 'liver' lie outside the volume" in ready.ui.messageLabel.text()
    assert not ready.panel.session.classes


def test_without_a_volume_nothing_can_be_saved_or_loaded(widget: Any) -> None:
    assert not widget.ui.savePointsButton.isEnabled()
    assert not widget.ui.loadPointsButton.isEnabled()
