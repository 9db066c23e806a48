"""The module in the life of the application: reloaded, tested, and opened in a Slicer that is too old for it."""

from __future__ import annotations

import ast
import re
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import slicer

from ViTTransferFunction.Logic.scene.annotation.annotations import SceneAnnotations
from ViTTransferFunction.Logic.scene.interface.parameters import SceneParameters
from ViTTransferFunction.Testing.support.programs import OPEN, run
from ViTTransferFunction.Testing.support.scenes import add_parameter_node
from ViTTransferFunction.Testing.support.standin import sample_data
from ViTTransferFunction.Testing.support.standin.host import Host

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]

MODULE_FILE = Path(__file__).parents[2] / "ViTTransferFunction.py"
OURS = "[name for name in sys.modules if name.startswith('ViTTransferFunction.') and '.Testing' not in name]"


@pytest.mark.slow
def test_reloading_loads_all_files_again_and_never_imports_torch(tmp_path: Path) -> None:
    program = OPEN + (
        "assert not ui.pytorchFrame.isVisible()\n"
        f"old = {{name: sys.modules[name] for name in {OURS}}}\n"
        "assert len(old) > 20\n"
        "widget.onReload()\n"
        "fresh = host.representation.self()\n"
        "kept = [name for name, module in old.items() if sys.modules.get(name) is module]\n"
        "assert kept == [], kept\n"
        "assert type(fresh.panel) is not type(widget.panel)\n"
        "assert 'torch' not in sys.modules\n"
        "host.close()\n"
    )
    run(program, tmp_path)


@pytest.mark.slow
def test_a_reload_while_the_module_is_open_leaves_a_panel_that_works(tmp_path: Path) -> None:
    program = OPEN + (
        "ui.addClassButton.click()\n"
        "interaction = slicer.app.applicationLogic().GetInteractionNode()\n"
        "assert interaction.GetPlaceModePersistence()\n"
        "widget.onReload()\n"
        "fresh = host.representation.self()\n"
        "assert fresh is not widget and fresh is slicer.modules.ViTTransferFunctionWidget\n"
        "assert widget.panel.session is None and widget.panel.shortcuts.installed == []\n"
        "assert not interaction.GetPlaceModePersistence()\n"
        "assert len(fresh.panel.session.classes) == 1\n"
        "assert fresh.panel.shortcuts.installed\n"
        "fresh.ui.addClassButton.click()\n"
        "assert len(fresh.panel.session.classes) == 2\n"
        "slicer.mrmlScene.Clear(False)\n"
        "assert widget.panel.session is None and fresh.panel.session.classes == ()\n"
        "for _ in range(2):\n"
        "    fresh.ui.addClassButton.click()\n"
        "host.representation.exit()\n"
        "assert fresh.panel.shortcuts.installed == []\n"
        "fresh.onReload()\n"
        "assert host.representation.self().panel.session is None\n"
        "host.representation.enter()\n"
        "assert len(host.representation.self().panel.session.classes) == 2\n"
        "host.close()\n"
    )
    run(program, tmp_path)


def test_reload_and_test_passes(tmp_path: Path, real_weights: Path) -> None:
    printed = run(OPEN + "widget.onReloadAndTest()\nhost.close()\n", tmp_path, VITTF_WEIGHTS=str(real_weights))
    assert printed.splitlines()[-1] == "VITTF SELF-TEST PASSED"


