"""PyTorch, which computes the features: whether Slicer has it, and how to get it.

Only the compute process ever imports it. The panel looks for it without importing it, so that it opens anywhere and at once.
"""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
import importlib.util
import subprocess
from collections.abc import Callable
from typing import Any

from slicer.i18n import tr as _

from ViTTransferFunction.Logic.core.system.errors import InputError

OLDEST = 2
"""Major version; attention in one step came with it."""
REQUIREMENT = f">={OLDEST}.0"


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
            _("PyTorch is still missing, or too old. Restart Slicer and try again; the Python console shows what happened.")
        )


def _not_installed(error: Exception) -> str:
    # Of a program that failed, only the number is known with which it ended, and that tells nobody anything.
    reason = "" if isinstance(error, subprocess.CalledProcessError) else f" ({error})"
    return _(
        "PyTorch was not installed{reason}. Check the network and the space on the disk, and try again. If that does not help, "
        "restart Slicer before you try again; its Python console (menu View) shows what happened."
    ).format(reason=reason)


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
