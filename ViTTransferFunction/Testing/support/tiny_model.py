"""A network small enough for tests that are about something else, and random weights for any network."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from ViTTransferFunction.Logic.features.expected_shapes import expected_shapes
from ViTTransferFunction.Logic.weights.models import PretrainedModel

TINY_MODEL = PretrainedModel(
    name="tiny", patch_size=4, embed_dim=24, depth=2, num_heads=2, position_grid=5, num_register_tokens=0, layer_scale=True,
    file_name="tiny.pth", url=None, sha256=None, size_mb=0, licence="none", homepage="none", citation="none",
)  # fmt: skip
TINY_ROTARY_MODEL = replace(TINY_MODEL, position_grid=None, num_register_tokens=4, gated_mlp=True, layer_norm_epsilon=1e-5)
"""As DINOv3's models are."""


def random_state_dict(model: PretrainedModel) -> dict[str, torch.Tensor]:
    """Weights of the model's shapes, of a size at which activations neither vanish nor explode.

    Periods of rotary positions, and masks of biases, are those of all published models that have them.
    """
    generator = torch.Generator().manual_seed(0)
    state = {}
    for name, shape in expected_shapes(model).items():
        values = torch.randn(shape, generator=generator)
        if name.endswith("periods"):
            state[name] = 100.0 ** (torch.arange(len(values)) / len(values))
        elif name.endswith("bias_mask"):
            state[name] = torch.tensor([1.0, 0.0, 1.0]).repeat_interleave(model.embed_dim)
        elif len(shape) > 1 and name.endswith("weight"):
            state[name] = values / np.sqrt(np.prod(shape[1:]))
        else:
            state[name] = 1.0 + 0.1 * values if "norm" in name else 0.5 * values
    return state
