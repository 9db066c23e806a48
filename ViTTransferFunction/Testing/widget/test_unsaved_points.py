"""Points that were not saved when Slicer ended by itself: kept on the computer, and offered when their scan is chosen again."""

from __future__ import annotations

import json
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import slicer
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files.unsaved_files import UnsavedFile
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image
from ViTTransferFunction.Testing.support.programs import OPEN, run
from ViTTransferFunction.Testing.support.scenes import add_volume
from ViTTransferFunction.Testing.support.sequences import Sequence
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras
from ViTTransferFunction.Testing.support.unsaved_points import kept_in
from ViTTransferFunction.Testing.support.widgets import in_front, wait_until

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]

Click = Callable[..., None]


@pytest.fixture
def folder(a_cache_of_its_own: Path) -> Path:
    """Where they are kept."""
    return a_cache_of_its_own / "unsaved"


@pytest.fixture
def panel(widget: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The module's widget, opened, which keeps points at once."""
    from ViTTransferFunction.Widget import unsaved_points

    monkeypatch.setattr(unsaved_points, "DELAY_S", 0.01)
    return widget


@pytest.fixture
def scan(panel: Any, spheres: Spheres) -> Any:
    """A volume that is chosen."""
    node = add_volume(slicer.mrmlScene, spheres[0])
    panel.ui.volumeSelector.setCurrentNode(node)
    return node


@pytest.fixture
def click(panel: Any, spheres: Spheres) -> Click:
    """Places a point of a structure, which is new unless there is one of this name."""

    def place(name: str = "liver", label: int = 1) -> None:
        session = panel.panel.session
        id_ = next((state.id for state in session.classes if state.name == name), None)
        id_ = id_ or session.annotations.add_class(name).id
        session.annotations.add_points(id_, centre_ras(spheres, label), positive=True)

    return place


def points_kept_in(folder: Path) -> list[dict[str, int]]:
    """How many points inside each structure has, in each file."""
    files = [json.loads(path.read_text(encoding="utf-8")) for path in kept_in(folder)]
    return [{each["name"]: len(each["positive"]) for each in file["classes"]} for file in files]


def settle(widget: Any) -> None:
    """Wait until the disk has everything, and what is left was looked for."""
    unsaved = widget.panel._unsaved
    wait_until(lambda: unsaved._changed_s is None and not unsaved.busy)


def leave(widget: Any, volume: Volume, left: bool = True) -> UnsavedFile:
    """Have another Slicer work on the structures that there are now, and end by itself, if it `left` them."""
    file = UnsavedFile(volume.array, volume.geometry)
    file.write(widget.panel.session.file_classes.annotated(), "elsewhere", "")
    if left:
        file.close()
    return file


def save(folder: Path) -> None:
    """What Slicer does to save a scene with all that is in it."""
    folder.mkdir()
    assert slicer.mrmlScene.SaveSceneToSlicerDataBundleDirectory(folder.as_posix())


def names(widget: Any) -> list[str]:
    return [state.name for state in widget.panel.session.classes]


def test_points_are_kept_for_their_user_alone_until_they_are_taken_back(
    panel: Any, scan: Any, click: Click, folder: Path
) -> None:
    settle(panel)
    assert not folder.exists()
    click()
    click()
    click("spleen", 2)
    wait_until(lambda: points_kept_in(folder) == [{"liver": 2, "spleen": 1}])
    settle(panel)
    content = json.loads(kept_in(folder)[0].read_text(encoding="utf-8"))
    assert (content["scan"], content["model"]) == ("spheres", panel.panel.session.parameters.get("usedModel"))
    if sys.platform != "win32":
        assert [each.stat().st_mode & 0o777 for each in (folder, *folder.iterdir())] == [0o700, 0o600, 0o600]
    while panel.panel.session.classes:
        panel.ui.undoButton.click()
    wait_until(lambda: not kept_in(folder))


def test_what_was_left_of_a_scan_is_offered_when_it_is_chosen_and_restored_in_one_step(
    panel: Any, scan: Any, click: Click, folder: Path, spheres: Spheres
) -> None:
    click()
    click()
    click("spleen", 2)
    leave(panel, spheres[0])
    before = panel.panel.session.classes
    slicer.mrmlScene.Clear(False)
    assert not panel.ui.unsavedFrame.isVisible()
    panel.ui.volumeSelector.setCurrentNode(add_volume(slicer.mrmlScene, Volume(spheres[0].array, spheres[0].geometry, "new")))
    settle(panel)
    assert panel.ui.unsavedFrame.isVisible()
    text = panel.ui.unsavedLabel.text()
    assert text.startswith("3 points from ")
    assert text.endswith(" were not saved: 'liver', 'spleen'.")
    assert not names(panel)
    panel.ui.restorePointsButton.click()
    assert [(state.name, state.positive) for state in panel.panel.session.classes] == [
        (state.name, state.positive) for state in before
    ]
    settle(panel)
    assert not panel.ui.unsavedFrame.isVisible()
    # Until they are saved, they are kept as before.
    assert points_kept_in(folder) == [{"liver": 2, "spleen": 1}]
    panel.ui.undoButton.click()
    assert not names(panel)


def test_what_is_discarded_is_gone(panel: Any, scan: Any, click: Click, folder: Path, spheres: Spheres) -> None:
    click()
    leave(panel, spheres[0])
    slicer.mrmlScene.Clear(False)
    panel.ui.volumeSelector.setCurrentNode(add_volume(slicer.mrmlScene, spheres[0]))
    settle(panel)
    panel.ui.discardPointsButton.click()
    settle(panel)
    assert not panel.ui.unsavedFrame.isVisible()
    assert not list(folder.iterdir())


def test_the_keyboard_goes_on_to_the_structures_when_what_it_was_at_has_gone(
    panel: Any, host: Any, scan: Any, click: Click, spheres: Spheres
) -> None:
    click()
    leave(panel, spheres[0])
    slicer.mrmlScene.Clear(False)
    panel.ui.volumeSelector.setCurrentNode(add_volume(slicer.mrmlScene, spheres[0]))
    settle(panel)
    in_front(host.window)
    panel.ui.discardPointsButton.setFocus()
    wait_until(panel.ui.discardPointsButton.hasFocus)
    QTest.keyClick(panel.ui.discardPointsButton, Qt.Key.Key_Space)
    settle(panel)
    assert not panel.ui.unsavedFrame.isVisible()
    assert panel.ui.addClassButton.hasFocus()


def test_what_another_slicer_is_still_working_on_and_points_of_another_scan_are_not_offered(
    panel: Any, scan: Any, click: Click, spheres: Spheres
) -> None:
    click()
    leave(panel, Volume(spheres[0].array + 1, spheres[0].geometry))
    file = leave(panel, spheres[0], left=False)
    slicer.mrmlScene.Clear(False)
    panel.ui.volumeSelector.setCurrentNode(add_volume(slicer.mrmlScene, spheres[0]))
    settle(panel)
    assert not panel.ui.unsavedFrame.isVisible()
    file.close()


def test_points_that_were_saved_with_the_scene_are_not_kept_and_those_that_come_after_are(
    panel: Any, scan: Any, click: Click, folder: Path, tmp_path: Path
) -> None:
    click()
    wait_until(lambda: points_kept_in(folder) == [{"liver": 1}])
    # As where the user unticks the points.
    slicer.mrmlScene.Commit((tmp_path / "alone.mrml").as_posix())
    wait_until(lambda: panel.panel._unsaved._stored == slicer.mrmlScene.GetStoredTime())
    settle(panel)
    assert kept_in(folder)
    save(tmp_path / "scene")
    wait_until(lambda: not kept_in(folder))
    click()
    wait_until(lambda: points_kept_in(folder) == [{"liver": 2}])


def test_of_a_scene_with_two_scans_that_was_saved_the_points_of_neither_are_kept(
    panel: Any, scan: Any, click: Click, folder: Path, spheres: Spheres, tmp_path: Path
) -> None:
    click()
    wait_until(lambda: len(kept_in(folder)) == 1)
    other = add_volume(slicer.mrmlScene, Volume(spheres[0].array[::-1].copy(), spheres[0].geometry, "other"))
    panel.ui.volumeSelector.setCurrentNode(other)
    click()
    wait_until(lambda: len(kept_in(folder)) == 2)
    save(tmp_path / "scene")
    wait_until(lambda: not kept_in(folder))


def test_points_that_were_saved_right_before_a_restart_are_not_kept(
    panel: Any, scan: Any, click: Click, folder: Path, tmp_path: Path
) -> None:
    click()
    wait_until(lambda: bool(kept_in(folder)))
    settle(panel)
    save(tmp_path / "scene")
    slicer.app.moduleManager().unload("ViTTransferFunction")
    assert not kept_in(folder)


def test_a_scene_that_was_changed_after_it_was_saved_becomes_what_it_was_changed_to(
    panel: Any, scan: Any, click: Click, folder: Path, tmp_path: Path, spheres: Spheres
) -> None:
    click()
    click("gone")
    save(tmp_path / "scene")
    click()
    panel.panel.session.annotations.remove_class(panel.panel.session.classes[1].id)
    leave(panel, spheres[0])
    slicer.mrmlScene.Clear(False)
    slicer.mrmlScene.SetURL((tmp_path / "scene" / "scene.mrml").as_posix())
    slicer.mrmlScene.Import()
    settle(panel)
    # What is in files is not kept as well.
    assert len(kept_in(folder)) == 1
    assert names(panel) == ["liver", "gone"]
    panel.ui.restorePointsButton.click()
    assert [(state.name, len(state.positive)) for state in panel.panel.session.classes] == [("liver", 2)]


@pytest.mark.parametrize(
    ("saved", "work", "unsaved", "restored"),
    [
        ("liver", "begun anew", "spleen", ["liver", "spleen"]),
        ("liver", "renamed", "spleen", ["spleen"]),
        ("liver", "begun anew", "liver", ["liver"]),
        ("Structure 1", "begun anew", "Structure 1", ["Structure 1", "Structure 1 (2)"]),
    ],
)
def test_structures_of_a_saved_scene_stay_beside_restored_ones_that_were_not_made_out_of_them(
    panel: Any,
    scan: Any,
    click: Click,
    tmp_path: Path,
    spheres: Spheres,
    saved: str,
    work: str,
    unsaved: str,
    restored: list[str],
) -> None:
    click(saved)
    save(tmp_path / "scene")
    annotations = panel.panel.session.annotations
    if work == "renamed":
        annotations.set_class(panel.panel.session.classes[0].id, name=unsaved)
    else:
        annotations.remove_class(panel.panel.session.classes[0].id)
    click(unsaved, 2)
    leave(panel, spheres[0])
    slicer.mrmlScene.Clear(False)
    slicer.mrmlScene.SetURL((tmp_path / "scene" / "scene.mrml").as_posix())
    slicer.mrmlScene.Import()
    settle(panel)
    panel.ui.restorePointsButton.click()
    assert names(panel) == restored


def test_points_that_were_saved_as_a_file_are_not_kept(
    panel: Any, scan: Any, click: Click, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from ViTTransferFunction.Widget import points_section

    monkeypatch.setattr(points_section, "ask_path_to_write", lambda *_: str(tmp_path / "points.json"))
    click()
    wait_until(lambda: bool(kept_in(folder)))
    panel.ui.savePointsButton.click()
    wait_until(lambda: not kept_in(folder))


def test_nothing_is_kept_of_a_scene_that_is_closed(panel: Any, scan: Any, click: Click, folder: Path) -> None:
    click()
    wait_until(lambda: bool(kept_in(folder)))
    slicer.mrmlScene.Clear(False)
    assert not list(folder.iterdir())


@pytest.mark.parametrize("is_asked", [False, True])
def test_points_survive_a_restart_of_slicer_which_asks_nobody_and_no_end_where_the_user_was_asked(
    host: Any, panel: Any, scan: Any, click: Click, folder: Path, is_asked: bool
) -> None:
    click()
    wait_until(lambda: bool(kept_in(folder)))
    click()
    if is_asked:
        host.window.close()
    slicer.app.moduleManager().unload("ViTTransferFunction")
    assert points_kept_in(folder) == ([] if is_asked else [{"liver": 2}])


def test_points_that_were_saved_in_a_bundle_are_not_kept_unless_it_is_not_whole(
    panel: Any, scan: Any, click: Click, folder: Path, tmp_path: Path
) -> None:
    def save_bundle(content: bytes) -> None:
        """What Slicer does: afterwards, all nodes count as changed."""
        bundle = tmp_path / "scene.mrb"
        slicer.mrmlScene.SetURL(bundle.as_posix())
        save(tmp_path / f"scene {len(list(tmp_path.iterdir()))}")
        bundle.write_bytes(content)
        slicer.mrmlScene.SetStorableNodesModifiedSinceRead()

    file = tmp_path / "file.zip"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("scene.mrml", "points")
    click()
    wait_until(lambda: bool(kept_in(folder)))
    save_bundle(file.read_bytes()[:-8])
    wait_until(lambda: panel.panel._unsaved._stored == slicer.mrmlScene.GetStoredTime())
    settle(panel)
    assert kept_in(folder)
    save_bundle(file.read_bytes())
    # Before the panel has noticed.
    click()
    wait_until(lambda: panel.panel._unsaved._scan.saved != ())
    assert [len(state.positive) for state in panel.panel._unsaved._scan.saved] == [1]
    wait_until(lambda: points_kept_in(folder) == [{"liver": 2}])
    panel.ui.undoButton.click()
    wait_until(lambda: not kept_in(folder))


def test_each_scan_has_its_own_also_once_another_is_chosen_or_it_is_removed(
    panel: Any, scan: Any, click: Click, folder: Path, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    from ViTTransferFunction.Widget import unsaved_points

    settle(panel)
    monkeypatch.setattr(unsaved_points, "DELAY_S", 1e6)
    click()
    other = add_volume(slicer.mrmlScene, Volume(spheres[0].array[::-1].copy(), spheres[0].geometry, "other"))
    panel.ui.volumeSelector.setCurrentNode(other)
    monkeypatch.setattr(unsaved_points, "DELAY_S", 0.01)
    click("liver", 2)
    click("spleen", 2)
    wait_until(lambda: sorted(map(len, points_kept_in(folder))) == [1, 2])
    slicer.mrmlScene.RemoveNode(other)
    settle(panel)
    assert sorted(map(len, points_kept_in(folder))) == [1, 2]
    assert not panel.ui.unsavedFrame.isVisible()


def test_points_of_a_sequence_are_offered_whichever_frame_is_shown(panel: Any, click: Click, spheres: Spheres) -> None:
    volume = spheres[0]
    frames = [Volume(volume.array + np.float32(number), volume.geometry, "heart") for number in range(2)]
    sequence = Sequence(slicer.mrmlScene, frames)
    sequence.show(2)
    panel.ui.volumeSelector.setCurrentNode(sequence.volume)
    click()
    leave(panel, frames[0])
    slicer.mrmlScene.Clear(False)
    sequence = Sequence(slicer.mrmlScene, frames)
    panel.ui.volumeSelector.setCurrentNode(sequence.volume)
    settle(panel)
    assert panel.ui.unsavedFrame.isVisible()


def test_where_points_cannot_be_kept_the_user_is_told_once_until_they_can(
    panel: Any, scan: Any, click: Click, folder: Path
) -> None:
    ui = panel.ui
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.write_text("in the way")
    click()
    wait_until(lambda: "are not kept on this computer" in ui.messageLabel.text())
    ui.messageCloseButton.click()
    click()
    settle(panel)
    assert not ui.messageFrame.isVisible()
    folder.unlink()
    click()
    wait_until(lambda: points_kept_in(folder) == [{"liver": 3}])


def test_points_in_a_single_slice_are_kept_and_only_that_it_cannot_be_segmented_is_told(
    panel: Any, folder: Path, spheres: Spheres
) -> None:
    node = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "scout")
    set_image(node, spheres[0].array[:1], spheres[0].geometry.ijk_to_ras)
    panel.ui.volumeSelector.setCurrentNode(node)
    annotations = panel.panel.session.annotations
    corner_ras = spheres[0].geometry.ijk_to_ras[:3, 3]
    annotations.add_points(annotations.add_class("liver").id, [corner_ras], positive=True)
    settle(panel)
    assert points_kept_in(folder) == [{"liver": 1}]
    wait_until(lambda: "'scout' is" in panel.ui.messageLabel.text())
    assert "not kept" not in panel.ui.messageLabel.text()


def test_a_file_that_is_damaged_is_passed_over_and_the_user_is_told_which(
    panel: Any, scan: Any, click: Click, folder: Path, spheres: Spheres
) -> None:
    click()
    leave(panel, spheres[0])
    settle(panel)
    damaged = kept_in(folder)[0].with_name(f"{kept_in(folder)[0].name.split('-')[0]}-0.annotations.json")
    slicer.mrmlScene.Clear(False)
    damaged.write_bytes(b"[1]")
    panel.ui.volumeSelector.setCurrentNode(add_volume(slicer.mrmlScene, spheres[0]))
    settle(panel)
    assert "cannot be used" in panel.ui.messageLabel.text()
    assert panel.ui.unsavedLabel.text().startswith("1 point from ")


ON_A_SCAN = OPEN + (
    "import os, numpy as np\n"
    "from ViTTransferFunction.Logic.core.volumes.geometry import Geometry\n"
    "from ViTTransferFunction.Logic.core.volumes.volume import Volume\n"
    "from ViTTransferFunction.Testing.support.scenes import add_volume\n"
    "from ViTTransferFunction.Testing.support.widgets import in_front, wait_until\n"
    "array = np.random.default_rng(1).normal(0.0, 8.0, (20, 22, 24)).astype(np.float32)\n"
    "volume = Volume(array, Geometry(array.shape, np.eye(4)), 'ct')\n"
    "ui.volumeSelector.setCurrentNode(add_volume(slicer.mrmlScene, volume))\n"
    "unsaved, session = widget.panel._unsaved, widget.panel.session\n"
)
WITH_A_POINT = ON_A_SCAN + (
    "id_ = session.annotations.add_class('nodule').id\n"
    "session.annotations.add_points(id_, np.array([[5.0, 5.0, 5.0]]), positive=True)\n"
    "wait_until(lambda: unsaved._changed_s is None and not unsaved.busy)\n"
)


@pytest.mark.slow
def test_a_slicer_that_was_killed_offers_the_points_when_it_is_started_again(tmp_path: Path) -> None:
    run(WITH_A_POINT + "sys.stdout.flush()\nos._exit(0)\n", tmp_path)
    run(
        ON_A_SCAN + "wait_until(lambda: unsaved._scan.offered is not None)\n"
        "ui.restorePointsButton.click()\n"
        "assert [(state.name, state.positive) for state in session.classes] == [('nodule', ((5.0, 5.0, 5.0),))]\n"
        "host.close()\n",
        tmp_path,
    )


@pytest.mark.slow
def test_nothing_is_offered_after_the_module_was_loaded_anew(tmp_path: Path) -> None:
    """The scene stays as it is, so that nothing of it is left to restore."""
    run(
        WITH_A_POINT + "from pathlib import Path\n"
        "assert list(Path('unsaved').glob('*.annotations.json'))\n"
        "widget.onReload()\n"
        "fresh = host.representation.self()\n"
        "again = fresh.panel._unsaved\n"
        "wait_until(lambda: again._scan is not None and again._changed_s is None and not again.busy)\n"
        "assert [state.name for state in fresh.panel.session.classes] == ['nodule']\n"
        "assert again._scan.offered is None\n"
        "host.close()\n",
        tmp_path,
    )
