"""PyTorch, which computes the features: whether Slicer has it, and how to get it.

Only the compute process ever imports it. The panel looks for it without importing it, so that it opens anywhere and at once.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import importlib.metadata
import importlib.util
import io
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import slicer
from slicer.i18n import tr as _

from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Widget.section import Report, Section

OLDEST = 2
"""Major version; attention in one step came with it."""
REQUIREMENT = f">={OLDEST}.0"


class PyTorchSection(Section):
    """Explains what is missing and offers to install it; hidden where nothing is.

    Args:
        ui: the widgets of the panel, by name.
        report: shows an error to the user.
        on_installed: called after the installation.
    """

    def __init__(self, ui: Any, report: Report, on_installed: Callable[[], None]) -> None:
        super().__init__(ui, report)
        self._on_installed = on_installed
        self._installing = False
        ui.installPyTorchButton.clicked.connect(self._on_install)

    def refresh(self) -> None:
        """Look for PyTorch."""
        ui, missing = self.ui, not pytorch_is_installed()
        ui.pytorchFrame.visible = missing or self._installing
        ui.pytorchProgressRow.visible = self._installing
        ui.installPyTorchButton.visible = not self._installing
        if missing and not self._installing:
            ui.pytorchLabel.text = explanation(installed_version())

    def _on_install(self) -> None:
        if self._installing:
            return  # While pip talks, Slicer takes clicks.
        try:
            installer = find_installer()
            if slicer.util.confirmOkCancelDisplay(installation_question(installed_version()), _("Install PyTorch?")):
                self._install(installer)
        except InputError as error:
            self.report(str(error), solved=pytorch_is_installed)

    def _install(self, installer: Callable[[], Any]) -> None:
        self._installing = True
        self.refresh()
        try:
            with slicer.util.WaitCursor(), _lines_told(self._show_line):
                install_pytorch(installer)
        finally:
            self._installing = False
            self._on_installed()

    def _show_line(self, line: str) -> None:
        self.ui.pytorchProgressLabel.text = line[:LINE_LENGTH]
        slicer.app.processEvents()


LINE_LENGTH = 60
"""Of what pip says, so much fits into the panel."""


def explanation(version: str | None) -> str:
    """Why the panel asks for PyTorch, where Slicer has none, or an old one."""
    if version is None:
        return _(
            "This module computes with PyTorch, which is not installed in Slicer yet. It is a download of up to 3 GB, and "
            "takes some minutes. Everything else works without it."
        )
    return _(
        "This module computes with PyTorch {oldest} or later, and Slicer has version {version}. Another extension may have "
        "installed it and need just that version."
    ).format(oldest=f"{OLDEST}.0", version=version)


def installation_question(version: str | None) -> str:
    """What the user agrees to."""
    question = _(
        "PyTorch will be downloaded, up to 3 GB, and installed in Slicer's own Python. That takes some minutes, during which "
        "Slicer may not react."
    )
    if version is None:
        return question
    return question + "\n\n" + _("It replaces PyTorch {version}, which other extensions may need.").format(version=version)


def pytorch_is_installed() -> bool:
    """Whether Slicer's Python has a PyTorch that is new enough."""
    version = installed_version()
    return version is not None and version.partition(".")[0] not in {str(old) for old in range(OLDEST)}


def installed_version() -> str | None:
    """The version of the PyTorch that Slicer's Python has; "" where it does not say, None where there is none."""
    return None if importlib.util.find_spec("torch") is None else _version_by_its_metadata()


def forget_version() -> None:
    """Look for the version anew: what is installed has changed."""
    _version_by_its_metadata.cache_clear()


@functools.lru_cache(maxsize=1)
def _version_by_its_metadata() -> str:
    try:
        return importlib.metadata.version("torch")
    except importlib.metadata.PackageNotFoundError:
        return ""


def find_installer() -> Callable[[], Any]:
    """What can install PyTorch: Slicer's PyTorch extension, or Slicer itself where that is missing.

    Raises:
        InputError: neither is there.
    """
    try:
        installer = _extension_installer() or _slicer_installer()
    except ImportError as error:
        raise InputError(_not_installed(error)) from error
    if installer is None:
        raise InputError(
            _(
                "PyTorch could not be installed: Slicer's extension 'PyTorch' is missing. Install it with the Extensions "
                "Manager (menu View), restart Slicer, and press this button again."
            )
        )
    return installer


def install_pytorch(installer: Callable[[], Any]) -> None:
    """Install PyTorch.

    Raises:
        InputError: the installation failed.
    """
    try:
        installer()
    except (RuntimeError, OSError, ImportError, subprocess.SubprocessError) as error:
        raise InputError(_not_installed(error)) from error
    finally:
        importlib.invalidate_caches()
        forget_version()
    if not pytorch_is_installed():
        raise InputError(
            _("PyTorch is still not there, or too old. Restart Slicer and try again; the Python console shows what happened.")
        )


def _not_installed(error: Exception) -> str:
    return _(
        "PyTorch was not installed: {reason}. Check the network and the space on the disk, restart Slicer, and try again; the "
        "Python console shows what happened."
    ).format(reason=error)


def _extension_installer() -> Callable[[], Any] | None:
    """The PyTorch extension, which finds the build of PyTorch that fits the computer's graphics card."""
    if importlib.util.find_spec("PyTorchUtils") is None:
        return None
    from PyTorchUtils import PyTorchUtilsLogic

    return lambda: PyTorchUtilsLogic().installTorch(askConfirmation=False, torchVersionRequirement=REQUIREMENT)


def _slicer_installer() -> Callable[[], Any] | None:
    """Slicer's own installer of Python packages, which Slicer has from 5.11 on."""
    if importlib.util.find_spec("slicer.packaging") is None:
        return None
    from slicer.packaging import pip_ensure

    return lambda: pip_ensure(f"torch{REQUIREMENT}", prompt_install=False, requester="ViT Transfer Function")


@contextlib.contextmanager
def _lines_told(tell: Callable[[str], None]) -> Any:
    """Also tell the lines that are printed meanwhile: Slicer prints what pip says."""
    with contextlib.redirect_stdout(_Teller(sys.stdout, tell)):
        yield


class _Teller(io.TextIOBase):
    def __init__(self, stream: Any, tell: Callable[[str], None]) -> None:
        self._stream, self._tell = stream, tell

    def write(self, text: str) -> int:
        self._stream.write(text)
        if text.strip():
            self._tell(text.strip())
        return len(text)

    def flush(self) -> None:
        self._stream.flush()
