"""The app without a browser: what the page asks for, and what it is given to show."""

from __future__ import annotations

import asyncio
import ctypes
import os
import random
import shutil
import signal
import socket
import sys
import tempfile
import threading
from argparse import Namespace
from collections.abc import Callable, Coroutine
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("trame_slicer")

import SimpleITK as sitk  # noqa: N813
import vtk

from ViTTransferFunction.CommandLine import app_command
from ViTTransferFunction.CommandLine.interruption import Terminated
from ViTTransferFunction.CommandLine.vittf import build_parser
from ViTTransferFunction.Logic.core.classes.colors import hex_color
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.missing_intensity import without_intensity_text
from ViTTransferFunction.Logic.core.volumes.patient_sides import position_text, sides
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.scene.mrml.transforms import numpy_matrix
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import array_from_node, geometry_from_node
from ViTTransferFunction.Testing.attack.scans import make_scan, write_dicom
from ViTTransferFunction.Testing.files.test_several_series import write_two
from ViTTransferFunction.Testing.support.spheres import Spheres
from ViTTransferFunction.Testing.support.views import drag
from ViTTransferFunction.Testing.web_app.test_saving import until
from ViTTransferFunction.WebApp import app as app_module
from ViTTransferFunction.WebApp import opening, packing, panel_state, scene_files, serving
from ViTTransferFunction.WebApp.app import WebApp
from ViTTransferFunction.WebApp.data_probe import probe_text
from ViTTransferFunction.WebApp.panel_state import color_of_hex
from ViTTransferFunction.WebApp.view_steps import MOST_NOTCHES

Journey = Callable[[WebApp], Coroutine[Any, Any, None]]


