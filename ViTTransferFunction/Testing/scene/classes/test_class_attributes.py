"""Settings of classes as text: what is written is read, and what is garbled does no harm."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from ViTTransferFunction.Logic.rendering.appearance import Appearance
from ViTTransferFunction.Logic.scene.classes.class_attributes import (
    attribute,
    read_look,
    read_settings,
    set_attribute,
    write_settings,
)
from ViTTransferFunction.Logic.scene.classes.class_state import ClassState

COLOR = (0.25, 0.5, 0.75)
SETTINGS = {
    "iso": 0.125,
    "size": 1.0,
    "proximity": 0.25,
    "refine": False,
    "visible": False,
    "close_up": (1.0, 2.0, 3.0, 10.0, 20.0, 30.0),
    "continues": "Segment_1",
}
LIVER = ClassState("a1", "liver", Appearance(COLOR, opacity=0.5, style="glass", low=-40.0, edges=0.125), **SETTINGS)  # type: ignore[arg-type]
PLAIN = ClassState("b2", "spleen", Appearance(COLOR))


@pytest.fixture
def node(slicer_app: Any) -> Any:
    """With the settings of `LIVER`."""
    node = slicer_app.scene.AddNewNodeByClass("vtkMRMLMarkupsFiducialNode")
    write_settings(node, LIVER)
    return node


def test_what_was_written_is_read(node: Any) -> None:
    assert (read_settings(node), read_look(node, COLOR)) == (SETTINGS, LIVER.look)


def test_of_a_class_that_is_as_by_default_nothing_is_kept(node: Any) -> None:
    write_settings(node, PLAIN)
    assert read_look(node, COLOR) == PLAIN.look
    assert all(getattr(PLAIN, name) == value for name, value in read_settings(node).items())
    assert [attribute(node, name) for name in ("iso", "low", "closeUp", "continues")] == [None] * 4


@pytest.mark.parametrize("garbage", ["", "nan", "1.5", "-0.1", "much"])
def test_garbled_settings_count_as_absent(node: Any, garbage: str) -> None:
    for name in ("iso", "opacity", "proximity", "closeUp"):
        set_attribute(node, name, garbage)
    settings = read_settings(node)
    assert [settings[name] for name in ("iso", "proximity", "close_up")] == [None, 0.0, None]
    assert read_look(node, COLOR).opacity == 1.0


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_shares_of_nothing_and_of_all_are_kept(node: Any, share: float) -> None:
    write_settings(node, replace(LIVER, iso=share, proximity=share, look=replace(LIVER.look, opacity=share)))
    settings = read_settings(node)
    assert (settings["iso"], settings["proximity"], read_look(node, COLOR).opacity) == (share, share, share)


@pytest.mark.parametrize(("text", "size"), [("-2.5", -2.5), ("3.0", 3.0), ("3.1", 0.0), ("nan", 0.0), ("larger", 0.0)])
def test_a_size_is_read_within_its_own_range(node: Any, text: str, size: float) -> None:
    assert read_settings(node)["size"] == 1.0
    set_attribute(node, "size", text)
    assert read_settings(node)["size"] == size
