"""Reading a weights file: tensors by name, and nothing else, out of a file that need not be trusted."""

from __future__ import annotations

import codecs
import hashlib
import pickle
import struct
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.system.errors import InputError, shown
from ..core.system.out_of_memory import is_out_of_memory
from ..core.volumes.torch_arrays import array_of
from .safetensors_file import is_safetensors, read_safetensors
from .transformers_names import has_transformers_names, with_published_names

if TYPE_CHECKING:
    from torch import Tensor


def load_state_dict(path: Path) -> dict[str, Tensor]:
    """The tensors of a weights file under their published names, on the CPU. Code in the file is never run.

    The file is one saved by PyTorch, or a safetensors file, as Hugging Face's site has them of DINOv3.
    `mask_token`, which files of DINOv2 and DINOv3 carry for training and no forward pass uses, is left out. Nothing else is.

    Raises:
        InputError: the file cannot be read, or holds anything but a dictionary of tensors, or values that are not finite.
    """
    try:
        content = read_safetensors(path) if is_safetensors(path) else _load(path)
    except OSError as error:
        raise InputError(
            f"Cannot read the weights file {path} ({error.strerror or error}). Check its permissions, or choose another file."
        ) from error
    except _DAMAGED as error:
        if is_out_of_memory(error):
            raise
        raise InputError(
            f"{path} is not a weights file that can be loaded safely ({_reason(path, error)}). Expected tensors saved by "
            "PyTorch, or a safetensors file: the file is damaged, is something else under this name, or carries code, which "
            "was not run. Get it again."
        ) from error
    _check_is_state_dict(content, path)
    if has_transformers_names(content):
        content = with_published_names(content)
    return {name: tensor for name, tensor in content.items() if name != "mask_token"}


def tensors_sha256(state_dict: dict[str, Tensor]) -> str:
    """Hexadecimal SHA-256 of tensors' names, shapes and float32 bits, whatever file they came from.

    In order of their names, each tensor counts as the line "name [shape]" followed by its little-endian bytes.
    """
    digest = hashlib.sha256()
    for name in sorted(state_dict):
        array = array_of(state_dict[name])
        digest.update(f"{name} {list(array.shape)}\n".encode())
        digest.update(np.ascontiguousarray(array, dtype="<f4").tobytes())
    return digest.hexdigest()


_DAMAGED = (
    pickle.UnpicklingError,
    RuntimeError,
    EOFError,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    AssertionError,
    struct.error,
)
"""What `torch.load` raises on damaged files. It documents none; these were found by feeding it thousands of them. What
`read_safetensors` raises is among them."""


def _load(path: Path) -> Any:
    """A file saved by PyTorch, whatever its name: of a path, PyTorch would go by the ending."""
    import torch

    with path.open("rb") as file:
        return torch.load(file, map_location="cpu", weights_only=True)


def _check_is_state_dict(content: object, path: Path) -> None:
    import torch

    if not isinstance(content, dict) or not content:
        raise InputError(f"{path} holds a {type(content).__name__}; expected a dictionary of named tensors (a state dict).")
    others = [str(name) for name, value in content.items() if not isinstance(value, torch.Tensor) or not isinstance(name, str)]
    if others:
        raise InputError(
            f"{path} holds entries that are not named tensors ({', '.join(others[:4])}); expected the backbone's tensors only. "
            "A training checkpoint, with optimiser and heads, is another download than the backbone."
        )
    broken = next((name for name, tensor in content.items() if not _is_finite(tensor)), None)
    if broken is not None:
        raise InputError(f"{path} holds values that are not finite numbers (in '{broken}'): the file is damaged. Get it again.")


def _is_finite(tensor: Tensor) -> bool:
    """Whether a tensor is dense and holds finite numbers alone."""
    import torch

    try:
        # Strides of 0 can make a few bytes look like terabytes.
        dense = tensor.numel() <= tensor.untyped_storage().nbytes()
        return dense and bool(torch.isfinite(tensor).all())
    except RuntimeError:
        return False  # Sparse or quantised.


def _reason(path: Path, error: Exception) -> str:
    """What is wrong with a file that cannot be loaded, in a few words.

    Of text, such as the page of a login or what Git LFS leaves in the place of a file, PyTorch tells the number of a letter.
    """
    with path.open("rb") as file:
        beginning = file.read(28)  # As much as `shown` quotes.
    if not beginning:
        return "it is empty"
    try:
        # The last letter may be cut off.
        text = codecs.getincrementaldecoder("utf-8")().decode(beginning)
    except UnicodeDecodeError:
        text = ""
    if text and all(letter.isprintable() or letter.isspace() for letter in text):
        return f"it is text, and begins with {shown(text.strip())}"
    return str(error).strip().split("\n")[0].split(". ")[0] or type(error).__name__
