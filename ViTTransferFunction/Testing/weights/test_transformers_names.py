"""DINOv3's tensors under the names that the package transformers gives them.

Names and shapes are those of the files on Hugging Face's site, written out here.
"""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.features.expected_shapes import check_state_dict
from ViTTransferFunction.Logic.weights.models import PretrainedModel, pretrained_model
from ViTTransferFunction.Logic.weights.state_dict import load_state_dict
from ViTTransferFunction.Testing.support.tiny_model import random_state_dict


def as_in_transformers(model: PretrainedModel, state: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """A model's published tensors as transformers has them."""
    tensors = {
        "embeddings.cls_token": state["cls_token"],
        "embeddings.mask_token": torch.zeros(1, 1, model.embed_dim),
        "embeddings.register_tokens": state["storage_tokens"],
        "embeddings.patch_embeddings.weight": state["patch_embed.proj.weight"],
        "embeddings.patch_embeddings.bias": state["patch_embed.proj.bias"],
        "norm.weight": state["norm.weight"],
        "norm.bias": state["norm.bias"],
    }
    mlp = {"mlp.up_proj": "mlp.fc1", "mlp.down_proj": "mlp.fc2"}
    if model.gated_mlp:
        mlp = {"mlp.gate_proj": "mlp.w1", "mlp.up_proj": "mlp.w2", "mlp.down_proj": "mlp.w3"}
    for block in range(model.depth):
        theirs, ours = f"layer.{block}", f"blocks.{block}"
        for kind in ("weight", "bias"):
            for their_part, part in {"attention.o_proj": "attn.proj", "norm1": "norm1", "norm2": "norm2", **mlp}.items():
                tensors[f"{theirs}.{their_part}.{kind}"] = state[f"{ours}.{part}.{kind}"]
            query, key, value = state[f"{ours}.attn.qkv.{kind}"].chunk(3)
            tensors[f"{theirs}.attention.q_proj.{kind}"] = query
            tensors[f"{theirs}.attention.v_proj.{kind}"] = value
            if kind == "weight":
                tensors[f"{theirs}.attention.k_proj.{kind}"] = key
        for branch in (1, 2):
            tensors[f"{theirs}.layer_scale{branch}.lambda1"] = state[f"{ours}.ls{branch}.gamma"]
    return tensors


@pytest.mark.parametrize("name", ["dinov3_vits16", "dinov3_vits16plus"])
def test_a_file_from_hugging_face_holds_what_metas_does(name: str, tmp_path: Path) -> None:
    model = pretrained_model(name)
    state = random_state_dict(model)
    for block in range(model.depth):
        state[f"blocks.{block}.attn.qkv.bias"] *= state[f"blocks.{block}.attn.qkv.bias_mask"]
    torch.save(as_in_transformers(model, state), tmp_path / "model.pt")

    loaded = load_state_dict(tmp_path / "model.pt")

    assert loaded.keys() == state.keys()
    for entry, tensor in state.items():
        torch.testing.assert_close(loaded[entry], tensor, atol=0, rtol=0)


@pytest.mark.parametrize("damage", ["missing", "shape"])
def test_what_is_wrong_with_one_is_told(damage: str, tmp_path: Path) -> None:
    model = pretrained_model("dinov3_vits16")
    tensors = as_in_transformers(model, random_state_dict(model))
    if damage == "missing":
        del tensors["layer.3.attention.k_proj.weight"]
    else:
        tensors["layer.3.attention.k_proj.weight"] = torch.zeros(384, 385)
    torch.save(tensors, tmp_path / "model.pt")

    with pytest.raises(InputError, match=r"not those of 'dinov3_vits16'.*first 'blocks\.3\.att"):
        check_state_dict(model, load_state_dict(tmp_path / "model.pt"))
