"""Rotary positions against known angles, and what they are for."""

from __future__ import annotations

import math
from typing import Any

import pytest
import torch

from ViTTransferFunction.Logic.features.buffer_pool import BufferPool
from ViTTransferFunction.Logic.features.packed_slices import PackedSlices, PatchTokens
from ViTTransferFunction.Logic.features.rotary_positions import RotaryPositions, rotate
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer
from ViTTransferFunction.Testing.support.tiny_model import TINY_ROTARY_MODEL, random_state_dict

PREFIX = 3
PERIODS = 100.0 ** (torch.arange(4) / 4)


def slice_of(rows: int, columns: int, places: list[int] | None = None) -> PatchTokens:
    """A slice of which all patches are there, or those at `places`."""
    if places is None:
        return PatchTokens(torch.zeros(rows * columns, 1), rows, columns)
    return PatchTokens(torch.zeros(len(places), 1), rows, columns, torch.tensor(places), torch.ones(len(places)))


def rotations(
    slices: list[PatchTokens], periods: torch.Tensor = PERIODS, work: BufferPool | None = None
) -> tuple[torch.Tensor, torch.Tensor]:
    """Cosines and sines of the rows of slices with three prefix tokens."""
    return RotaryPositions(periods).rotations(slices, PackedSlices(slices, PREFIX), work or BufferPool())


def test_a_patchs_centre_counts_from_minus_one_to_one_along_rows_and_columns() -> None:
    # At y = ½ and x = −¾: half a turn for the rows' pair of channels, three quarters backwards for the columns'.
    cosines, sines = rotations([slice_of(2, 4, [4])], periods=torch.ones(1))
    torch.testing.assert_close(cosines[PREFIX], torch.tensor([-1.0, 0.0]), atol=1e-6, rtol=0)
    torch.testing.assert_close(sines[PREFIX], torch.tensor([0.0, 1.0]), atol=1e-6, rtol=0)


def test_a_longer_period_turns_less() -> None:
    cosines, sines = rotations([slice_of(1, 4, [2])])
    torch.testing.assert_close(torch.atan2(sines, cosines)[PREFIX, 4:], math.pi / 2 / PERIODS, atol=1e-6, rtol=0)


def test_pairs_of_channels_half_a_head_apart_are_turned_in_every_head() -> None:
    vectors = torch.tensor([[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0]])
    rotate(vectors, torch.tensor([[-1.0, 0.0]]), torch.tensor([[0.0, 1.0]]))
    torch.testing.assert_close(vectors, torch.tensor([[-1.0, 0.0, 0.0, 0.0, 0.0, -3.0, -2.0, 1.0]]))


def test_vectors_of_reduced_precision_are_rounded_only_once() -> None:
    vectors = torch.randn(20, 32, generator=torch.Generator().manual_seed(1)).bfloat16()
    exact = vectors.float()
    rows = slice(PREFIX, PREFIX + 20)
    cosines, sines = (of_all[rows] for of_all in rotations([slice_of(4, 5)]))
    rotate(vectors, cosines, sines)
    rotate(exact, cosines, sines)
    assert torch.equal(vectors, exact.bfloat16())


def test_attention_sees_how_far_patches_are_apart_and_not_where_they_are() -> None:
    query, key = torch.randn(2, 16, generator=torch.Generator().manual_seed(2))
    pairs = [(0, 9), (1, 10), (7, 16), (0, 10)]  # in a grid of 4 × 7, the first three by one row and two columns
    products = []
    for pair in pairs:
        vectors = torch.stack([query, key])
        rotate(vectors, *(of_all[PREFIX : PREFIX + 2] for of_all in rotations([slice_of(4, 7, list(pair))])))
        products.append(vectors[0] @ vectors[1])
    torch.testing.assert_close(torch.stack(products[1:3]), products[0].expand(2), atol=1e-5, rtol=0)
    assert abs(products[3] - products[0]) > 0.01


def test_each_patch_of_several_slices_is_turned_by_its_own_place() -> None:
    slices = [slice_of(4, 7, [3, 27, 11]), slice_of(4, 7), slice_of(2, 5, [9])]
    packed = PackedSlices(slices, PREFIX)
    turned = rotations(slices)
    for n, (group, places) in enumerate(zip(slices, ([3, 27, 11], range(28), [9]), strict=True)):
        alone = rotations([slice_of(group.rows, group.columns)])
        for of_all, expected in zip(turned, alone, strict=True):
            assert torch.equal(of_all[packed.patches[n]], expected[[PREFIX + place for place in places]])


def test_prefix_tokens_and_padding_are_not_turned() -> None:
    slices, work = [slice_of(4, 7, [3, 27]), slice_of(2, 5)], BufferPool()
    # What another batch leaves behind would be in the way.
    rotations([slice_of(20, 20)], work=work)
    cosines, sines = rotations(slices, work=work)
    turned = torch.zeros(len(cosines), dtype=torch.bool)
    for patches in PackedSlices(slices, PREFIX).patches:
        turned[patches] = True
    assert (cosines[~turned] == 1.0).all()
    assert (sines[~turned] == 0.0).all()
    assert (sines[turned].abs().sum(dim=1) > 0.0).all()


def test_periods_go_to_a_device_as_float32_since_some_have_no_bfloat16(monkeypatch: pytest.MonkeyPatch) -> None:
    state, to = random_state_dict(TINY_ROTARY_MODEL), torch.Tensor.to
    state["rope_embed.periods"] = state["rope_embed.periods"].bfloat16()

    def refused(tensor: torch.Tensor, *wanted: Any) -> torch.Tensor:
        if tensor.dtype == torch.bfloat16 and not any(isinstance(one, torch.dtype) for one in wanted):
            raise TypeError("BFloat16 is not supported on MPS")
        return to(tensor, *wanted)

    monkeypatch.setattr(torch.Tensor, "to", refused)
    VisionTransformer(TINY_ROTARY_MODEL, state, "random")
