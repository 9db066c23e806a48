"""Reading safetensors files, without the package of this name, which users need not have.

The format (https://github.com/huggingface/safetensors): the length of the header, eight bytes, little-endian; the header, JSON
with type, shape and place of every tensor; the tensors' bytes. It cannot hold code.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from torch import Tensor

_LENGTH_BYTES = 8
_DTYPES = {"F32": "float32", "F16": "float16", "BF16": "bfloat16"}


def is_safetensors(path: Path) -> bool:
    """Whether a file begins as safetensors files do, whatever its name. Raises OSError where it cannot be read."""
    with path.open("rb") as stream:
        return stream.read(_LENGTH_BYTES + 1)[_LENGTH_BYTES:] == b"{"


def read_safetensors(path: Path) -> dict[str, Tensor]:
    """The tensors of a safetensors file, by name.

    Raises:
        ValueError, LookupError, TypeError, AttributeError, RuntimeError: it is damaged, or holds other tensors than of floating
            point numbers of 16 or 32 bits.
        OSError: it cannot be read.
    """
    content = bytearray(path.read_bytes())
    begin = _LENGTH_BYTES + int.from_bytes(content[:_LENGTH_BYTES], "little")
    header = json.loads(content[_LENGTH_BYTES:begin])
    header.pop("__metadata__", None)
    return {name: _tensor(content, begin, name, **entry) for name, entry in header.items()}


def _tensor(
    content: bytearray, begin: int, name: str, *, dtype: str, shape: list[int], data_offsets: list[int], **_: Any
) -> Tensor:
    """A tensor whose bytes are those from the first to before the second offset, counted from `begin`."""
    import torch

    if dtype not in _DTYPES:
        raise ValueError(f"{name} is of type {dtype}, expected one of {', '.join(_DTYPES)}")
    torch_dtype: torch.dtype = getattr(torch, _DTYPES[dtype])
    count, (first, end) = math.prod(shape), data_offsets
    if count <= 0 or first < 0 or end - first != count * torch_dtype.itemsize or begin + end > len(content):
        raise ValueError(f"{name} does not lie where the header says")
    return torch.frombuffer(content, dtype=torch_dtype, count=count, offset=begin + first).reshape(shape)
