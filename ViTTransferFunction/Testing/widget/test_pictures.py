"""Pictures and films made in the panel, of the 3D view that is shown."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import slicer
import vtk
from vtkmodules.util.numpy_support import vtk_to_numpy

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.files.camera_files import read_camera
from ViTTransferFunction.Logic.rendering.composition import DEPTH, NUMBER
from ViTTransferFunction.Logic.rendering.structure_volume import StructureVolume
from ViTTransferFunction.Testing.files.test_film import frames_of
from ViTTransferFunction.Testing.support.widgets import wait_until

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]

MIDDLE_RAS = (12.0, 14.0, 16.0)


@pytest.fixture
def files(widget: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, str]]:
    """What the user answers when asked for a file: the one to "write", and the one to "read"."""
    from ViTTransferFunction.Widget import pictures_section

    answers = {"write": "", "read": ""}
    monkeypatch.setattr(pictures_section, "ask_path_to_write", lambda *arguments: answers["write"])
    monkeypatch.setattr(pictures_section, "ask_path_to_read", lambda *arguments: answers["read"])
    widget.ui.pictureWidthSpinBox.setValue(64)
    widget.ui.pictureHeightSpinBox.setValue(48)
    renderer().SetBackground(0.0, 0.0, 1.0)
    actor, mapper, ball = vtk.vtkActor(), vtk.vtkPolyDataMapper(), vtk.vtkSphereSource()
    mapper.SetInputConnection(ball.GetOutputPort())
    actor.SetMapper(mapper)
    renderer().AddActor(actor)
    renderer().ResetCamera()
    yield answers
    renderer().RemoveActor(actor)


@pytest.mark.parametrize(("platform", "start"), [("win32", "D:/patients"), ("darwin", "D:/patients"), ("linux", "")])
def test_dialogs_begin_in_the_scenes_folder_where_the_working_folder_is_slicers_own(
    widget: Any, platform: str, start: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from ViTTransferFunction.Widget import pictures_section

    asked: list[str] = []

    def ask(parent: Any, title: str, path: str, kinds: str) -> str:
        asked.append(path)
        return ""

    dialogs = SimpleNamespace(getSaveFileName=ask, getOpenFileName=ask)
    monkeypatch.setattr(pictures_section, "qt", SimpleNamespace(QFileDialog=dialogs))
    before = slicer.mrmlScene.GetRootDirectory()
    slicer.mrmlScene.SetRootDirectory("D:/patients")
    # No longer than this: the widget's compute process ends as the real system's do.
    with monkeypatch.context() as patch:
        patch.setattr(sys, "platform", platform)
        pictures_section.ask_path_to_write("Save picture", "view.png", "*.png", None)
        pictures_section.ask_path_to_read("Load camera", "*.json", None)
    slicer.mrmlScene.SetRootDirectory(before)
    assert asked == [f"{start}/view.png" if start else "view.png", start]


def renderer() -> Any:
    return slicer.app.layoutManager().threeDWidget(0).threeDView().renderWindow().GetRenderers().GetFirstRenderer()


def pixels(path: Path) -> np.ndarray:
    reader = vtk.vtkPNGReader()
    reader.SetFileName(str(path))
    reader.Update()
    width, height, _ = reader.GetOutput().GetDimensions()
    return vtk_to_numpy(reader.GetOutput().GetPointData().GetScalars()).reshape(height, width, -1)


def in_3d(widget: Any, monkeypatch: pytest.MonkeyPatch, volume: Any) -> None:
    """One voxel of a structure, at MIDDLE_RAS."""
    voxels = np.zeros((10, 10, 10, 4), np.uint8)
    voxels[8, 7, 6, [NUMBER, DEPTH]] = 1, 255
    rendering = StructureVolume(
        voxels, np.zeros((1, 2)), np.arange(256.0), False, 1.0, Geometry((10, 10, 10), np.diag([2.0, 2.0, 2.0, 1.0]))
    )
    widget.ui.volumeSelector.setCurrentNode(volume)
    monkeypatch.setattr(widget.panel.session._proxy, "rendering", rendering)


def test_a_picture_is_of_the_size_that_was_chosen_with_or_without_background(
    widget: Any, files: dict[str, str], tmp_path: Path
) -> None:
    files["write"] = str(tmp_path / "view")
    widget.ui.pictureButton.click()
    picture = pixels(tmp_path / "view.png")
    assert picture.shape == (48, 64, 3)
    assert picture[0, 0].tolist() == [0, 0, 255]
    widget.ui.pictureTransparentCheckBox.click()
    files["write"] = str(tmp_path / "view.png")
    widget.ui.pictureButton.click()
    picture = pixels(tmp_path / "view.png")
    assert picture.shape == (48, 64, 4)
    assert (picture[0, 0, 3], picture[24, 32, 3]) == (0, 255)


def test_a_number_with_a_point_is_no_ending(
    widget: Any, files: dict[str, str], tmp_path: Path, volume: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_3d(widget, monkeypatch, volume)
    files["write"] = str(tmp_path / "liver 2.5")
    for _ in range(2):
        widget.ui.pictureButton.click()
        widget.ui.saveCameraButton.click()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["liver 2.5.json", "liver 2.5.png"]
    assert "is there already" in widget.ui.messageLabel.text()


def test_a_name_is_offered_that_every_system_takes(
    widget: Any, files: dict[str, str], volume: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from ViTTransferFunction.Widget import pictures_section

    offered: list[str] = []

    def cancel(title: str, name: str, *_: Any) -> str:
        offered.append(name)
        return ""

    monkeypatch.setattr(pictures_section, "ask_path_to_write", cancel)
    volume.SetName("2: CT/Chest <5 mm>")
    widget.ui.volumeSelector.setCurrentNode(volume)
    widget.ui.pictureButton.click()
    assert offered == ["2_ CT_Chest _5 mm_.png"]


def test_nothing_is_made_where_the_user_cancels(widget: Any, files: dict[str, str], tmp_path: Path) -> None:
    for name in ("picture", "film"):
        getattr(widget.ui, f"{name}Button").click()
    assert list(tmp_path.iterdir()) == []
    assert not widget.ui.filmProgressRow.isVisible()


def test_a_film_is_shot_while_the_panel_goes_on(widget: Any, files: dict[str, str], tmp_path: Path) -> None:
    pytest.importorskip("PIL")
    files["write"] = str(tmp_path / "turn.gif")
    widget.ui.picturesCollapsibleButton.collapsed = False
    widget.ui.filmSecondsSpinBox.setValue(1.0)
    widget.ui.filmButton.click()
    assert not widget.ui.pictureButton.isEnabled()
    assert not widget.ui.filmProgressRow.isHidden()
    wait_until(lambda: widget.ui.pictureButton.isEnabled())
    assert widget.ui.filmProgressRow.isHidden()
    frames, seconds = frames_of(tmp_path / "turn.gif")
    assert (len(frames), seconds, frames[0].shape) == (12, 1.0, (48, 64, 3))


def test_a_section_that_is_opened_shows_what_runs_by_then(widget: Any, files: dict[str, str], tmp_path: Path) -> None:
    """CTK keeps what is shown in a collapsed section hidden until it opens."""
    pytest.importorskip("PIL")
    files["write"] = str(tmp_path / "turn.gif")
    section, row = widget.ui.picturesCollapsibleButton, widget.ui.filmProgressRow
    widget.ui.filmButton.click()
    assert row.isHidden()
    section.collapsed = False
    assert not row.isHidden()
    section.collapsed = True
    widget.ui.filmCancelButton.click()
    section.collapsed = False
    assert row.isHidden()


@pytest.mark.parametrize("end", ["cancel", "close"])
def test_a_film_that_is_given_up_leaves_nothing(widget: Any, files: dict[str, str], tmp_path: Path, end: str) -> None:
    pytest.importorskip("PIL")
    files["write"] = str(tmp_path / "turn.gif")
    widget.ui.filmButton.click()
    wait_until(lambda: widget.ui.filmProgressBar.value() >= 2)
    if end == "cancel":
        widget.ui.filmCancelButton.click()
    else:
        widget.panel.close()
    assert list(tmp_path.iterdir()) == []
    assert widget.ui.filmProgressRow.isHidden()


def test_a_film_that_cannot_be_made_says_why(
    widget: Any, files: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files["write"] = str(tmp_path / "turn.avi")
    widget.ui.filmButton.click()
    assert "end in .gif or .mp4" in widget.ui.messageLabel.text()
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    files["write"] = str(tmp_path / "turn.mp4")
    widget.ui.filmButton.click()
    assert "imageio-ffmpeg" in widget.ui.messageLabel.text()
    assert widget.ui.filmButton.isEnabled()
    (tmp_path / "turn.gif").mkdir()
    pytest.importorskip("PIL")
    files["write"] = str(tmp_path / "turn.gif")
    widget.ui.filmButton.click()
    wait_until(lambda: "is a folder" in widget.ui.messageLabel.text())
    slicer.app.processEvents()
    assert "is a folder" in widget.ui.messageLabel.text()
    assert widget.ui.filmButton.isEnabled()


def test_a_camera_is_relative_to_the_structures_and_found_again(
    widget: Any, files: dict[str, str], tmp_path: Path, volume: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    widget.ui.saveCameraButton.click()
    assert "Place a point on a structure, and switch the 3D views on." in widget.ui.messageLabel.text()
    in_3d(widget, monkeypatch, volume)
    camera = renderer().GetActiveCamera()
    camera.SetPosition(12.0, 114.0, 16.0)
    camera.SetFocalPoint(*MIDDLE_RAS)
    camera.SetViewUp(0.0, 0.0, 1.0)
    files["write"] = files["read"] = str(tmp_path / "camera.json")
    widget.ui.saveCameraButton.click()
    saved = read_camera(tmp_path / "camera.json")
    assert (saved.position_mm, saved.focal_point_mm, saved.size) == ((0.0, 100.0, 0.0), (0.0, 0.0, 0.0), (64, 48))
    camera.SetPosition(500.0, 0.0, 0.0)
    widget.ui.pictureWidthSpinBox.setValue(200)
    widget.ui.loadCameraButton.click()
    assert camera.GetPosition() == pytest.approx((12.0, 114.0, 16.0))
    assert widget.ui.pictureWidthSpinBox.value() == 64


def test_without_a_3d_view_there_is_no_picture(widget: Any, files: dict[str, str], tmp_path: Path) -> None:
    files["write"] = str(tmp_path / "view.png")
    slicer.app.layoutManager().threeDWidget(0).hide()
    widget.ui.pictureButton.click()
    assert "No 3D view is shown" in widget.ui.messageLabel.text()
