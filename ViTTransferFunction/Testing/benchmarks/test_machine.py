"""What is said of the machine that figures were measured on."""

from __future__ import annotations

import pytest
import torch

from Benchmarks.shared.machine import in_words, machine, processor_capability


@pytest.mark.parametrize(
    ("vectors", "bfloat16", "amx", "words"),
    [
        ("AVX512", True, False, "AVX-512 with bfloat16, no AMX"),
        ("AVX512", True, True, "AVX-512 with bfloat16, AMX"),
        ("AVX512", False, False, "AVX-512 without bfloat16, no AMX"),
        ("AVX2", False, False, "AVX2 without bfloat16, no AMX"),
        # A processor that has more, limited to less.
        ("AVX2", True, True, "AVX2 without bfloat16, no AMX"),
        ("SVE256", False, False, "SVE256"),
    ],
)
def test_a_processor_is_named_by_the_instructions_that_the_network_uses(
    vectors: str, bfloat16: bool, amx: bool, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.backends.cpu, "get_cpu_capability", lambda: vectors)
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: {"avx512_bf16": bfloat16, "amx_tile": amx})
    assert processor_capability() == words


def test_a_gpu_is_named_where_there_is_one() -> None:
    without = machine("cpu")
    assert "gpu" not in without
    assert in_words({**without, "gpu": "a fast one"}) == f"{in_words(without)}, a fast one"
    assert str(without["cores"]) in in_words(without)
