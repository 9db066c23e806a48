"""Slicer makes its module panel as wide as what is in it wants to be, and so the views narrower: ours stays as it is."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

import slicer
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication, QImageReader
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel

from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.scene.mrml.nodes import in_text
from ViTTransferFunction.Testing.support.scenes import add_volume
from ViTTransferFunction.Testing.support.standin.host import MODULE_FILE, PANEL_WIDTH, Host
from ViTTransferFunction.Testing.support.widgets import add_class
from ViTTransferFunction.Widget.wording import breakable

pytest_plugins = ["ViTTransferFunction.Testing.support.widget_fixtures"]

SECTIONS = ("volume", "classes", "display", "appearance", "pictures", "output", "shortcuts", "advanced")
LONG_NAME = "5: CT Thorax Abdomen Pelvis with contrast, portal venous phase 1.0 B31f iMAR"
ONE_LONG_WORD = "5_CT_Thorax_Abdomen_Pelvis_with_contrast_portal_venous_phase_1.0_B31f_iMAR"
WINDOWS_PATH = "C:\\Users\\Firstname.Lastname\\AppData\\Local\\ViTTransferFunction\\Cache\\weights\\dinov2_vits14_pretrain.pth"
LARGEST_SCALE = 3
"""Device pixels for each of Qt's, of the finest screens."""


def width(host: Host) -> int:
    """What the panel wants at least, as qSlicerModulePanel asks it."""
    slicer.app.processEvents()
    return host.wanted_width


def test_the_panel_gets_no_wider_when_its_sections_are_opened(widget: Any, host: Host) -> None:
    add_class(widget)
    before = width(host)
    for name in SECTIONS:
        button = getattr(widget.ui, f"{name}CollapsibleButton")
        if button.property("collapsed"):
            button.click()
        assert width(host) <= before, name
    assert before < PANEL_WIDTH


def test_a_window_of_small_numbers_makes_no_wider_panel(widget: Any, host: Host, volume: Any) -> None:
    widget.ui.volumeSelector.setCurrentNode(volume)
    widget.ui.advancedCollapsibleButton.collapsed = False
    widget.ui.windowAutomaticCheckBox.click()
    before = width(host)
    widget.panel.session.parameters.set_window(0.0004, 0.0025, automatic=False)
    widget.panel.refresh()
    assert widget.ui.windowLowSpinBox.text() == "0.000400"
    assert width(host) <= before < PANEL_WIDTH


@pytest.mark.parametrize("name", [LONG_NAME, ONE_LONG_WORD])
def test_a_scan_with_a_long_name_makes_no_wider_panel(host: Host, slicer_app: Any, spheres: Any, name: str) -> None:
    before = width(host)
    node = add_volume(slicer_app.scene, Volume(spheres[0].array, spheres[0].geometry, name))
    assert node.GetName() == name
    widget = host.open_panel()
    widget.ui.volumeSelector.setCurrentNode(node)
    assert before < width(host) < PANEL_WIDTH


def test_no_words_make_the_panel_wider(widget: Any, host: Host) -> None:
    for name in SECTIONS:
        if getattr(widget.ui, f"{name}CollapsibleButton").property("collapsed"):
            getattr(widget.ui, f"{name}CollapsibleButton").click()
    before = width(host)
    wrapped = [each for each in vars(widget.ui).values() if isinstance(each, QLabel) and each.wordWrap()]
    assert len(wrapped) > 10
    for label in wrapped:
        label.setText(f"{LONG_NAME}, about 1 h 10 min left. " * 3)
        row = label.parentWidget()
        assert row is not None
        row.show()
        label.show()
        assert width(host) <= before, label.objectName()


@pytest.mark.parametrize("word", [ONE_LONG_WORD, WINDOWS_PATH], ids=["a name", "a path"])
def test_long_words_in_messages_are_broken(widget: Any, host: Host, word: str) -> None:
    before = width(host)
    widget.panel._messages.show(f"'{word}' cannot be read.", lambda: False)
    assert width(host) <= before
    assert widget.ui.messageLabel.isVisible()


