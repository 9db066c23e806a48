"""The device that is chosen where the user leaves it open."""

from __future__ import annotations

import builtins
import errno
import platform
from typing import Any

import pytest
import torch

from ViTTransferFunction.Logic.core.system.errors import InputError
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


def pytorch_fails_with(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the import of PyTorch raise this from now on."""
    import_module = builtins.__import__

    def failing(name: str, *arguments: Any, **named: Any) -> Any:
        if name == "torch":
            raise error
        return import_module(name, *arguments, **named)

    monkeypatch.setattr(builtins, "__import__", failing)


@pytest.mark.parametrize(
    "error",
    [
        ImportError("DLL load failed while importing _C: The specified module could not be found."),
        OSError(errno.ENOENT, 'The specified module could not be found. Error loading "c10.dll" or one of its dependencies.'),
    ],
)
def test_a_pytorch_that_cannot_be_loaded_is_to_be_installed_anew(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    pytorch_fails_with(error, monkeypatch)
    with pytest.raises(InputError, match=r"cannot be loaded \(.*specified module could not be found.*install it anew"):
        choose_device("auto")


def test_that_memory_was_not_enough_to_load_pytorch_is_told_as_such(monkeypatch: pytest.MonkeyPatch) -> None:
    pytorch_fails_with(OSError(errno.ENOMEM, "Cannot allocate memory"), monkeypatch)
    with pytest.raises(OSError, match="Cannot allocate memory"):
        choose_device("auto")
