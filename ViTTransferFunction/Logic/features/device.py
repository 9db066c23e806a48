"""Where to compute: the user's choice, or the fastest device that this computer has."""

from __future__ import annotations

import platform
from typing import TYPE_CHECKING

from ..core.system.errors import InputError
from ..core.system.out_of_memory import is_out_of_memory

if TYPE_CHECKING:
    import torch

DEVICE_NAMES = ("auto", "cpu", "cuda", "mps")


def choose_device(name: str) -> torch.device:
    """The PyTorch device called `name`; "auto" takes CUDA, else Apple's MPS, else the CPU.

    Programs for Intel's processors are not given MPS unless they ask: there it computes wrong numbers, or ends the process.

    Raises:
        InputError: unknown name, this computer or this build of PyTorch has no such device, or PyTorch is missing or damaged.
        OSError: memory was not enough to load PyTorch (`is_out_of_memory`).
    """
    check_device_name(name)
    try:
        import torch
    except (ImportError, OSError) as error:
        # Where one of its libraries is missing, or one that it needs of the system, PyTorch hands on what the system says.
        if is_out_of_memory(error):
            raise
        raise InputError(
            f"PyTorch, which computes the features, cannot be loaded ({error}). Install it; where it is there already, "
            "install it anew, in Slicer with the module PyTorch Utils after a restart. Then try again."
        ) from error

    available = {"cuda": torch.cuda.is_available(), "mps": torch.backends.mps.is_available(), "cpu": True}
    if name == "auto":
        # Such a program is all that Rosetta lets run on Apple's processors; it is told that it runs on Intel's.
        sound = available | {"mps": available["mps"] and platform.machine() == "arm64"}
        return torch.device(next(device for device, there in sound.items() if there))
    if not available[name]:
        raise InputError(
            f"PyTorch cannot compute on {name} on this computer; choose another device: auto, or cpu (the processor)."
        )
    return torch.device(name)


def check_device_name(name: str) -> None:
    """Raise InputError unless a device may be called so; whether this computer has it is not looked at."""
    if name not in DEVICE_NAMES:
        raise InputError(f"Unknown device '{name}'; expected one of {', '.join(DEVICE_NAMES)}.")
