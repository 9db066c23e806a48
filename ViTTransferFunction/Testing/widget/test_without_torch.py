"""The module on a Slicer that has no PyTorch, and how it gets it."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import slicer
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication

from ViTTransferFunction.Testing.support.imports import SHIPPED_WITH_SLICER, imports_at_file_scope
from ViTTransferFunction.Testing.support.known_features import GRID
from ViTTransferFunction.Testing.support.programs import OPEN, run
from ViTTransferFunction.Testing.support.widgets import add_class, wait_until

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]

MODULE = Path(__file__).parents[2]
GUI = [MODULE / "ViTTransferFunction.py", *sorted((MODULE / "Widget").glob("*.py"))]
GUI_OF_SLICER = {"slicer", "qt", "ctk", "ViTTransferFunction"}


@pytest.mark.parametrize("path", GUI, ids=lambda path: path.name)
def test_a_file_of_the_panel_imports_at_file_scope_only_what_slicer_has(path: Path) -> None:
    for name in imports_at_file_scope(path):
        known = name in SHIPPED_WITH_SLICER | GUI_OF_SLICER or name in sys.stdlib_module_names
        assert known, f"{path.name} imports {name}"


@pytest.mark.slow
def test_the_panel_opens_where_torch_cannot_be_imported_and_explains(tmp_path: Path) -> None:
    program = (
        "import sys\nsys.modules['torch'] = None\n" + OPEN + "assert ui.pytorchFrame.isVisible()\n"
        "assert 'PyTorch' in ui.pytorchLabel.text()\n"
        "ui.addClassButton.click()\n"
        "assert len(session.classes) == 1\n"
        "host.close()\n"
    )
    run(program, tmp_path)


@pytest.fixture
def missing(monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Names of modules that cannot be found: PyTorch, and what tests add."""
    missing, find_spec = {"torch"}, importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name in missing else find_spec(name))
    return missing


