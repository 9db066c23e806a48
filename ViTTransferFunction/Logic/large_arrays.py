"""Arrays of a volume's size, from memory that is quick to write first."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    import torch
    from torch import Tensor


def empty(shape: Sequence[int], dtype: torch.dtype, device: torch.device) -> Tensor:
    """A tensor with no values yet."""
    import torch

    if device.type != "cpu":
        return torch.empty(tuple(shape), dtype=dtype, device=device)
    # numpy asks the system for huge pages where torch does not: the first write is up to 4 times faster.
    same_dtype_in_numpy = torch.empty(0, dtype=dtype).numpy().dtype
    return torch.from_numpy(np.empty(tuple(shape), same_dtype_in_numpy))
