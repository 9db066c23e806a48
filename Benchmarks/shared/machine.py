"""The machine that figures were measured on."""

from __future__ import annotations

import os
import platform
from typing import Any

import torch

from ViTTransferFunction.Logic.features.device import choose_device

_VECTORS = {"AVX512": "AVX-512", "DEFAULT": "no vector instructions that PyTorch uses"}
"""PyTorch's names for what a processor is capable of, where they are not what people say."""


def machine(device: str = "auto") -> dict[str, Any]:
    """What figures depend on beside the code: processor, its capability and cores, PyTorch, its threads, and the GPU if any.

    Args:
        device: what was computed on, as for `choose_device`.
    """
    parts = {
        "processor": platform.processor() or platform.machine(),
        "capability": processor_capability(),
        "cores": os.cpu_count(),
        "torch": torch.__version__,
        "threads": torch.get_num_threads(),
    }
    return {**parts, "gpu": torch.cuda.get_device_name()} if choose_device(device).type == "cuda" else parts


def processor_capability() -> str:
    """What decides how fast the network runs, in words: "AVX-512 with bfloat16, no AMX"."""
    vectors = torch.backends.cpu.get_cpu_capability()
    if not vectors.startswith("AVX"):
        return _VECTORS.get(vectors, vectors)
    has = torch.cpu.get_capabilities()
    # What the processor has, PyTorch may be limited not to use.
    used = vectors == "AVX512"
    short_floats = "with bfloat16" if used and has["avx512_bf16"] else "without bfloat16"
    matrices = "AMX" if used and has["amx_tile"] else "no AMX"
    return f"{_VECTORS.get(vectors, vectors)} {short_floats}, {matrices}"


def in_words(described: dict[str, Any]) -> str:
    """A description from `machine`, for people."""
    words = (
        f"{described['processor']} ({described['capability']}), {described['cores']} cores, "
        f"{described['threads']} in use, PyTorch {described['torch']}"
    )
    return f"{words}, {described['gpu']}" if "gpu" in described else words
