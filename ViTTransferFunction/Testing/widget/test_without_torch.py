"""The module on a Slicer that has no PyTorch, and how it gets it."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import slicer

from ViTTransferFunction.Testing.support.imports import SHIPPED_WITH_SLICER, imports_at_file_scope
from ViTTransferFunction.Testing.support.programs import OPEN, run
from ViTTransferFunction.Testing.support.widgets import add_class

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]

MODULE = Path(__file__).parents[2]
GUI = [MODULE / "ViTTransferFunction.py", *sorted((MODULE / "Widget").glob("*.py"))]
GUI_OF_SLICER = {"slicer", "qt", "ctk", "ViTTransferFunction"}


@pytest.mark.parametrize("path", GUI, ids=lambda path: path.name)
def test_a_file_of_the_panel_imports_at_file_scope_only_what_slicer_has(path: Path) -> None:
    for name in imports_at_file_scope(path):
        known = name in SHIPPED_WITH_SLICER | GUI_OF_SLICER or name in sys.stdlib_module_names
        assert known, f"{path.name} imports {name}"


def test_the_folder_of_the_panel_is_no_package_that_hides_others_of_its_name() -> None:
    assert not (MODULE / "Widget" / "__init__.py").exists()


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


def test_without_any_installer_the_panel_says_what_to_install(missing: set[str], widget: Any) -> None:
    missing |= {"PyTorchUtils", "slicer.packaging"}
    widget.ui.installPyTorchButton.click()
    assert "Extensions Manager" in widget.ui.messageLabel.text()


def test_slicer_s_pytorch_extension_installs_it_and_the_panel_is_ready(
    missing: set[str], widget: Any, offer: Callable[..., None]
) -> None:
    """The extension's interface is that of SlicerPyTorch, PyTorchUtils/PyTorchUtils.py."""

    class PyTorchUtilsLogic:
        def installTorch(  # noqa: N802
            self,
            askConfirmation: bool = False,
            forceComputationBackend: Any = None,
            torchVersionRequirement: Any = None,
        ) -> None:
            assert askConfirmation
            missing.remove("torch")

    offer("PyTorchUtils", PyTorchUtilsLogic=PyTorchUtilsLogic)
    widget.ui.installPyTorchButton.click()
    assert not widget.ui.messageFrame.isVisible()
    assert not widget.ui.pytorchFrame.isVisible()


def test_slicer_itself_installs_it_where_the_extension_is_missing(
    missing: set[str], widget: Any, offer: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The interface is that of Slicer's Base/Python/slicer/packaging.py, from 5.11 on."""
    asked = []
    missing.add("PyTorchUtils")
    offer("slicer.packaging", pip_ensure=lambda requirements, requester: asked.append((requirements, requester)))
    monkeypatch.setattr(slicer, "packaging", sys.modules["slicer.packaging"], raising=False)
    widget.ui.installPyTorchButton.click()
    assert asked == [("torch>=2.0", "ViT Transfer Function")]


def test_a_failed_installation_is_reported_in_the_panel(missing: set[str], widget: Any, offer: Callable[..., None]) -> None:
    class PyTorchUtilsLogic:
        def installTorch(self, askConfirmation: bool) -> None:  # noqa: N802
            raise RuntimeError("no space left")

    offer("PyTorchUtils", PyTorchUtilsLogic=PyTorchUtilsLogic)
    widget.ui.installPyTorchButton.click()
    assert "no space left" in widget.ui.messageLabel.text()
    assert widget.ui.pytorchFrame.isVisible()