@pytest.fixture
def offer(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Have a module with the given content."""

    def put(name: str, **content: Any) -> None:
        module = ModuleType(name)
        module.__spec__ = importlib.machinery.ModuleSpec(name, None)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)

    return put


def test_features_cannot_be_computed_before_pytorch_is_there(missing: set[str], widget: Any, volume: Any) -> None:
    widget.ui.volumeSelector.setCurrentNode(volume)
    assert not widget.ui.extractButton.isEnabled()
    assert widget.ui.extractButton.toolTip() == "Install PyTorch first."
    assert add_class(widget).name


def test_the_missing_pytorch_is_told_once_and_the_volume_is_taken_up_when_it_is_there(
    missing: set[str], widget: Any, volume: Any, extension: Callable[..., None], questions: list[str]
) -> None:
    """Not by the compute process as well, which would have found the same out."""
    session, ui = widget.panel.session, widget.ui
    session.parameters.set("grid", GRID)
    ui.volumeSelector.setCurrentNode(volume)
    session.wait()
    assert session.compute_pid is None
    assert ui.messageFrame.isHidden()
    assert ui.estimateLabel.text() == "Install PyTorch first."
    extension(lambda: missing.remove("torch"))
    ui.installPyTorchButton.click()
    wait_until(lambda: session.phase == "ready")
    assert ui.messageFrame.isHidden()


def test_without_any_installer_the_panel_says_what_to_install(missing: set[str], widget: Any) -> None:
    missing |= {"PyTorchUtils", "slicer.packaging"}
    widget.ui.installPyTorchButton.click()
    assert "Extensions Manager" in widget.ui.messageLabel.text()


@pytest.fixture
def extension(offer: Callable[..., None]) -> Callable[[Callable[[], None]], None]:
    """Slicer's PyTorch extension; its interface is that of SlicerPyTorch, PyTorchUtils/PyTorchUtils.py."""

    def put(install: Callable[[], None]) -> None:
        class PyTorchUtilsLogic:
            def installTorch(  # noqa: N802
                self,
                askConfirmation: bool = False,
                forceComputationBackend: Any = None,
                torchVersionRequirement: Any = None,
                torchvisionVersionRequirement: Any = None,
            ) -> None:
                assert (askConfirmation, torchVersionRequirement) == (False, ">=2.0")
                install()

        offer("PyTorchUtils", PyTorchUtilsLogic=PyTorchUtilsLogic)

    return put


def test_slicer_s_pytorch_extension_installs_it_and_the_panel_is_ready(
    missing: set[str], widget: Any, extension: Callable[..., None], questions: list[str]
) -> None:
    extension(lambda: missing.remove("torch"))
    widget.ui.installPyTorchButton.click()
    assert len(questions) == 1
    assert not widget.ui.messageFrame.isVisible()
    assert not widget.ui.pytorchFrame.isVisible()


def test_while_it_installs_the_panel_shows_what_is_done_and_takes_no_second_order(
    missing: set[str], widget: Any, extension: Callable[..., None], questions: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    seen: list[Any] = []

    def install() -> None:
        print("Downloading torch-2.5.1 (900 MB)")  # noqa: T201
        ui = widget.ui
        widget.panel.refresh()
        seen.append((ui.pytorchProgressRow.isVisible(), ui.installPyTorchButton.isVisible(), ui.pytorchProgressLabel.text()))
        cursor = QApplication.overrideCursor()
        seen.append(cursor and cursor.shape())
        ui.installPyTorchButton.click()
        missing.discard("torch")

    extension(install)
    widget.ui.installPyTorchButton.click()
    row, shape = seen
    assert row == (True, False, "Downloading torch-2.5.1 (900 MB)")
    assert shape == Qt.CursorShape.WaitCursor
    assert QApplication.overrideCursor() is None
    assert "900 MB" in capsys.readouterr().out


def test_who_declines_gets_neither_pytorch_nor_a_message(
    missing: set[str], widget: Any, extension: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def decline(text: str, title: str) -> bool:
        asked.append(text)
        return False

    monkeypatch.setattr(slicer.util, "confirmOkCancelDisplay", decline)
    extension(lambda: pytest.fail("installed without consent"))
    widget.ui.installPyTorchButton.click()
    assert "up to 3 GB" in asked[0]
    assert not widget.ui.messageFrame.isVisible()
    assert widget.ui.installPyTorchButton.isVisible()


def test_slicer_itself_installs_it_where_the_extension_is_missing(
    missing: set[str], widget: Any, offer: Callable[..., None], questions: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The interface is that of Slicer's Base/Python/slicer/packaging.py, from 5.11 on."""
    asked = []

    def pip_ensure(requirements: str, prompt_install: bool = True, requester: str | None = None) -> None:
        asked.append((requirements, prompt_install, requester))
        missing.remove("torch")

    missing.add("PyTorchUtils")
    offer("slicer.packaging", pip_ensure=pip_ensure)
    monkeypatch.setattr(slicer, "packaging", sys.modules["slicer.packaging"], raising=False)
    widget.ui.installPyTorchButton.click()
    assert asked == [("torch>=2.0", False, "ViT Transfer Function")]
    assert not widget.ui.messageFrame.isVisible()


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (RuntimeError("no space left"), "PyTorch was not installed (no space left). Check"),
        (ImportError("DLL load failed"), "PyTorch was not installed (DLL load failed). Check"),
        (OSError("access denied"), "PyTorch was not installed (access denied). Check"),
        (subprocess.CalledProcessError(1, ["PythonSlicer", "-m", "pip"]), "PyTorch was not installed. Check"),
    ],
    ids=["RuntimeError", "ImportError", "OSError", "CalledProcessError"],
)
def test_a_failed_installation_is_reported_until_it_succeeds(
    missing: set[str], widget: Any, extension: Callable[..., None], questions: list[str], error: Exception, told: str
) -> None:
    def fail() -> None:
        raise error

    extension(fail)
    widget.ui.installPyTorchButton.click()
    assert told in widget.ui.messageLabel.text()
    assert widget.ui.pytorchFrame.isVisible()
    widget.ui.addClassButton.click()
    assert widget.ui.messageFrame.isVisible()
    visible_meanwhile = []

    def succeed() -> None:
        visible_meanwhile.append(widget.ui.messageFrame.isVisible())
        missing.remove("torch")

    extension(succeed)
    widget.ui.installPyTorchButton.click()
    assert visible_meanwhile == [False]
    assert not widget.ui.messageFrame.isVisible()


def test_an_installation_that_leaves_nothing_behind_is_reported(
    missing: set[str], widget: Any, extension: Callable[..., None], questions: list[str]
) -> None:
    extension(lambda: None)
    widget.ui.installPyTorchButton.click()
    assert "still missing" in widget.ui.messageLabel.text()


def test_a_pytorch_that_is_too_old_is_replaced_if_the_user_agrees(
    widget: Any, extension: Callable[..., None], questions: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from ViTTransferFunction.Widget import pytorch_installation

    version = ["1.13.1+cu117"]
    monkeypatch.setattr(pytorch_installation.importlib.metadata, "version", lambda name: version[0])
    pytorch_installation.forget_version()
    widget.panel.refresh()
    assert "2.0 or later, and Slicer has version 1.13.1+cu117" in widget.ui.pytorchLabel.text()
    extension(lambda: version.__setitem__(0, "2.5.1"))
    widget.ui.installPyTorchButton.click()
    assert "replaces PyTorch 1.13.1+cu117" in questions[0]
    assert not widget.ui.pytorchFrame.isVisible()
    pytorch_installation.forget_version()
