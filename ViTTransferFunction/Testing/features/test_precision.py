"""The precision follows from the device, the same every time."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from ViTTransferFunction.Logic.features.precision import device_precision, precision_name
from ViTTransferFunction.Logic.features.settings import FeatureSettings

ROOT = Path(__file__).parents[3]
CPU = torch.device("cpu")


def capability(monkeypatch: pytest.MonkeyPatch, name: str, **instructions: bool | str) -> None:
    """Let the processor be one of this capability, as far as PyTorch can say."""
    monkeypatch.setattr(torch.backends.cpu, "get_cpu_capability", lambda: name)
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: instructions, raising=False)


@pytest.mark.parametrize("instruction", ["avx512_bf16", "amx_bf16"])
def test_a_processor_with_fast_bfloat16_instructions_uses_them(monkeypatch: pytest.MonkeyPatch, instruction: str) -> None:
    capability(monkeypatch, "AVX512", **{instruction: True})
    assert device_precision(CPU) == torch.bfloat16


@pytest.mark.parametrize(("name", "bf16"), [("AVX2", True), ("AVX512", False), ("DEFAULT", False)])
def test_a_processor_without_them_or_not_to_use_them_computes_in_float32(
    monkeypatch: pytest.MonkeyPatch, name: str, bf16: bool
) -> None:
    capability(monkeypatch, name, avx512_bf16=bf16)
    assert device_precision(CPU) == torch.float32


@pytest.mark.parametrize(
    ("cpu_name", "made_for_amx", "amx", "precision"),
    [
        ("Intel Xeon", True, False, torch.float32),
        ("Intel Xeon", True, True, torch.bfloat16),
        ("Intel Xeon", False, False, torch.bfloat16),
        ("AMD EPYC", True, False, torch.bfloat16),
    ],
    ids=["Xeon whose AMX is hidden", "Xeon", "older Xeon", "EPYC"],
)
def test_a_processor_whose_bfloat16_is_slow_without_amx_computes_in_float32_where_amx_is_hidden(
    monkeypatch: pytest.MonkeyPatch, cpu_name: str, made_for_amx: bool, amx: bool, precision: torch.dtype
) -> None:
    capability(monkeypatch, "AVX512", avx512_bf16=True, avx512_fp16=made_for_amx, amx_bf16=amx, cpu_name=cpu_name)
    assert device_precision(CPU) == precision


def test_an_older_pytorch_that_does_not_tell_computes_in_float32(monkeypatch: pytest.MonkeyPatch) -> None:
    capability(monkeypatch, "AVX512")
    monkeypatch.delattr(torch.cpu, "get_capabilities")
    assert device_precision(CPU) == torch.float32


def test_graphics_processors_compute_in_float16() -> None:
    assert [device_precision(torch.device(name)) for name in ("cuda", "mps")] == [torch.float16] * 2


def test_settings_name_the_precision_that_they_come_to() -> None:
    resolved = FeatureSettings().on(CPU)
    assert resolved.precision == precision_name(CPU) == str(resolved.dtype_on(CPU)).removeprefix("torch.")
    assert FeatureSettings(precision="float16").on(CPU).precision == "float16"


def test_the_users_limit_of_the_processor_is_kept_to() -> None:
    program = (
        "import torch\nfrom ViTTransferFunction.Logic.features.precision import precision_name\n"
        "print(precision_name(torch.device('cpu')))"
    )
    environment = {**os.environ, "ATEN_CPU_CAPABILITY": "avx2", "PYTHONPATH": str(ROOT)}
    finished = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, encoding="utf-8", check=True
    )
    assert finished.stdout.strip() == "float32"
