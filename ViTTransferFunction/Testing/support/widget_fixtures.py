"""The module's panel, opened on a real scene; a plugin of the test files that ask for it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any

import pytest
import slicer
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_features
from ViTTransferFunction.Testing.support.scenes import add_volume
from ViTTransferFunction.Testing.support.spheres import Spheres
from ViTTransferFunction.Testing.support.standin.host import Host
from ViTTransferFunction.Testing.support.widgets import wait_until


@pytest.fixture
def host(slicer_app: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[Host]:
    """Slicer with our module, not opened yet."""
    failed: list[BaseException] = []
    # What Qt and VTK call back may raise: they say so, and go on.
    monkeypatch.setattr(sys, "excepthook", lambda kind, error, trace: failed.append(error))
    host = Host(slicer_app)
    yield host
    # Qt goes on holding the last key's Ctrl or Shift, and a button that was not let go of, for all tests that follow.
    QTest.keyRelease(host.window, Qt.Key.Key_Shift)
    held = QApplication.mouseButtons()
    host.close()
    for error in failed:
        raise error
    assert held == Qt.MouseButton.NoButton, "let go of the mouse button"


@pytest.fixture
def widget(host: Host) -> Any:
    """The module's widget, opened, on an empty scene."""
    return host.open_panel()


@pytest.fixture
def questions(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The questions that the user was asked, all of which are answered by OK, as in Slicer's testing mode."""
    asked: list[str] = []

    def confirm(text: str, windowTitle: str = "") -> bool:
        asked.append(text)
        return True

    monkeypatch.setattr(slicer.util, "confirmOkCancelDisplay", confirm)
    return asked


@pytest.fixture
def volume(slicer_app: Any, spheres: Spheres) -> Any:
    """A volume node whose features are in the cache, under the grid that tests use."""
    cache_known_features(*spheres)
    return add_volume(slicer_app.scene, spheres[0])


@pytest.fixture
def ready(widget: Any, volume: Any) -> Any:
    """The module's widget with the features of the volume loaded."""
    widget.panel.session.parameters.set("grid", GRID)
    widget.ui.volumeSelector.setCurrentNode(volume)
    wait_until(lambda: widget.panel.session.phase == "ready")
    return widget
