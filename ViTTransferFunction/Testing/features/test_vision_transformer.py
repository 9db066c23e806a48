"""Our network against independent ones with the same weights."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
import torch
import torch.nn.functional as F

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.features.buffer_pool import BufferPool
from ViTTransferFunction.Logic.features.packed_slices import PatchTokens
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer
from ViTTransferFunction.Logic.weights.models import pretrained_model
from ViTTransferFunction.Logic.weights.state_dict import load_state_dict
from ViTTransferFunction.Testing.support.images import last_block_keys
from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL, TINY_ROTARY_MODEL, random_state_dict

TIMM_NAMES = {
    "dino_vits8": "vit_small_patch8_224.dino",
    "dino_vits16": "vit_small_patch16_224.dino",
    "dino_vitb8": "vit_base_patch8_224.dino",
    "dinov2_vits14": "vit_small_patch14_dinov2.lvd142m",
    "dinov2_vits14_reg": "vit_small_patch14_reg4_dinov2.lvd142m",
    "dinov2_vitb14": "vit_base_patch14_dinov2.lvd142m",
    "dinov3_vits16": "vit_small_patch16_dinov3_qkvb.lvd1689m",
    "dinov3_vits16plus": "vit_small_plus_patch16_dinov3_qkvb.lvd1689m",
    "dinov3_vitb16": "vit_base_patch16_dinov3_qkvb.lvd1689m",
}


@pytest.fixture(params=[TINY_MODEL, TINY_ROTARY_MODEL], ids=["position table", "rotary positions"])
def tiny_network(request: pytest.FixtureRequest) -> VisionTransformer:
    """A two-block network with fixed random weights, of either kind."""
    return VisionTransformer(request.param, random_state_dict(request.param), "tiny")


@pytest.mark.slow
@pytest.mark.parametrize("name", TIMM_NAMES)
def test_keys_equal_those_of_timm_with_the_same_random_weights(name: str) -> None:
    model = pretrained_model(name)
    state = random_state_dict(model)
    # Faint tokens, which show what layer normalisation adds to the variance.
    for part in ("weight", "bias"):
        state[f"patch_embed.proj.{part}"] *= 0.01
    images = torch.randn(1, 3, 4 * model.patch_size, 6 * model.patch_size, generator=torch.Generator().manual_seed(1))

    ours = last_block_keys(VisionTransformer(model, state, "random"), images)

    assert ours.shape == (1, 4, 6, model.embed_dim)
    torch.testing.assert_close(ours, timm_keys(TIMM_NAMES[name], state, images), atol=1e-4, rtol=0)


@pytest.mark.slow
def test_some_of_a_large_grids_patches_have_the_keys_that_timm_gives_where_only_they_are_seen() -> None:
    """Of 20 × 50 patches every third, some counted several times; timm has all, and a mask on the attention to the others."""
    model = pretrained_model("dinov3_vits16plus")
    state = random_state_dict(model)
    images = torch.randn(1, 3, 20 * 16, 50 * 16, generator=torch.Generator().manual_seed(1))
    places = torch.arange(0, 1000, 3)
    multiplicity = 1.0 + torch.arange(len(places)) % 4
    counts = torch.cat([torch.ones(5), torch.zeros(1000).index_copy(0, places, multiplicity)])

    patches = F.unfold(images, 16, stride=16)[0].T[places]
    ours = VisionTransformer(model, state, "random").keys_of_tokens([PatchTokens(patches, 20, 50, places, multiplicity)])

    theirs = timm_keys(TIMM_NAMES[model.name], state, images, counts.log().expand(1, 1, 1005, 1005))
    torch.testing.assert_close(ours, theirs.flatten(0, 2)[places], atol=1e-4, rtol=0)


def test_keys_equal_those_of_timm_with_real_weights(real_weights: Path) -> None:
    model = pretrained_model("dinov2_vits14_focus")
    state = load_state_dict(real_weights)
    images = torch.randn(2, 3, 14 * 20, 14 * 30, generator=torch.Generator().manual_seed(1))

    ours = last_block_keys(VisionTransformer(model, state, "real"), images)

    torch.testing.assert_close(ours, timm_keys(TIMM_NAMES["dinov2_vits14"], state, images), atol=1e-4, rtol=0)


def timm_keys(
    name: str, state: dict[str, torch.Tensor], images: torch.Tensor, mask: torch.Tensor | None = None
) -> torch.Tensor:
    """Last-block keys (B, rows, columns, C), tapped from timm's own forward pass; `mask` is added to all blocks' logits."""
    # The class that has DINOv3's models does not know how to skip it.
    initialisation = {} if "dinov3" in name else {"weight_init": "skip"}
    network = import_timm().create_model(name, dynamic_img_size=True, num_classes=0, **initialisation).eval()
    network.load_state_dict(as_timm_names(state, network))
    tapped: list[torch.Tensor] = []
    # What comes out of here are the keys as projected, before they are turned.
    network.blocks[-1].attn.k_norm.register_forward_hook(lambda _, __, output: tapped.append(output))
    with torch.inference_mode():
        network.forward_features(images, attn_mask=mask)
    keys = tapped[0].transpose(1, 2)[:, network.num_prefix_tokens :]
    rows, columns = (size // network.patch_embed.patch_size[0] for size in images.shape[-2:])
    return keys.reshape(len(images), rows, columns, network.embed_dim)


def as_timm_names(state: dict[str, torch.Tensor], network: torch.nn.Module) -> dict[str, torch.Tensor]:
    """timm adds the class token's position to the token where there are registers, and calls those differently.

    For DINOv3 timm itself knows the names of Meta's files, and so vouches for ours.
    """
    if "storage_tokens" in state:
        converted: dict[str, torch.Tensor] = sys.modules["timm.models.eva"].checkpoint_filter_fn(state, network)
        return converted
    if "register_tokens" not in state:
        return state
    converted = {name: tensor for name, tensor in state.items() if name != "register_tokens"}
    converted["reg_token"] = state["register_tokens"]
    converted["cls_token"] = state["cls_token"] + state["pos_embed"][:, :1]
    converted["pos_embed"] = state["pos_embed"][:, 1:]
    return converted


_torchvision_operators: list[torch.library.Library] = []
"""Kept for the life of the process: an operator's definition goes when its library is collected."""