def test_the_self_test_passes(
    widget: Any, real_weights: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("VITTF_WEIGHTS", str(real_weights))
    assert run_self_test(capsys) == "VITTF SELF-TEST PASSED"


def test_a_self_test_that_fails_says_so(
    widget: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setenv("VITTF_WEIGHTS", str(tmp_path / "not there"))
    with pytest.raises(AssertionError, match="no weights file"):
        slicer.selfTests["ViTTransferFunction"](msec=0)
    assert capsys.readouterr().out.splitlines()[-1] == "VITTF SELF-TEST FAILED"


@pytest.mark.slow
def test_the_self_test_is_skipped_without_pytorch_and_says_so(tmp_path: Path) -> None:
    program = f"import sys\nsys.modules['torch'] = None\n{OPEN}slicer.selfTests['ViTTransferFunction'](msec=0)\nhost.close()\n"
    assert run(program, tmp_path).splitlines()[-1] == "VITTF SELF-TEST SKIPPED: PyTorch is not installed."


@pytest.fixture
def no_network(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever opens an address does not get there."""

    def unreachable(*args: Any, **kwargs: Any) -> None:
        raise urllib.error.URLError("no route to host")

    monkeypatch.setattr(urllib.request, "urlopen", unreachable)


@pytest.fixture
def no_data(monkeypatch: pytest.MonkeyPatch) -> None:
    """Slicer's module SampleData looks for the first of no nodes where it cannot download any."""
    monkeypatch.setattr(sample_data, "downloadSample", lambda name: [][0])


def test_the_self_test_is_skipped_without_a_network_and_says_so(
    widget: Any, no_network: None, no_data: None, capsys: pytest.CaptureFixture[str]
) -> None:
    verdict = run_self_test(capsys)
    assert verdict.startswith("VITTF SELF-TEST SKIPPED: https://github.com/Slicer/SlicerTestingData")
    assert "no route to host" in verdict


def test_the_self_test_is_skipped_where_weights_cannot_be_downloaded(
    widget: Any, no_network: None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(type(widget.panel.session), "start_extraction", lambda session: None)
    assert run_self_test(capsys).startswith("VITTF SELF-TEST SKIPPED: https://dl.fbaipublicfiles.com")


def test_the_self_test_fails_where_the_network_is_there_and_the_data_is_not(
    widget: Any, no_data: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*args: Any, **kwargs: Any) -> None:
        raise urllib.error.HTTPError("https://github.com", 404, "Not Found", {}, None)  # type: ignore[arg-type]

    monkeypatch.setattr(urllib.request, "urlopen", refuse)
    with pytest.raises(IndexError):
        slicer.selfTests["ViTTransferFunction"](msec=0)


def test_the_modules_file_is_written_in_the_python_of_older_slicers() -> None:
    ast.parse(MODULE_FILE.read_text(encoding="utf-8"), feature_version=(3, 9))


@pytest.mark.slow
def test_an_older_slicer_is_told_which_one_is_needed_and_nothing_else_happens(tmp_path: Path) -> None:
    program = OPEN.replace(
        "widget = host.open_panel()",
        f"before = set({OURS})\nslicer.app.minorVersion = 8\nwidget = host.open_panel()\nassert set({OURS}) == before",
    ).replace("ui, session = widget.ui, widget.panel.session", "") + (
        "from PySide6.QtWidgets import QLabel\n"
        "print(host.representation.findChild(QLabel).text())\n"
        "slicer.mrmlScene.Clear(False)\n"
        "widget.onReload()\n"
        "slicer.selfTests['ViTTransferFunction'](msec=0)\n"
        "host.close()\n"
    )
    told, *_, verdict = run(program, tmp_path).splitlines()
    assert told == "ViT Transfer Function needs Slicer 5.10 or later, and this is Slicer 5.8: install a newer one."
    assert verdict == f"VITTF SELF-TEST SKIPPED: {told}"


def test_the_help_says_what_the_module_needs_and_that_it_is_for_research(host: Host) -> None:
    from ViTTransferFunction.Logic.features.cache import LIMIT_BYTES
    from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
    from ViTTransferFunction.Logic.weights.models import pretrained_model

    told = host.module.parent.helpText
    for fact in (
        "research use only",
        "Slicer 5.10 or later",
        f"download of {pretrained_model(PRESETS[DEFAULT_PRESET].model).size_mb} MB",
        f"up to {LIMIT_BYTES // 10**9} GB",
    ):
        assert fact in told


def test_the_help_says_how_to_begin_by_the_names_that_buttons_have(host: Host) -> None:
    named = re.findall("<i>(.*?)</i>", host.module.parent.helpText)
    ui = host.open_panel().ui
    buttons = (
        ui.extractButton,
        ui.addClassButton,
        ui.pointOffButton,
        ui.outlineButton,
        ui.lookCloserButton,
        ui.writeSegmentsButton,
    )
    assert named == [button.text() for button in buttons]


def save_scene_with_structures(scene: Any, path: Path, *names: str) -> None:
    """Save a scene that has structures and a setting of its own, the grid, and leave an empty one."""
    parameters = SceneParameters(add_parameter_node(scene))
    parameters.set("grid", 8 * len(names))
    annotations = SceneAnnotations(scene, parameters.node, lambda: None)
    for name in names:
        annotations.add_class(name)
    annotations.close()
    assert scene.WriteToMRB(str(path))
    scene.Clear(False)
    scene.RemoveNode(parameters.node)


@pytest.mark.parametrize("opened_before", [False, True])
def test_scenes_that_are_added_to_each_other_before_the_module_is_opened_keep_their_structures(
    host: Host, slicer_app: Any, tmp_path: Path, opened_before: bool
) -> None:
    if opened_before:
        host.open_panel()
        host.representation.exit()
        slicer_app.scene.Clear(False)
    for file, *names in (("mine", "liver", "spleen"), ("theirs", "aorta")):
        save_scene_with_structures(slicer_app.scene, tmp_path / f"{file}.mrb", *names)
    for file in ("mine", "theirs", "mine"):
        assert slicer_app.scene.ReadFromMRB(str(tmp_path / f"{file}.mrb"))
    host.selectModule("ViTTransferFunction") if opened_before else host.open_panel()
    session = host.representation.self().panel.session
    assert [state.name for state in session.classes] == ["liver", "spleen", "aorta", "liver (2)", "spleen (2)"]
    assert session.parameters.get("grid") == 16


def run_self_test(capsys: pytest.CaptureFixture[str]) -> str:
    """Press *Test*; the verdict."""
    slicer.selfTests["ViTTransferFunction"](msec=0)
    return capsys.readouterr().out.splitlines()[-1]
