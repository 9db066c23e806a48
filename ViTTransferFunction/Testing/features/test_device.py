"""The device that is chosen where the user leaves it open."""

from __future__ import annotations

import platform

import pytest
import torch

from ViTTransferFunction.Logic.features.device import choose_device


@pytest.mark.parametrize(("machine", "chosen"), [("arm64", "mps"), ("x86_64", "cpu")])
def test_apples_graphics_processor_is_for_programs_of_apples_processors(
    monkeypatch: pytest.MonkeyPatch, machine: str, chosen: str
) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    monkeypatch.setattr(torch.backends.mps, "is_available", lambda: True)
    monkeypatch.setattr(platform, "machine", lambda: machine)
    assert choose_device("auto").type == chosen
    assert choose_device("mps").type == "mps"
