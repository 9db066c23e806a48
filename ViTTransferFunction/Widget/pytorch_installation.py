"""PyTorch, which computes the features: whether Slicer has it, and how to get it.

Only the compute process ever imports it. The panel looks for it without importing it, so that it opens anywhere and at once.
"""

from __future__ import annotations

import importlib
import importlib.util
import subprocess
from collections.abc import Callable
from typing import Any

from slicer.i18n import tr as _

from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Widget.section import Report, Section

REQUIREMENT = "torch>=2.0"


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
        ui.installPyTorchButton.clicked.connect(self._on_install)

    def refresh(self) -> None:
        """Look for PyTorch."""
        self.ui.pytorchFrame.visible = not pytorch_is_installed()

    def _on_install(self) -> None:
        try:
            install_pytorch()
        except InputError as error:
            self.report(str(error))
        self._on_installed()


def pytorch_is_installed() -> bool:
    """Whether Slicer's Python has PyTorch."""
    return importlib.util.find_spec("torch") is not None


def install_pytorch() -> None:
    """Install PyTorch, as the user confirms: by Slicer's PyTorch extension, or by Slicer itself where that is missing.

    Raises:
        InputError: neither is there, or the installation failed.
    """
    installer = _extension_installer() or _slicer_installer()
    if installer is None:
        raise InputError(
            _(
                "PyTorch could not be installed: Slicer's extension 'PyTorch' is missing. Install it with the Extensions "
                "Manager (menu View), restart Slicer, and press this button again."
            )
        )
    try:
        installer()
    except (RuntimeError, OSError, subprocess.SubprocessError) as error:
        raise InputError(
            _(
                "PyTorch was not installed: {reason}. Check the network and the space on the disk, and try again; "
                "the Python console shows what happened."
            ).format(reason=error)
        ) from error
    importlib.invalidate_caches()


def _extension_installer() -> Callable[[], Any] | None:
    """The PyTorch extension, which finds the build of PyTorch that fits the computer's graphics card."""
    if importlib.util.find_spec("PyTorchUtils") is None:
        return None
    from PyTorchUtils import PyTorchUtilsLogic

    return lambda: PyTorchUtilsLogic().installTorch(askConfirmation=True)


def _slicer_installer() -> Callable[[], Any] | None:
    """Slicer's own installer of Python packages, which Slicer has from 5.11 on."""
    if importlib.util.find_spec("slicer.packaging") is None:
        return None
    from slicer.packaging import pip_ensure

    return lambda: pip_ensure(REQUIREMENT, requester="ViT Transfer Function")
