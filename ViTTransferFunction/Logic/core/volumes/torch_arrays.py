"""NumPy arrays as PyTorch tensors and back, in the same memory, also where PyTorch was built for another NumPy.

PyTorch 2.2 is the last for Macs with Intel's processors, and Slicer's packages for Macs are for these up to 5.10; on Apple's
processors, Rosetta translates them. It was built for NumPy 1: beside NumPy 2, which those packages have, `torch.from_numpy` and
`Tensor.numpy` only say "Numpy is not available". What arrays and tensors tell of their memory is enough to do without them.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import torch
    from torch import Tensor


_WIDER = {"uint16": np.int32, "uint32": np.int64, "uint64": np.float64}
"""What holds the numbers of types that PyTorch has from 2.3 on."""


def tensor_of(array: np.ndarray) -> Tensor:
    """The array as a tensor that shares its memory, or a copy of it.

    Numbers of a type that PyTorch lacks are copied and, where PyTorch was built for another NumPy, what may not be written. A
    PyTorch that was built for this one shares that as well, and warns.

    Raises:
        TypeError, ValueError: PyTorch has no numbers of this type or a wider one, or no strides below 0.
    """
    import torch

    if not hasattr(torch, array.dtype.name):
        array = array.astype(_WIDER.get(array.dtype.name, array.dtype))
    if pytorch_knows_numpy():
        return torch.from_numpy(array)
    if any(stride < 0 for stride in array.strides):
        # PyTorch ends the process where it is handed such memory.
        raise ValueError(f"A tensor has no strides below 0, and the array's are {array.strides}.")
    return torch.from_dlpack(array if array.flags.writeable else array.copy())


def array_of(tensor: Tensor) -> np.ndarray:
    """A tensor on the processor as an array that shares its memory.

    Raises:
        TypeError: NumPy has no numbers of this type.
    """
    if pytorch_knows_numpy():
        array: np.ndarray = tensor.numpy()
        return array
    if not tensor.numel():
        return np.empty(tuple(tensor.shape), dtype_of(tensor.dtype))
    # NumPy does not ask what has no dimensions.
    in_row: np.ndarray = np.asarray(_Memory(tensor[None]))
    return in_row[0, ...]


def dtype_of(dtype: torch.dtype) -> np.dtype:
    """NumPy's name for the tensors' type of numbers. Raises TypeError where it has none."""
    return np.dtype(str(dtype).removeprefix("torch."))


@functools.cache
def pytorch_knows_numpy() -> bool:
    """Whether PyTorch was built for a NumPy as it is here."""
    import torch

    try:
        torch.from_numpy(np.empty(0))
    except RuntimeError:
        return False
    return True


class _Memory:
    """A tensor's memory, as NumPy asks for it; held for as long as an array lies in it."""

    def __init__(self, tensor: Tensor) -> None:
        dtype = dtype_of(tensor.dtype)
        self._tensor = tensor
        self.__array_interface__: dict[str, Any] = {
            "version": 3,
            "typestr": dtype.str,
            "shape": tuple(tensor.shape),
            "strides": tuple(stride * dtype.itemsize for stride in tensor.stride()),
            "data": (tensor.data_ptr(), False),
        }
