"""In what precision a device is fastest: found by trying, because processors claim bfloat16 that is slower than float32."""

from __future__ import annotations

import time
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import torch

WORTHWHILE_SPEEDUP = 1.3
"""A reduced precision that gains less is not worth its error."""
TRIAL_TOKENS, TRIAL_CHANNELS, TRIAL_HEADS = 1024, 384, 6
"""About a slice through a small network."""
TRIALS = 3


@cache
def fastest_precision(device: torch.device) -> torch.dtype:
    """The precision to run a network in on `device`.

    float16 on graphics processors; on others bfloat16 where it is clearly faster (matrix units, as Intel's AMX), else
    float32. Takes some hundredths of a second, once for each device. The features' cosine error is below 1e-3 after
    whitening, a hundredth of what one layer of distance changes.
    """
    import torch

    if device.type != "cpu":
        return torch.float16
    seconds = {dtype: _seconds(dtype) for dtype in (torch.float32, torch.bfloat16)}
    faster = seconds[torch.float32] > WORTHWHILE_SPEEDUP * seconds[torch.bfloat16]
    return torch.bfloat16 if faster else torch.float32


def _seconds(dtype: torch.dtype) -> float:
    """Least seconds for one projection to a block's hidden layer and one attention."""
    import torch
    import torch.nn.functional as F

    tokens = torch.ones(TRIAL_TOKENS, TRIAL_CHANNELS, dtype=dtype)
    weight = torch.ones(4 * TRIAL_CHANNELS, TRIAL_CHANNELS, dtype=dtype)
    heads = tokens.reshape(1, TRIAL_TOKENS, TRIAL_HEADS, -1).transpose(1, 2)
    least = float("inf")
    with torch.inference_mode():
        for _ in range(TRIALS):
            start = time.perf_counter()
            F.linear(tokens, weight)
            F.scaled_dot_product_attention(heads, heads, heads)
            least = min(least, time.perf_counter() - start)
    return least
