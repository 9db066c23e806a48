"""Both ways of attention give the same, and where which is taken."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from ViTTransferFunction.Logic.features import attention
from ViTTransferFunction.Logic.features.attention import attention_by_products, fused_attention
from ViTTransferFunction.Logic.features.buffer_pool import BufferPool
from ViTTransferFunction.Logic.features.precision import attends_by_products

HEADS, TOKENS, CHANNELS = 3, 70, 16
CPU = torch.device("cpu")


def inputs(key_mean: float = 0.0) -> tuple[Tensor, Tensor, Tensor]:
    """Queries, keys and values as the network has them: parts of the rows of one array."""
    generator = torch.Generator().manual_seed(0)
    rows = torch.randn(TOKENS, 3, HEADS, CHANNELS, generator=generator)
    rows[:, 1] += key_mean * torch.randn(HEADS, CHANNELS, generator=generator)
    query, key, value = rows.permute(1, 2, 0, 3)
    return query, key, value


def counts_bias() -> Tensor:
    """Of tokens that stand for one or several patches, and at the end of padding, which stands for none."""
    counts = torch.ones(TOKENS)
    counts[5:9], counts[-6:] = 16.0, 0.0
    return counts.log()[None]


def exact(query: Tensor, key: Tensor, value: Tensor, bias: Tensor | None) -> Tensor:
    """The definition, in float64."""
    scores = query.double() @ key.double().mT / math.sqrt(CHANNELS)
    weights = torch.softmax(scores if bias is None else scores + bias.double(), -1)
    return (weights @ value.double()).transpose(0, 1).flatten(1)


@pytest.mark.parametrize("biased", [False, True])
@pytest.mark.parametrize(("scores", "queries"), [(1, 1), (1, 13), (HEADS * TOKENS * 32, 1), (2**21, 128)])
def test_both_ways_are_the_definition(monkeypatch: pytest.MonkeyPatch, biased: bool, scores: int, queries: int) -> None:
    monkeypatch.setattr(attention, "SCORES_AT_ONCE", scores)
    monkeypatch.setattr(attention, "LEAST_QUERIES", queries)
    bias = counts_bias() if biased else None
    wanted, work = exact(*inputs(1.0), bias), BufferPool()
    torch.testing.assert_close(fused_attention(*inputs(1.0), bias).double(), wanted, atol=1e-5, rtol=0)
    for _ in range(2):  # Memory that was used before holds something.
        torch.testing.assert_close(attention_by_products(*inputs(1.0), bias, work).double(), wanted, atol=1e-5, rtol=0)


def test_products_lose_little_more_to_bfloat16_where_all_keys_are_much_alike() -> None:
    """As DINO's are: rounded with their mean, scores would tell tokens apart no more."""
    query, key, value = (each.bfloat16() for each in inputs(20.0))
    wanted = exact(query, key, value, None)

    def error(attended: Tensor) -> float:
        return float((attended.double() - wanted).square().mean().sqrt())

    assert error(attention_by_products(query, key, value, None, BufferPool())) < 3.0 * error(
        fused_attention(query, key, value, None)
    )


@pytest.mark.parametrize(
    ("dtype", "amx", "products"),
    [(torch.bfloat16, False, True), (torch.bfloat16, True, False), (torch.float32, False, False)],
    ids=["bfloat16", "with matrix units", "float32"],
)
def test_products_take_the_place_of_the_kernel_where_they_are_faster(
    monkeypatch: pytest.MonkeyPatch, dtype: torch.dtype, amx: bool, products: bool
) -> None:
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: {"avx512_bf16": True, "amx_bf16": amx}, raising=False)
    assert attends_by_products(CPU, dtype) is products
    assert not attends_by_products(torch.device("cuda"), dtype)