def test_an_address_in_a_message_can_be_copied(widget: Any, host: Host) -> None:
    before, address = width(host), "https://ai.meta.com/resources/models-and-libraries/dinov3-downloads/"
    widget.panel._messages.show(f"Ask for the weights ({address}).", lambda: False)
    assert address in widget.ui.messageLabel.text()
    assert width(host) <= before


def test_a_message_that_begins_with_a_name_from_the_right_runs_from_the_left() -> None:
    name = in_text("בטן")
    assert breakable(f"⚠ Try again.\n\n⚠ '{name}' was moved.") == f"⚠ Try again.\n\n\u200e⚠ '{name}' was moved."
    assert breakable(f"⚠ Place a point on {name} first.") == f"⚠ Place a point on {name} first."


def copy(label: QLabel) -> None:
    """Select all that a label says, and press Ctrl+C."""
    label.setFocus()
    for key in (Qt.Key.Key_A, Qt.Key.Key_C):
        QTest.keyClick(label, key, Qt.KeyboardModifier.ControlModifier)
    slicer.app.processEvents()


def test_what_is_copied_out_of_a_message_is_what_it_says(widget: Any, host: Host) -> None:
    said, clipboard = f"'{WINDOWS_PATH}' cannot be read.", QGuiApplication.clipboard()
    widget.panel._messages.show("Choose another file.", lambda: False)
    copy(widget.ui.messageLabel)
    assert clipboard.text() == "⚠ Choose another file."
    widget.ui.messageCloseButton.click()
    widget.panel._messages.show(said, lambda: False)
    widget.panel._messages.show("Choose another file.", lambda: False)
    copy(widget.ui.messageLabel)
    assert clipboard.text() == f"⚠ {said}\n\n⚠ Choose another file."
    assert clipboard.text() != widget.ui.messageLabel.text()
    of_others = widget.ui.messageLabel.text()[:20]
    clipboard.setText(of_others)
    assert clipboard.text() == of_others
    host.representation.exit()
    copy(widget.ui.messageLabel)
    assert clipboard.text() == widget.ui.messageLabel.text()


def test_the_cache_folder_is_written_so_that_it_can_be_broken(widget: Any, host: Host, monkeypatch: pytest.MonkeyPatch) -> None:
    from pathlib import PureWindowsPath

    from ViTTransferFunction.Logic.scene.interface import cache_contents

    before = width(host)
    monkeypatch.setattr(cache_contents, "cache_folder", lambda: PureWindowsPath(WINDOWS_PATH))
    widget.ui.advancedCollapsibleButton.click()
    assert "Firstname.Lastname" in widget.ui.cacheFolderLabel.text()
    assert width(host) <= before


def test_points_beyond_the_volume_of_a_structure_with_a_long_name_make_no_wider_panel(ready: Any, host: Host) -> None:
    state = add_class(ready, ONE_LONG_WORD)
    before = width(host)
    ready.panel.session.annotations.add_points(state.id, [[1000.0, 0.0, 0.0]], positive=True)
    slicer.app.processEvents()
    assert ready.ui.pointWarningsLabel.isVisible()
    assert width(host) <= before


def test_icons_are_sharp_on_the_finest_screens(widget: Any) -> None:
    """Slicer's engine for icons draws a file once, in the size that it names, and makes it smaller but never larger."""
    shown = widget.ui.pointOnButton.iconSize()
    paths = sorted((MODULE_FILE.parent / "Resources" / "Icons").glob("*.svg"))
    sizes = {path.name: QImageReader(str(path)).size() for path in paths}
    assert len(sizes) > 10
    small = {name: size for name, size in sizes.items() if size.width() < LARGEST_SCALE * shown.width()}
    assert not small
