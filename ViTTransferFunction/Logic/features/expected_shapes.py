"""The tensors of a vision transformer's published state dict, and the check that a state dict has them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..core.system.errors import InputError
from ..weights.models import PRETRAINED_MODELS, PretrainedModel

if TYPE_CHECKING:
    from torch import Tensor


def expected_shapes(model: PretrainedModel) -> dict[str, tuple[int, ...]]:
    """Name and shape of every entry of the architecture's published state dict."""
    c, p = model.embed_dim, model.patch_size
    shapes: dict[str, tuple[int, ...]] = {
        "cls_token": (1, 1, c),
        "patch_embed.proj.weight": (c, 3, p, p),
        "patch_embed.proj.bias": (c,),
        "norm.weight": (c,),
        "norm.bias": (c,),
    }
    if model.position_grid is None:
        shapes["rope_embed.periods"] = (c // model.num_heads // 4,)
    else:
        shapes["pos_embed"] = (1, 1 + model.position_grid**2, c)
    if model.num_register_tokens:
        shapes[register_name(model)] = (1, model.num_register_tokens, c)
    for block in (f"blocks.{index}" for index in range(model.depth)):
        for layer, (rows, columns) in _linear_layers(model).items():
            shapes[f"{block}.{layer}.weight"] = (rows, columns)
            shapes[f"{block}.{layer}.bias"] = (rows,)
        for norm in ("norm1", "norm2"):
            shapes[f"{block}.{norm}.weight"] = shapes[f"{block}.{norm}.bias"] = (c,)
        if model.layer_scale:
            shapes[f"{block}.ls1.gamma"] = shapes[f"{block}.ls2.gamma"] = (c,)
        if model.rotary_positions:
            shapes[f"{block}.attn.qkv.bias_mask"] = (3 * c,)
    return shapes


def register_name(model: PretrainedModel) -> str:
    """What the model's state dict calls its register tokens."""
    return "storage_tokens" if model.rotary_positions else "register_tokens"


def check_state_dict(model: PretrainedModel, state_dict: dict[str, Tensor]) -> None:
    """Raise InputError unless the state dict has all of the model's tensors, and no others."""
    expected = expected_shapes(model)
    got = {name: tuple(tensor.shape) for name, tensor in state_dict.items()}
    differing = sorted(name for name in expected.keys() | got.keys() if expected.get(name) != got.get(name))
    if differing:
        first = differing[0]
        fitting = [f"'{other.name}'" for other in PRETRAINED_MODELS.values() if expected_shapes(other) == got]
        belongs_to = f", by its shapes {' or '.join(fitting)}" if fitting else ""
        raise InputError(
            f"The weights are not those of '{model.name}': {len(differing)} entries differ, first '{first}': expected "
            f"{expected.get(first, 'no such entry')}, got {got.get(first, 'no such entry')}. "
            f"Choose the model that the file belongs to{belongs_to} (Model under Advanced, or --model), or choose another file."
        )


def _linear_layers(model: PretrainedModel) -> dict[str, tuple[int, int]]:
    """A block's linear layers, (channels out, channels in)."""
    c = model.embed_dim
    gated = {"mlp.w1": (4 * c, c), "mlp.w2": (4 * c, c), "mlp.w3": (c, 4 * c)}
    plain = {"mlp.fc1": (4 * c, c), "mlp.fc2": (c, 4 * c)}
    return {"attn.qkv": (3 * c, c), "attn.proj": (c, c), **(gated if model.gated_mlp else plain)}
