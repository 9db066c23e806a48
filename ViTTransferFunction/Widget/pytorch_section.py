"""Where the panel explains that PyTorch is missing, and has it installed."""

from __future__ import annotations

import contextlib
import io
import sys
from collections.abc import Callable, Iterator
from typing import Any

import slicer
from slicer.i18n import tr as _

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Widget.pytorch_installation import (
    OLDEST,
    find_installer,
    install_pytorch,
    installed_version,
    pytorch_is_installed,
)
from ViTTransferFunction.Widget.section import Report, Section

LINE_LENGTH = 60
"""Of what pip says, so much fits into the panel."""


class PyTorchSection(Section):
    """Explains what is missing and offers to install it; hidden where nothing is.

    Args:
        ui: the widgets of the panel, by name.
        report: shows an error to the user.
        on_change: called when an installation begins, and when it has ended.
    """

    def __init__(self, ui: Any, report: Report, on_change: Callable[[], None]) -> None:
        super().__init__(ui, report)
        self._on_change = on_change
        self._installing = False
        self._attempts = 0
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
            attempt = self._attempts
            self.report(str(error), solved=lambda: pytorch_is_installed() or self._attempts > attempt)

    def _install(self, installer: Callable[[], Any]) -> None:
        self._installing = True
        self._attempts += 1
        self._on_change()
        try:
            with slicer.util.WaitCursor(), _lines_told(self._show_line):
                install_pytorch(installer)
        finally:
            self._installing = False
            self._on_change()

    def _show_line(self, line: str) -> None:
        self.ui.pytorchProgressLabel.text = line if len(line) <= LINE_LENGTH else f"{line[:LINE_LENGTH]}…"
        slicer.app.processEvents()


def explanation(version: str | None) -> str:
    """Why the panel asks for PyTorch, where Slicer has none, or an old one."""
    if version is None:
        return _(
            "This module computes with PyTorch, which is not installed in Slicer yet. It is a download of up to 3 GB, and "
            "takes some minutes. Until then you can place points, but not segment."
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


@contextlib.contextmanager
def _lines_told(tell: Callable[[str], None]) -> Iterator[None]:
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