def import_timm() -> Any:
    """timm, also beside a torchvision whose compiled operators belong to another build of torch; it needs none of them."""
    try:
        import timm
    except RuntimeError as error:
        if "torchvision::nms" not in str(error):
            raise
        library = torch.library.Library("torchvision", "DEF")
        for operator in ("nms", "qnms"):
            library.define(f"{operator}(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
        _torchvision_operators.append(library)
        import timm
    return timm


def test_keys_equal_their_definition() -> None:
    """Attention written out head by head, where timm and we both use PyTorch's fused one."""
    state = random_state_dict(TINY_MODEL)
    # The first block's MLP adds nothing, so that keys are those of its attention alone.
    state["blocks.0.ls2.gamma"].zero_()
    side, size = 5, TINY_MODEL.patch_size
    images = torch.randn(2, 3, side * size, side * size, generator=torch.Generator().manual_seed(1))

    keys = last_block_keys(VisionTransformer(TINY_MODEL, state, "tiny"), images)

    patches = F.conv2d(images, state["patch_embed.proj.weight"], state["patch_embed.proj.bias"], stride=size)
    tokens = torch.cat([state["cls_token"].expand(2, -1, -1), patches.flatten(2).transpose(1, 2)], dim=1) + state["pos_embed"]
    attended = tokens + attention_by_definition(state, tokens)
    _, expected, _ = queries_keys_values(state, "blocks.1", attended).chunk(3, dim=-1)
    torch.testing.assert_close(keys.flatten(1, 2), expected[:, 1:], atol=1e-5, rtol=0)


def attention_by_definition(state: dict[str, torch.Tensor], tokens: torch.Tensor) -> torch.Tensor:
    """softmax(Q Kᵀ / √d) V of the first block, head by head, projected and scaled."""
    channels, heads = TINY_MODEL.embed_dim, TINY_MODEL.num_heads
    size = channels // heads
    qkv = queries_keys_values(state, "blocks.0", tokens)
    outputs = []
    for head in range(heads):
        query, key, value = (qkv[..., part * channels + head * size : part * channels + (head + 1) * size] for part in range(3))
        outputs.append(torch.softmax(query @ key.transpose(1, 2) / size**0.5, dim=-1) @ value)
    projected = torch.cat(outputs, dim=-1) @ state["blocks.0.attn.proj.weight"].T + state["blocks.0.attn.proj.bias"]
    return projected * state["blocks.0.ls1.gamma"]


def queries_keys_values(state: dict[str, torch.Tensor], block: str, tokens: torch.Tensor) -> torch.Tensor:
    normed = F.layer_norm(tokens, tokens.shape[-1:], state[f"{block}.norm1.weight"], state[f"{block}.norm1.bias"], 1e-6)
    return normed @ state[f"{block}.attn.qkv.weight"].T + state[f"{block}.attn.qkv.bias"]


def test_images_of_a_batch_do_not_see_each_other(tiny_network: VisionTransformer) -> None:
    images = torch.randn(3, 3, 12, 16, generator=torch.Generator().manual_seed(2))
    together = last_block_keys(tiny_network, images)
    apart = torch.cat([last_block_keys(tiny_network, image[None]) for image in images])
    torch.testing.assert_close(together, apart, atol=1e-5, rtol=0)


def test_a_patch_that_counts_twice_is_two_equal_patches(tiny_network: VisionTransformer) -> None:
    patches = torch.randn(12, 48, generator=torch.Generator().manual_seed(3))
    places, twice = torch.arange(12), torch.tensor([0, 1, 2, 3, 3, 4, 5, 6, 7, 8, 9, 10, 11])
    counts = torch.bincount(twice)
    counted = tiny_network.keys_of_tokens([PatchTokens(patches, 3, 4, places, counts)])
    doubled = tiny_network.keys_of_tokens([PatchTokens(patches[twice], 3, 4, places[twice], torch.ones(13))])
    torch.testing.assert_close(counted[twice], doubled, atol=1e-5, rtol=0)


def slices_of(*lengths: int) -> list[PatchTokens]:
    """Slices of 3 × 4 patches, with so many of them given; each counts once or twice."""
    generator = torch.Generator().manual_seed(4)
    return [
        PatchTokens(torch.randn(n, 48, generator=generator), 3, 4, torch.arange(n), 1 + torch.arange(n) % 2) for n in lengths
    ]


def test_slices_of_different_lengths_do_not_see_each_other(tiny_network: VisionTransformer) -> None:
    slices = slices_of(12, 5, 1)
    together = tiny_network.keys_of_tokens(slices)
    apart = torch.cat([tiny_network.keys_of_tokens([of_slice]) for of_slice in slices])
    torch.testing.assert_close(together, apart, atol=1e-5, rtol=0)


def test_what_earlier_batches_left_in_a_workspace_does_not_matter(tiny_network: VisionTransformer) -> None:
    fresh = tiny_network.keys_of_tokens(slices_of(5, 3))
    workspace = BufferPool()
    # Enough rows to be in the way of all of the next batch's, and values that would be noticed.
    earlier = slices_of(*[12] * 20)
    for of_slice in earlier:
        of_slice.patches.fill_(float("nan"))
    assert tiny_network.keys_of_tokens(earlier, workspace).isnan().all()
    torch.testing.assert_close(tiny_network.keys_of_tokens(slices_of(5, 3), workspace), fresh, atol=0, rtol=0)


def test_rows_are_run_in_parts_without_a_difference(tiny_network: VisionTransformer, monkeypatch: pytest.MonkeyPatch) -> None:
    slices = slices_of(12, 12, 5)
    whole = tiny_network.keys_of_tokens(slices)
    monkeypatch.setattr("ViTTransferFunction.Logic.features.vision_transformer.ROWS_AT_ONCE", 13)
    torch.testing.assert_close(tiny_network.keys_of_tokens(slices), whole, atol=1e-5, rtol=0)


def test_a_network_in_another_precision_is_close_and_the_same_one_is_itself(tiny_network: VisionTransformer) -> None:
    assert tiny_network.converted("cpu", torch.float32) is tiny_network
    images = torch.randn(1, 3, 12, 16, generator=torch.Generator().manual_seed(2))
    exact = last_block_keys(tiny_network, images)
    reduced = last_block_keys(tiny_network.converted("cpu", torch.bfloat16), images)
    assert reduced.dtype == torch.bfloat16
    torch.testing.assert_close(reduced.float(), exact, atol=0.1, rtol=0.05)


@pytest.mark.parametrize("damage", ["missing", "unexpected", "shape"])
def test_weights_of_another_architecture_are_refused_by_the_name_of_what_differs(damage: str) -> None:
    state = random_state_dict(TINY_MODEL)
    if damage == "missing":
        del state["norm.bias"]
    elif damage == "unexpected":
        state["norm.extra"] = torch.zeros(1)
    else:
        state["norm.bias"] = torch.zeros(5)
    with pytest.raises(InputError, match=r"not those of 'tiny'.*norm\."):
        VisionTransformer(TINY_MODEL, state, "tiny")