def test_the_page_shows_what_its_actions_did(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        state = app.server.state
        assert (state.volume_name, state.classes, state.opening) == ("spheres", [], "")
        app.actions("addClass")
        app.actions("addClass")
        assert [shown["name"] for shown in state.classes] == ["Structure 1", "Structure 2"]
        first, second = (shown["id"] for shown in state.classes)
        assert (state.selected, state.tool) == (second, "pointOn")
        app.actions("rename", first, "{{ constructor }}")
        app.actions("recolor", first, "#102030")
        app.actions("set", "opacity", 0.25)
        assert state.classes[0]["name"] == "{{ constructor }}"
        assert state.classes[0]["color"] == "#102030"
        assert state.settings["opacity"] == 0.25
        app.actions("pointOn")
        assert state.tool == ""
        app.actions("remove", second)
        assert state.selected == first
        app.actions("undo")
        assert len(state.classes) == 2

    opened(journey)


def test_a_drag_in_the_3d_view_that_begins_on_a_point_moves_no_point(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        middle = np.array(app.views.view_3d.get_camera_node().GetFocalPoint())
        app.session.annotations.add_points(app.session.classes[0].id, middle[None], positive=True)
        app.tool.put_down()
        before, camera = app.session.classes, app.views.view_3d.get_camera_node().GetPosition()
        drag(app.views.view_3d, middle)
        assert app.session.classes == before
        assert app.views.view_3d.get_camera_node().GetPosition() != camera

    opened(journey)


def test_looks_and_surroundings_are_those_of_the_scene(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        state, parameters = app.server.state, app.session.parameters
        offered = [shown["text"] for shown in state.contexts]
        assert offered[:3] == ["Off", "Bones and vessels", "Skin"]
        assert "CT-AAA" in offered
        assert [shown["text"] for shown in state.styles] == ["Surface", "Glass", "X-ray", "Vessels", "As scanned"]
        app.actions("style", "glass")
        app.actions("addClass")
        app.actions("addClass")
        app.actions("style", "glass")
        assert [shown.look.style for shown in app.session.classes] == ["surface", "glass"]
        assert state.settings["style"] == "glass"
        chosen = {"context": "CT-AAA", "contextStrength": 0.25, "contextCutAway": True, "renderingSolo": True}
        for name, value in chosen.items():
            app.actions("parameter", name, value)
        assert {name: state.parameters[name] for name in chosen} == chosen
        assert {name: parameters.get(name) for name in chosen} == chosen
        app.actions("parameter", "context", "no such surroundings")
        app.actions("style", "no such style")
        assert (state.parameters["context"], state.settings["style"]) == ("CT-AAA", "glass")

    opened(journey)


def test_segments_are_hidden_and_shown_by_their_node_which_sessions_keep(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("showSegments", False)
        assert app.server.state.segments == []
        node = app.scene.AddNewNodeByClass("vtkMRMLSegmentationNode", "segments")
        node.GetSegmentation().AddEmptySegment()
        app.session.set_segmentation(node)
        app.refresh()
        assert app.server.state.segments_visible
        for shown in (False, True):
            app.actions("showSegments", shown)
            assert app.server.state.segments_visible == shown
            assert node.GetDisplayNode().GetVisibility() == shown

    opened(journey)


def test_what_cannot_be_done_is_said_once_and_changes_nothing(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        assert app.actions("addClass")
        id_ = app.server.state.classes[0]["id"]
        # The page puts the old name back.
        assert not app.actions("rename", id_, "  ")
        assert "needs a name" in app.server.state.message
        assert app.server.state.classes[0]["name"] == "Structure 1"
        app.actions("closeMessages")
        assert app.server.state.message == ""
        app.actions("window", 100.0, 50.0)
        assert "lower first" in app.server.state.message
        app.actions("select", "no such structure")
        assert "removed" in app.server.state.message
        assert not app.actions("__class__")
        assert not app.actions("no such action")

    opened(journey)


def test_a_file_that_cannot_be_read_leaves_what_is_open(opened: Callable[[Journey], None], tmp_path: Path) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        bad = tmp_path / "bad.nii.gz"
        bad.write_bytes(b"no image")
        await app.opening.open([bad])
        assert app.server.state.message
        assert app.server.state.volume_name == "spheres"
        assert len(app.server.state.classes) == 1

    opened(journey)


@pytest.mark.parametrize(
    ("typed", "why"),
    [
        ("/nowhere/scan.nrrd", "no file"),
        ("/nowhere/scan.mrb", "no file"),
        ("~no such user/scan.nrrd", "no file" if os.name == "nt" else "no such home folder"),
    ],
)
def test_a_path_that_leads_nowhere_is_answered(opened: Callable[[Journey], None], typed: str, why: str) -> None:
    async def journey(app: WebApp) -> None:
        app.opening.open_typed(typed)
        await asyncio.gather(*app._tasks)
        app.refresh()
        assert why in app.server.state.message
        assert (app.server.state.volume_name, app.server.state.opening) == ("spheres", "")

    opened(journey)


def test_where_temporary_files_cannot_be_kept_the_page_says_so_and_stays_usable(
    opened: Callable[[Journey], None], file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def journey(app: WebApp) -> None:
        with monkeypatch.context() as there:
            there.setattr(tempfile, "tempdir", str(tmp_path / "removed"))
            await app.opening.open([file.rename(file.with_name("again.nrrd"))])
        state = app.server.state
        # The reason that follows is worded by the system.
        assert "No temporary files can be kept: " in state.message
        assert (state.volume_name, state.opening) == ("spheres", "")

    opened(journey)


def test_several_volumes_at_once_are_refused(opened: Callable[[Journey], None], file: Path) -> None:
    async def journey(app: WebApp) -> None:
        other = file.with_name("other.nii.gz")
        other.write_bytes(b"")
        await app.opening.open([file, other])
        assert "one volume at a time" in app.server.state.message
        assert app.server.state.volume_name == "spheres"

    opened(journey)


def test_where_slices_are_missing_the_page_says_so(in_app: Callable[[Journey], None], tmp_path: Path) -> None:
    async def journey(app: WebApp) -> None:
        scan = make_scan(random.Random(0), ("int16",))
        paths = write_dicom(tmp_path / "series", scan)
        paths.pop(len(paths) // 2).unlink()
        await app.opening.open([tmp_path / "series"])
        assert app.server.state.volume_name == "series"
        assert "slices seem to be missing" in app.server.state.message

    in_app(journey)


def test_of_several_series_the_user_is_asked_for_one(opened: Callable[[Journey], None], tmp_path: Path) -> None:
    write_two(tmp_path / "disk")

    async def journey(app: WebApp) -> None:
        state = app.server.state
        opening = asyncio.create_task(app.opening.open([tmp_path / "disk"]))
        await until(lambda: state.series_offered)
        assert state.series_offered == ["2: T1 axial (MR, 7×6×3)", "12: T2 axial (MR, 7×6×5)"]
        app.actions("series", "no such line")
        assert (state.opening, state.volume_name) == ("disk", "spheres")
        app.actions("series", "2: T1 axial (MR, 7×6×3)")
        await opening
        assert (state.series_offered, state.opening, state.volume_name) == ([], "", "disk")
        assert app.session.parameters.volume.GetImageData().GetDimensions() == (7, 6, 3)

    opened(journey)


@pytest.mark.parametrize("way", ["cancel", "another file"])
def test_who_chooses_no_series_keeps_what_is_open_or_gets_what_was_asked_for_since(
    opened: Callable[[Journey], None], tmp_path: Path, file: Path, way: str
) -> None:
    write_two(tmp_path / "disk")
    shutil.copy(file, tmp_path / "other.nrrd")

    async def journey(app: WebApp) -> None:
        state = app.server.state
        opening = asyncio.create_task(app.opening.open([tmp_path / "disk"]))
        await until(lambda: state.series_offered)
        if way == "cancel":
            app.actions("series", "")
        else:
            await app.opening.open([tmp_path / "other.nrrd"])
        await opening
        shown = "spheres" if way == "cancel" else "other"
        assert (state.series_offered, state.opening, state.volume_name, state.message) == ([], "", shown, "")

    opened(journey)


def test_a_series_that_is_named_beforehand_is_opened_unasked(in_app: Callable[[Journey], None], tmp_path: Path) -> None:
    write_two(tmp_path / "disk")

    async def journey(app: WebApp) -> None:
        await app.opening.open([tmp_path / "disk"], "T2")
        assert app.session.parameters.volume.GetImageData().GetDimensions() == (7, 6, 5)

    in_app(journey)


@pytest.mark.parametrize("volume", [None, "scan.nrrd"])
def test_a_series_without_its_folder_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, volume: str | None) -> None:
    (tmp_path / "scan.nrrd").touch()
    monkeypatch.chdir(tmp_path)
    args = build_parser().parse_args(["app", *([volume] if volume else []), "--series", "T2"])
    with pytest.raises(InputError, match="give that folder as VOLUME"):
        app_command.run(args)


def test_a_scan_in_a_session_that_says_nothing_of_its_look_is_seen_in_a_window_of_its_own(
    opened: Callable[[Journey], None], tmp_path: Path
) -> None:
    """As of a program that is not Slicer."""

    async def journey(app: WebApp) -> None:
        app.scene.RemoveNode(app.session.parameters.volume.GetDisplayNode())
        scene_files.stage_session(app.scene, tmp_path / "session")
        packing.zip_folder(tmp_path / "session", tmp_path / "session.mrb")
        await app.opening.open([tmp_path / "session.mrb"])
        assert app.server.state.window == pytest.approx({"low": -15.0, "high": 210.0}, abs=5.0)
        volume = app.session.parameters.volume
        assert [view.get_background_volume_id() for view in app.views.slices] == [volume.GetID()] * 3

    opened(journey)


@pytest.mark.parametrize(("without", "why"), [(".nrrd", "could not be read whole"), ("", "no volume is chosen")])
def test_a_session_that_lacks_its_volume_is_opened_and_says_so(
    opened: Callable[[Journey], None], tmp_path: Path, without: str, why: str
) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        if not without:
            app.scene.CopyNode(app.session.parameters.volume)
            app.session.set_volume(None)
        scene_files.stage_session(app.scene, tmp_path / "session")
        for voxels in (tmp_path / "session" / "Data").glob("*.nrrd") if without else ():
            voxels.unlink()
        packing.zip_folder(tmp_path / "session", tmp_path / "session.mrb")
        await app.opening.open([tmp_path / "session.mrb"])
        assert why in app.server.state.message
        # It belongs to a scan, and is there with it.
        assert [shown["name"] for shown in app.server.state.classes] == (["Structure 1"] if without else [])
        assert all(view.get_background_volume_id() is None for view in app.views.slices)

    opened(journey)


@pytest.mark.parametrize(
    ("busy", "drawing_quickly", "waits"), [(False, False, False), (True, False, True), (True, True, False)]
)
def test_the_3d_view_waits_while_something_is_computed_unless_its_look_is_being_changed(
    opened: Callable[[Journey], None], busy: bool, drawing_quickly: bool, waits: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def journey(app: WebApp) -> None:
        with monkeypatch.context() as there:
            there.setattr(type(app.session), "busy", busy)
            there.setattr(type(app.session.views), "drawing_quickly", drawing_quickly)
            assert [strategy._is_urgent() for strategy in app.views._factory_3d.strategies] == [waits]

    opened(journey)


@pytest.mark.parametrize(
    ("dtype", "factor"), [(np.int8, 1), (np.uint8, 1), (np.int64, 1), (np.int64, 10**9), (np.uint64, 1), (np.float64, 0.3)]
)
def test_voxels_of_any_type_are_shown_and_saved(
    opened: Callable[[Journey], None], tmp_path: Path, dtype: type, factor: float
) -> None:
    voxels: np.ndarray = (np.arange(6 * 7 * 8).reshape(6, 7, 8) % 100 * factor).astype(dtype)
    sitk.WriteImage(sitk.GetImageFromArray(voxels), str(tmp_path / "scan.nii"))

    async def journey(app: WebApp) -> None:
        await app.opening.open([tmp_path / "scan.nii"])
        assert app.server.state.message == ""
        node = app.session.parameters.volume
        assert node.GetImageData().GetScalarType() not in (vtk.VTK_LONG_LONG, vtk.VTK_UNSIGNED_LONG_LONG)  # Slices are black.
        scene_files.stage_session(app.scene, tmp_path / "session")
        (saved,) = (tmp_path / "session" / "Data").glob("*.nrrd")
        for kept in (array_from_node(node), sitk.GetArrayFromImage(sitk.ReadImage(str(saved)))):
            np.testing.assert_array_equal(kept, voxels)

    opened(journey)


@pytest.mark.parametrize("shown", [None, 0, 1])
def test_of_a_session_in_which_no_volume_was_chosen_the_one_that_is_shown_or_there_alone_is_opened(
    opened: Callable[[Journey], None], tmp_path: Path, shown: int | None
) -> None:
    """As of one that was saved in Slicer without this module."""

    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        volumes = [app.session.parameters.volume] + (
            [] if shown is None else [app.scene.CopyNode(app.session.parameters.volume)]
        )
        for number, volume in enumerate(volumes):
            volume.SetName(f"scan {number}")
        app.session.set_volume(None)
        if shown is not None:
            selection = app.scene.GetSingletonNode("Singleton", "vtkMRMLSelectionNode")
            selection.SetActiveVolumeID(volumes[shown].GetID())
        scene_files.stage_session(app.scene, tmp_path / "session")
        packing.zip_folder(tmp_path / "session", tmp_path / "session.mrb")
        app.server.state.windows = []

        await app.opening.open([tmp_path / "session.mrb"])

        state = app.server.state
        assert (state.volume_name, state.message, state.unsaved) == (f"scan {shown or 0}", "", False)
        assert [each["name"] for each in state.classes] == ([] if shown == 1 else ["Structure 1"])
        volume = app.session.parameters.volume
        assert [view.get_background_volume_id() for view in app.views.slices] == [volume.GetID()] * 3
        assert state.windows

    opened(journey)


def test_another_volume_takes_the_place_of_the_one_before(opened: Callable[[Journey], None], tmp_path: Path) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        other = tmp_path / "other.nrrd"
        sitk.WriteImage(sitk.GetImageFromArray(np.arange(1000, dtype=np.int16).reshape(10, 10, 10)), str(other))
        await app.opening.open([other])
        assert (app.server.state.volume_name, app.server.state.classes, app.server.state.tool) == ("other", [], "")
        assert app.scene.GetNumberOfNodesByClass("vtkMRMLScalarVolumeNode") == 1
        assert all(view.get_background_volume_id() == app.session.parameters.volume.GetID() for view in app.views.slices)

    opened(journey)


def test_points_outside_the_scan_and_where_it_was_masked_are_told(
    in_app: Callable[[Journey], None], spheres: Spheres, tmp_path: Path
) -> None:
    volume, labels = spheres
    image = sitk.GetImageFromArray(np.where(labels == 2, np.nan, volume.array).astype(np.float32))
    sitk.WriteImage(image, str(tmp_path / "masked.nrrd"))

    async def journey(app: WebApp) -> None:
        await app.opening.open([tmp_path / "masked.nrrd"])
        app.actions("addClass")
        (structure,) = app.session.classes
        (k, j, i) = np.argwhere(labels == 2)[0]
        masked, beyond = [-float(i), -float(j), float(k)], [1000.0, 0.0, 0.0]
        app.session.annotations.add_points(structure.id, np.array([masked, beyond]), positive=True)
        app.refresh()
        assert app.server.state.status.splitlines() == [
            f"⚠ {structure.name}: 1 point outside the volume does not count.",
            f"⚠ {structure.name}: {without_intensity_text(1)}",
        ]
        app.actions("undo")
        assert "⚠" not in app.server.state.status

    in_app(journey)


def test_of_two_volumes_that_are_being_opened_the_one_that_was_asked_for_last_stays(
    in_app: Callable[[Journey], None], file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def journey(app: WebApp) -> None:
        state, may_be_read, read = app.server.state, threading.Event(), opening.volume_of_files

        def read_late(paths: list[Path], on_warning: Callable[[str], None], series: str | None) -> Volume:
            if paths == [file]:
                assert may_be_read.wait(60.0)
                on_warning("a slice may be missing")
            return read(paths, on_warning, series)

        monkeypatch.setattr(opening, "volume_of_files", read_late)
        other = tmp_path / "other.nrrd"
        sitk.WriteImage(sitk.GetImageFromArray(np.arange(1000, dtype=np.int16).reshape(10, 10, 10)), str(other))
        first = asyncio.create_task(app.opening.open([file]))
        await asyncio.sleep(0)
        second = asyncio.create_task(app.opening.open([other]))
        await asyncio.sleep(0)
        assert state.opening == "other.nrrd"
        await second
        app.actions("addClass")
        may_be_read.set()
        await first
        assert (state.volume_name, state.opening, state.message) == ("other", "", "")
        assert len(state.classes) == 1

    in_app(journey)


def test_what_arrives_while_the_app_ends_is_not_opened(
    opened: Callable[[Journey], None], file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def journey(app: WebApp) -> None:
        session = app.session
        with monkeypatch.context() as patched:
            patched.setattr(WebApp, "stopping", True)
            await app.opening.open([file])
        assert app.session is session

    opened(journey)


ON_ANY_PORT = Namespace(sample=False, volume=None, series=None, host="127.0.0.1", port=0, no_browser=True)


@pytest.fixture
def pretended(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Pretends that `vittf app` runs on another system."""

    def pretend(platform: str) -> None:
        if platform == "win32":
            monkeypatch.setattr(app_command, "sys", SimpleNamespace(platform=platform))
            monkeypatch.setattr(ctypes, "WINFUNCTYPE", ctypes.CFUNCTYPE, raising=False)
            monkeypatch.setattr(
                ctypes, "windll", SimpleNamespace(kernel32=SimpleNamespace(SetConsoleCtrlHandler=lambda *_: 1)), raising=False
            )
            # Ctrl-Break, by any number that nobody uses.
            monkeypatch.setattr(signal, "SIGBREAK", signal.SIGUSR1, raising=False)

    return pretend


def test_features_that_are_cancelled_before_they_begin_are_not_computed(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("extract")
        assert app.server.state.pressed
        app.actions("cancel")
        assert not app.server.state.pressed

    opened(journey)


def test_why_nothing_can_listen_is_told_in_the_words_of_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    said = {10048: "Only one usage of each socket address is normally permitted."}
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(ctypes, "FormatError", said.get, raising=False)
    in_use = OSError(10048, "error while attempting to bind on address ('127.0.0.1', 80)")
    assert serving._reason(in_use) == "Only one usage of each socket address is normally permitted"


def test_of_a_host_that_nobody_knows_it_is_said_that_its_name_is_unknown() -> None:
    """What is wrong with names has numbers that the C library does not know."""
    unknown = socket.gaierror(socket.EAI_NONAME, "Name or service not known")
    assert serving._reason(unknown) == "Name or service not known"


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot be sent a Ctrl-C there")
@pytest.mark.parametrize("platform", ["as here", "win32"])
def test_an_interruption_while_the_scene_is_made_waits_until_it_is_and_then_ends_the_app(
    platform: str, pretended: Callable[[str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    before = signal.getsignal(signal.SIGINT)
    pretended(platform)

    class InterruptedApp:
        def __init__(self, settings: dict[str, Any]) -> None:
            self._stopped = asyncio.Event()
            os.kill(os.getpid(), signal.SIGINT)

        def stop(self) -> None:
            self._stopped.set()

        async def start(self, *_: Any) -> None:
            await asyncio.wait_for(self._stopped.wait(), 60.0)

    monkeypatch.setattr(app_module, "WebApp", InterruptedApp)
    try:
        asyncio.run(app_command._serve(ON_ANY_PORT, {}))
    except KeyboardInterrupt:
        pytest.fail("it came in the midst of making the scene")
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot be sent a Ctrl-C there")
@pytest.mark.parametrize(
    ("platform", "number", "raised"),
    [
        ("as here", signal.SIGINT, KeyboardInterrupt),
        ("as here", signal.SIGTERM, Terminated),
        ("win32", signal.SIGINT, KeyboardInterrupt),
    ],
)
def test_an_interruption_while_slicers_code_is_loaded_waits_until_it_is_and_then_ends_the_command(
    platform: str,
    number: int,
    raised: type[BaseException],
    pretended: Callable[[str], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pretended(platform)
    loaded = []

    class InterruptedModule(ModuleType):
        def __getattr__(self, name: str) -> Any:
            if name != "WebApp":
                raise AttributeError(name)
            os.kill(os.getpid(), number)
            loaded.append(name)
            return lambda _: pytest.fail("it went on")

    # Where the command lets it come at once, this process is to live on.
    before = signal.signal(signal.SIGTERM, lambda *_: pytest.fail("it came in the midst of loading"))
    monkeypatch.setitem(sys.modules, app_module.__name__, InterruptedModule(app_module.__name__))
    try:
        with pytest.raises(raised):
            asyncio.run(app_command._serve(ON_ANY_PORT, {}))
    finally:
        signal.signal(signal.SIGTERM, before)
    assert loaded


@pytest.mark.skipif(sys.platform == "win32", reason="a window cannot be closed there by a test")
@pytest.mark.parametrize(("event", "ends"), [(0, False), (1, False), (2, True), (5, True), (6, True)])
def test_on_windows_a_console_window_that_is_closed_has_the_app_end_before_the_process_does(
    event: int, ends: bool, pretended: Callable[[str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    pretended("win32")
    heard: list[Any] = []
    stopped: list[bool] = []
    until_stopped = threading.Event()
    ctypes.windll.kernel32.SetConsoleCtrlHandler = lambda handler, _: heard.append(handler)  # type: ignore[attr-defined]
    # Windows ends the process when the call returns.
    monkeypatch.setattr(app_command, "time", SimpleNamespace(sleep=lambda _: until_stopped.wait(60.0)))

    class App:
        def __init__(self, settings: dict[str, Any]) -> None:
            self._stopped = asyncio.Event()

        def stop(self) -> None:
            self._stopped.set()

        async def start(self, *_: Any) -> None:
            calling = asyncio.create_task(asyncio.to_thread(heard[0], event))
            if ends:
                await asyncio.wait_for(self._stopped.wait(), 60.0)
                stopped.append(not calling.done())
                until_stopped.set()
            assert await calling == ends

    monkeypatch.setattr(app_module, "WebApp", App)
    asyncio.run(app_command._serve(ON_ANY_PORT, {}))
    assert stopped == [True] * ends
    assert heard[0](event) == ends, "the loop has ended"


def test_edges_of_a_slice_name_the_sides_of_the_patient() -> None:
    axial = np.diag([-1.0, 1.0, 1.0, 1.0])
    assert sides(axial) == {"left": "R", "right": "L", "top": "A", "bottom": "P", "positive": "S", "negative": "I"}
    sagittal = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]], dtype=float)
    assert sides(sagittal) == {"left": "A", "right": "P", "top": "S", "bottom": "I", "positive": "R", "negative": "L"}


def test_positions_are_named_by_the_patients_sides() -> None:
    assert position_text(np.array([98.4, 163.6, 394.0])) == "R 98, A 164, S 394"
    assert position_text(np.array([-0.6, -7.0, -0.4])) == "L 1, P 7, S 0"


@pytest.mark.parametrize(
    "leave",
    [lambda app: app.views.use("Red", [["leave", [0.0, 0.5], [False] * 3]]), lambda app: app.views.leave()],
    ids=["the mouse left", "a picture is made"],
)
def test_the_next_point_is_not_shown_where_the_mouse_is_in_no_view(
    opened: Callable[[Journey], None], leave: Callable[[WebApp], None]
) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        view = app.views.slices[0]
        view.render_window().SetSize(300, 300)
        view.reset_view()
        view.render_window().Render()
        view.interactor().SetEventPosition(150, 150)
        view.interactor().InvokeEvent("MouseMoveEvent")
        points = app.session.annotations.points_node(app.session.classes[0].id, True)
        assert points.GetNumberOfControlPoints() == 1
        assert points.GetNthControlPointPositionStatus(0) == points.PositionPreview
        leave(app)
        assert points.GetNumberOfControlPoints() == 0

    opened(journey)


@pytest.mark.parametrize("way", ["undo", "remove"])
def test_a_click_after_the_only_structure_was_taken_back_leaves_nothing_behind(
    opened: Callable[[Journey], None], way: str
) -> None:
    async def journey(app: WebApp) -> None:
        view = app.views.slices[0]
        view.render_window().SetSize(300, 300)
        view.reset_view()
        app.actions("addClass")
        (structure,) = app.session.classes
        app.actions(way, *([structure.id] if way == "remove" else []))
        assert app.session.classes == ()
        for event in ("MouseMoveEvent", "LeftButtonPressEvent", "LeftButtonReleaseEvent"):
            view.interactor().SetEventPosition(150, 150)
            view.interactor().InvokeEvent(event)
        # Slicer would make a list of its own, which nothing on the page removes, and sessions keep.
        assert app.scene.GetNumberOfNodesByClass("vtkMRMLMarkupsNode") == 0

    opened(journey)


def test_another_attempt_takes_the_place_of_what_the_earlier_one_said(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        state = app.server.state
        for grid in (200, 300):
            app.actions("parameter", "grid", grid)
        app.actions("parameter", "overlayOpacity", state.parameters["overlayOpacity"])
        assert state.message == "The grid must have 4 to 128 cells; got 300."
        for typed in ("/nowhere/a.nrrd", "/nowhere/b.nrrd", '"/nowhere/c.nrrd"'):
            app.opening.open_typed(typed)
            await asyncio.gather(*app._tasks)
        app.refresh()
        first, second = state.message.split("\n\n")
        assert "got 300" in first
        assert str(Path("/nowhere/c.nrrd")) in second
        app.actions("parameter", "grid", 0)
        assert state.message == second

    opened(journey)


def test_what_was_told_of_a_scan_is_gone_with_it(opened: Callable[[Journey], None], file: Path) -> None:
    async def journey(app: WebApp) -> None:
        app.report("Nothing was drawn.")
        app.session.tell_of_defect(RuntimeError("of this scan"))
        app.refresh()
        assert "Nothing was drawn." in app.server.state.message
        assert "of this scan" in app.server.state.message
        await app.opening.open([file])
        assert app.server.state.message == ""

    opened(journey)


def test_features_that_were_asked_for_of_one_scan_are_not_computed_of_the_next(
    opened: Callable[[Journey], None], file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def journey(app: WebApp) -> None:
        started: list[bool] = []
        monkeypatch.setattr(SceneSession, "start_extraction", lambda self: started.append(True))
        app.extraction.press()
        await app.opening.open([file])
        app.session.wait()
        app.refresh()
        assert not app.server.state.pressed
        assert started == []

    opened(journey)


@pytest.mark.parametrize("tool", ["pointOn", "brushOff", "eraser"])
def test_a_tool_without_a_structure_says_what_to_do_first(opened: Callable[[Journey], None], tool: str) -> None:
    async def journey(app: WebApp) -> None:
        state = app.server.state
        app.actions(tool)
        assert state.tool == ""
        assert state.message.endswith("add a structure first.")
        app.actions("addClass")
        assert state.message == ""

    opened(journey)


def test_a_tool_without_a_scan_says_that_one_comes_first(in_app: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        app._close_scene()
        app._take_session()
        app.actions("pointOn")
        assert "open one first" in app.server.state.message

    in_app(journey)


def test_the_window_that_is_shown_is_one_of_those_that_are_offered_whatever_the_voxels(
    in_app: Callable[[Journey], None], tmp_path: Path
) -> None:
    array = np.random.default_rng(0).normal(300.0, 70.0, (12, 12, 12)).astype(np.float32)
    sitk.WriteImage(sitk.GetImageFromArray(array), str(tmp_path / "mr.nrrd"))

    async def journey(app: WebApp) -> None:
        await app.opening.open([tmp_path / "mr.nrrd"])
        state = app.server.state
        (offered,) = state.windows
        assert {"low": offered["low"], "high": offered["high"]} == state.window
        # Four digits of the width fit into a field, and nobody sees more.
        assert all(len(f"{end:g}") <= 5 and end == round(end, 1) for end in state.window.values())

    in_app(journey)


def test_a_slice_view_tells_the_position_and_the_intensity_under_the_mouse(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        view, state = app.views.slices[0], app.server.state
        volume = app.session.parameters.volume
        array, node, interactor = array_from_node(volume), view.get_view_node(), view.interactor()
        view.render_window().SetSize(300, 300)
        view.reset_view()
        bounds = [0.0] * 6
        volume.GetRASBounds(bounds)
        middle = [(low + high) / 2 for low, high in zip(bounds[::2], bounds[1::2], strict=True)]
        ras_to_xy = np.linalg.inv(numpy_matrix(node.GetXYToRAS()))
        x, y = (round(value) for value in (ras_to_xy @ [*middle, 1.0])[:2])
        interactor.SetEventPosition(x, y)
        interactor.InvokeEvent("MouseMoveEvent")
        position, _, intensity = state.probe_Red.partition(": ")
        shown = np.array(node.GetXYToRAS().MultiplyPoint((x, y, 0.0, 1.0))[:3])
        k, j, i = geometry_from_node(volume).nearest_voxels(shown[None])[0]
        assert position == position_text(shown)
        assert float(intensity) == pytest.approx(float(array[k, j, i]), rel=1e-4)
        # The wheel leafs, and the mouse stays.
        view.set_slice_value(view.get_slice_value() + 5.0)
        assert state.probe_Red.partition(": ")[0] != position
        interactor.SetEventPosition(-10_000, -10_000)
        interactor.InvokeEvent("MouseMoveEvent")
        assert ":" not in state.probe_Red

    opened(journey)


def test_under_a_resting_mouse_what_is_told_is_of_the_scan_that_was_opened_last(
    opened: Callable[[Journey], None], file: Path
) -> None:
    brighter = file.with_name("brighter.nrrd")
    sitk.WriteImage(sitk.ReadImage(str(file)) + 1000.0, str(brighter))

    async def journey(app: WebApp) -> None:
        app.views.use("Red", [["hover", [0.5, 0.5], [False] * 3]])
        position, _, intensity = app.server.state.probe_Red.partition(": ")
        await app.opening.open([brighter])
        there, _, now = app.server.state.probe_Red.partition(": ")
        assert (there, float(now)) == (position, pytest.approx(float(intensity) + 1000.0, abs=1.0))
        app.views.leave()
        await app.opening.open([file])
        assert app.server.state.probe_Red == ""

    opened(journey)


def test_the_finer_the_voxels_the_finer_positions_are_told(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        volume = app.session.parameters.volume
        point = np.array([-1.26, -2.04, 0.04])
        assert probe_text(volume, point).startswith("L 1, P 2, S 0")
        volume.SetSpacing(0.1, 0.1, 0.1)
        assert probe_text(volume, point).startswith("L 1.3, P 2.0, S 0.0")
        volume.SetSpacing(0.02, 0.02, 0.02)
        assert probe_text(volume, point).startswith("L 1.26, P 2.04, S 0.04")

    opened(journey)


def test_turns_of_the_wheel_that_come_together_count_each(opened: Callable[[Journey], None]) -> None:
    async def journey(app: WebApp) -> None:
        view = app.views.slices[0]
        view.render_window().SetSize(300, 300)
        view.reset_view()
        step, before = view.get_slice_step(), view.get_slice_value()
        app.views.use("Red", [["wheel", [0.5, 0.5], [False, False, False], 3]])
        assert view.get_slice_value() == pytest.approx(before + 3 * step)
        app.views.use("Red", [["wheel", [0.5, 0.5], [False, False, False], -3]])
        assert view.get_slice_value() == pytest.approx(before)
        field_of_view = view.get_view_node().GetFieldOfView()
        app.views.use("Red", [["wheel", [0.5, 0.5], [True, False, False], 2]])
        assert view.get_view_node().GetFieldOfView() != field_of_view
        assert view.get_slice_value() == pytest.approx(before)
        app.views.use("Red", [["wheel", [0.5, 0.5], [False, False, False], 0]])
        assert view.get_slice_value() == pytest.approx(before)
        # As many as come while the app is busy, but not what no hand does.
        turned: list[str] = []
        view.interactor().AddObserver("MouseWheelForwardEvent", lambda caller, event: turned.append(event), 1000.0)
        app.views.use("Red", [["wheel", [0.5, 0.5], [False, False, False], 3 * MOST_NOTCHES]])
        assert len(turned) == MOST_NOTCHES

    opened(journey)


def test_the_wheel_with_ctrl_over_the_selected_structure_changes_its_size(
    opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def journey(app: WebApp) -> None:
        app.actions("addClass")
        monkeypatch.setattr(app.session.shown, "is_on_selected", lambda point_ras: True)
        app.views.use("Red", [["wheel", [0.5, 0.5], [True, False, False], 2]])
        assert app.session.classes[0].size > 0.0
        app.views.use("Red", [["wheel", [0.5, 0.5], [True, False, False], -2]])
        assert app.session.classes[0].size == 0.0

    opened(journey)


def test_colours_come_back_from_the_page_as_they_went() -> None:
    assert hex_color(color_of_hex("#0a80ff")) == "#0a80ff"
    for text in ("red", "#12345", "#gg0000", ""):
        with pytest.raises(ValueError, match=r"colour|literal"):
            color_of_hex(text)


def test_what_a_poll_raises_is_told_once_and_the_app_goes_on(
    opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async def journey(app: WebApp) -> None:
        polls = 0

        def fail(*_: object) -> None:
            nonlocal polls
            polls += 1
            raise RuntimeError("shapes do not fit")

        with monkeypatch.context() as patched:
            patched.setattr(app.session, "_take_in", fail)
            following = asyncio.create_task(app._follow())
            while polls < 20 and not following.done():
                app._on_changed()
                await asyncio.sleep(0.001)
            assert not following.done()
        assert app.server.state.message.startswith("Something unexpected went wrong (RuntimeError: shapes do not fit)")
        app.actions("addClass")
        assert app.server.state.message == ""
        following.cancel()

    opened(journey)
    assert [str(record.exc_info[1]) for record in caplog.records if record.exc_info] == ["shapes do not fit"]


def fail(*_: object) -> None:
    """What nobody foresaw."""
    raise RuntimeError("shapes do not fit")


def test_what_an_action_raises_is_told_on_the_page(opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch) -> None:
    async def journey(app: WebApp) -> None:
        following = asyncio.create_task(app._follow())
        with monkeypatch.context() as patched:
            patched.setattr(app.session.annotations, "undo", fail)
            with pytest.raises(RuntimeError, match="shapes do not fit"):
                app.server.controller.trigger_fn("ask")("page", 1, "act", ["undo"])
        await until(lambda: app.server.state.message != "")
        assert app.server.state.message.startswith("Something unexpected went wrong (RuntimeError: shapes do not fit)")
        app.server.controller.trigger_fn("ask")("page", 2, "act", ["addClass"])
        assert app.server.state.message == ""
        following.cancel()

    opened(journey)


def test_what_a_file_that_is_opened_raises_is_told_on_the_page(
    opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    async def journey(app: WebApp) -> None:
        following = asyncio.create_task(app._follow())
        with monkeypatch.context() as patched:
            patched.setattr(app.opening, "_read", fail)
            app.opening.open_typed(str(tmp_path / "scan.nrrd"))
            await until(lambda: app.server.state.message != "")
        assert app.server.state.message.startswith("Something unexpected went wrong (RuntimeError: shapes do not fit)")
        assert app.server.state.opening == ""
        following.cancel()

    opened(journey)
    assert [str(record.exc_info[1]) for record in caplog.records if record.exc_info] == ["shapes do not fit"]


def test_the_page_says_what_points_lack_without_features(
    opened: Callable[[Journey], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def journey(app: WebApp) -> None:
        assert app.server.state.missing == ""
        monkeypatch.setattr(panel_state, "missing_text", lambda session: "Points wait.")
        app.refresh()
        assert app.server.state.missing == "Points wait."

    opened(journey)
