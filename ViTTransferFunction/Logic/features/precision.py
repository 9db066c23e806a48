"""In what precision a device computes.

It follows from what the device is, and not from a race on it, so that the same command gives the same bits.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import torch

Precision = Literal["float16", "bfloat16", "float32"]


def device_precision(device: torch.device) -> torch.dtype:
    """The precision to run a network in on `device`.

    float16 on graphics processors; on others bfloat16 where there are instructions for it (AVX-512 BF16, AMX), else float32,
    since processors without them emulate it. The features' cosine error is below 1e-3 after whitening, a hundredth of what
    one layer of distance changes.
    """
    import torch

    if device.type != "cpu":
        return torch.float16
    return torch.bfloat16 if _has_bfloat16_instructions() else torch.float32


def precision_name(device: torch.device) -> Precision:
    """`device_precision`, by its name."""
    name: Precision = str(device_precision(device)).removeprefix("torch.")  # type: ignore[assignment]
    return name


def _has_bfloat16_instructions() -> bool:
    import torch

    # Says what PyTorch uses, which the user may have limited to less than the processor has.
    if torch.backends.cpu.get_cpu_capability() != "AVX512":
        return False
    capabilities: dict[str, bool] = getattr(torch.cpu, "get_capabilities", dict)()
    return bool(capabilities.get("avx512_bf16") or capabilities.get("amx_bf16"))
