"""The panel in a Slicer without a main window and views, as where the build of an extension runs its generic tests."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import slicer

from ViTTransferFunction.Testing.support.known_features import GRID
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras
from ViTTransferFunction.Testing.support.standin.host import Host
from ViTTransferFunction.Testing.support.widgets import add_class, place, wait_until

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]


@pytest.fixture
def no_window(host: Host, monkeypatch: pytest.MonkeyPatch) -> Iterator[Host]:
    """Slicer started with --no-main-window."""
    host.window.setObjectName("nobody's")
    with monkeypatch.context() as patched:
        patched.setattr(slicer.app, "layoutManager", lambda: None)
        yield host
        if host.representation.isEntered:
            host.representation.exit()


def test_the_panel_is_made_and_outlives_its_scene(no_window: Host) -> None:
    assert slicer.util.mainWindow() is None
    no_window.representation.reload()
    slicer.mrmlScene.Clear(False)
    no_window.representation.reload()


def test_clicks_become_segments(no_window: Host, volume: Any, spheres: Spheres) -> None:
    no_window.representation.reload()
    no_window.representation.enter()
    widget = no_window.representation.python_widget
    session = widget.panel.session
    session.parameters.set("grid", GRID)
    widget.ui.volumeSelector.setCurrentNode(volume)
    wait_until(lambda: session.phase == "ready")
    add_class(widget, "sphere")
    place(widget, tuple(centre_ras(spheres, 1)[0]))
    session.wait()
    widget.ui.writeSegmentsButton.click()
    session.wait()
    assert session.take_error() is None
    (segmentation,) = slicer.util.getNodesByClass("vtkMRMLSegmentationNode")
    assert segmentation.GetSegmentation().GetNumberOfSegments() == 1
