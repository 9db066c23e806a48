"""Self-attention of one slice, softmax(Q Kᵀ / √d + bias) V, in the way that is fastest on the processor.

PyTorch has one kernel for all of it. In bfloat16, on processors that have instructions for it but no matrix units, two matrix
products and a softmax take half to three quarters of its time, and so its place. In float32 they gain nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .buffer_pool import BufferPool

if TYPE_CHECKING:
    from torch import Tensor

SCORES_AT_ONCE = 2**21
"""So many scores of queries with keys, four megabytes, stay in the processor's cache between the products."""
LEAST_QUERIES = 128
"""So many queries are taken at once however many keys there are: products of fewer are slow."""


def fused_attention(query: Tensor, key: Tensor, value: Tensor, bias: Tensor | None) -> Tensor:
    """Attention by PyTorch's own kernel.

    Args:
        query: (heads, T, d).
        key: (heads, T, d).
        value: (heads, T, d).
        bias: of the scores of each key, (1, T); None: 0.

    Returns:
        (T, heads · d).
    """
    import torch.nn.functional as F

    mask = None if bias is None else bias.expand(1, 1, query.shape[1], -1)
    of_heads = F.scaled_dot_product_attention(query[None], key[None], value[None], attn_mask=mask)
    return of_heads[0].transpose(0, 1).flatten(1)


def attention_by_products(query: Tensor, key: Tensor, value: Tensor, bias: Tensor | None, work: BufferPool) -> Tensor:
    """The same by two matrix products, some queries after the others.

    Scores are rounded to bfloat16 between them. So that little is lost, the keys' mean is subtracted first, which DINO's keys
    mostly are: it changes all scores of a query by the same, and so none of its weights.

    Args:
        query: (heads, T, d).
        key: (heads, T, d).
        value: (heads, T, d).
        bias: of the scores of each key, (1, T); None: 0.
        work: memory to reuse: in memory that is new each time, the softmax takes thrice as long.

    Returns:
        (T, heads · d).
    """
    import torch

    heads, tokens, channels = query.shape
    centred = (key - key.mean(1, keepdim=True)).transpose(1, 2)
    attended = query.new_empty(tokens, heads * channels)
    at_once = _queries_at_once(tokens, heads)
    for queries, of_queries in zip(query.split(at_once, 1), attended.split(at_once), strict=True):
        shape = heads, queries.shape[1], tokens
        scores, weights = (
            work.rows(name, shape[0] * shape[1] * shape[2], 1, query.dtype, query.device).view(shape)
            for name in ("scores", "weights")
        )
        if bias is None:
            torch.baddbmm(scores, queries, centred, beta=0.0, alpha=channels**-0.5, out=scores)
        else:
            torch.baddbmm(bias.expand(shape), queries, centred, alpha=channels**-0.5, out=scores)
        torch.softmax(scores, -1, out=weights)
        of_queries.copy_(torch.bmm(weights, value).transpose(0, 1).flatten(1))
    return attended


def products_bytes(tokens: int, heads: int, number: int) -> int:
    """Memory that `attention_by_products` reuses, for slices of T tokens and numbers of so many bytes."""
    return 2 * number * heads * _queries_at_once(tokens, heads) * tokens


def _queries_at_once(tokens: int, heads: int) -> int:
    """How many queries of a slice are multiplied with all of its keys at once."""
    return min(tokens, max(LEAST_QUERIES, SCORES_AT_ONCE // (heads * tokens)))
