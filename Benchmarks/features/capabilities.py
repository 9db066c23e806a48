"""Classes of processors that this one can stand for, by what its libraries are allowed to use of it."""

from __future__ import annotations

from dataclasses import dataclass

import torch


@dataclass(frozen=True)
class Capability:
    """A class of processors.

    Attributes:
        name: for tables.
        key: for the summary.
        environment: variables under which PyTorch, oneDNN and MKL keep to it.
        needs: names of `torch.cpu.get_capabilities` that the processor must have.
    """

    name: str
    key: str
    environment: dict[str, str]
    needs: tuple[str, ...]


CAPABILITIES = (
    Capability(
        "AVX2",
        "avx2",
        {"ATEN_CPU_CAPABILITY": "avx2", "ONEDNN_MAX_CPU_ISA": "AVX2", "MKL_ENABLE_INSTRUCTIONS": "AVX2"},
        ("avx2",),
    ),
    Capability("AVX-512 with bfloat16, no AMX", "no_amx", {"ONEDNN_MAX_CPU_ISA": "AVX512_CORE_BF16"}, ("avx512_bf16",)),
    Capability("AVX-512 with bfloat16, AMX", "amx", {}, ("avx512_bf16", "amx_tile")),
)
"""From the laptop to the server."""


def capabilities_here() -> list[Capability]:
    """Those that this processor has."""
    has = torch.cpu.get_capabilities()
    return [capability for capability in CAPABILITIES if all(has.get(name, False) for name in capability.needs)]
