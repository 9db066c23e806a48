"""In what precision a device computes.

It follows from what the device is, and not from a race on it, so that the same command gives the same bits.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    import torch

Precision = Literal["float16", "bfloat16", "float32"]


def device_precision(device: torch.device) -> torch.dtype:
    """The precision to run a network in on `device`.

    float16 on graphics processors; on others bfloat16 where there are fast instructions for it (AMX, mostly AVX-512 BF16),
    else float32. The features' cosine error is below 1e-3 after whitening, a hundredth of what one layer of distance changes.
    """
    import torch

    if device.type != "cpu":
        return torch.float16
    return torch.bfloat16 if _has_fast_bfloat16() else torch.float32


def precision_name(device: torch.device) -> Precision:
    """`device_precision`, by its name."""
    name: Precision = str(device_precision(device)).removeprefix("torch.")  # type: ignore[assignment]
    return name


def _has_fast_bfloat16() -> bool:
    import torch

    # Says what PyTorch uses, which the user may have limited to less than the processor has.
    if torch.backends.cpu.get_cpu_capability() != "AVX512":
        return False
    has: dict[str, Any] = getattr(torch.cpu, "get_capabilities", dict)()
    if has.get("amx_bf16"):
        return True
    # Of Intel's processors, those made for AMX (they have AVX-512 FP16, too) do half as much in bfloat16 without it as in
    # float32. Virtual machines often hide AMX.
    made_for_amx = str(has.get("cpu_name", "")).startswith("Intel") and has.get("avx512_fp16")
    return bool(has.get("avx512_bf16") and not made_for_amx)
