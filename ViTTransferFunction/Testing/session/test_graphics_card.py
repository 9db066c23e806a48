"""On a computer with a graphics card: it computes what the processor does, the same every time, and its memory may run out."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace

import numpy as np
import pytest
import torch

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.bounded_memory import BoundedMemory
from ViTTransferFunction.Logic.features.device import choose_device
from ViTTransferFunction.Logic.features.device_check import device_trouble
from ViTTransferFunction.Logic.features.extraction import extract_features
from ViTTransferFunction.Logic.features.packed_slices import PatchTokens
from ViTTransferFunction.Logic.features.settings import FeatureSettings
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS
from ViTTransferFunction.Testing.support.spheres import Spheres, requests_of
from ViTTransferFunction.Testing.support.tiny_model import random_state_dict

CARD = choose_device("auto")

pytestmark = pytest.mark.skipif(CARD.type == "cpu", reason="this computer has no graphics card that PyTorch can compute on")


@contextmanager
def little_memory(spare_bytes: float) -> Iterator[None]:
    """A card that other programs leave so much of."""
    if CARD.type != "cuda":
        pytest.skip("only CUDA's memory can be limited")
    torch.cuda.empty_cache()
    limit = torch.cuda.memory_reserved(CARD) + spare_bytes
    torch.cuda.set_per_process_memory_fraction(limit / torch.cuda.get_device_properties(CARD).total_memory)
    try:
        yield
    finally:
        torch.cuda.set_per_process_memory_fraction(1.0)


@contextmanager
def no_memory() -> Iterator[None]:
    """A card without any, down to the smallest piece that PyTorch hands out."""
    held = []
    with little_memory(64e6):
        for piece in (2**21, 2**16, 2**9):
            with suppress(torch.OutOfMemoryError):
                while True:
                    held.append(torch.empty(piece, dtype=torch.uint8, device=CARD))
        yield


@pytest.mark.parametrize("model", ["dino_vits8", "dinov2_vits14_focus", "dinov3_vits16", "dinov3_vits16plus"])
def test_a_network_computes_what_it_does_on_the_processor(model: str) -> None:
    """Random weights: of each kind of positions and MLP there is one."""
    network = VisionTransformer(PRETRAINED_MODELS[model], random_state_dict(PRETRAINED_MODELS[model]), "random", CARD)
    assert not device_trouble(network)


def test_the_same_command_gives_the_same_bits() -> None:
    model = PRETRAINED_MODELS["dinov2_vits14_focus"]
    network = VisionTransformer(model, random_state_dict(model), "random", CARD)
    array = np.random.default_rng(0).random((40, 48, 56)).astype(np.float32)
    volume = Volume(array, Geometry(array.shape, np.eye(4)))
    first, second = (extract_features(volume, network, FeatureSettings(grid=32)).array for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_structures_are_those_of_the_processors_features(spheres: Spheres, tiny_weights: SessionSettings) -> None:
    labels = []
    for device in (CARD.type, "cpu"):
        session = open_session(spheres[0], replace(tiny_weights, device=device))
        assert session.load_features().device.startswith(device)
        labels.append(session.segment(requests_of(spheres)).labels)
    assert np.mean(labels[0] != labels[1]) < 0.01


def test_fewer_slices_at_once_where_the_memory_is_short() -> None:
    model = PRETRAINED_MODELS["dinov2_vits14_focus"]
    network = VisionTransformer(model, random_state_dict(model), "random").first_blocks(2).converted(CARD, torch.float16)
    side = 64
    slices = [PatchTokens(torch.rand(side**2, 3 * model.patch_size**2), side, side) for _ in range(8)]
    expected = network.keys_of_tokens(slices).float().cpu()
    bounded = BoundedMemory(network)
    with little_memory(128e6):
        keys = bounded.keys_of_tokens(slices).cpu().float()  # Not there: it has no room for them twice.
    assert "slices at once" in bounded.trouble
    assert (keys - expected).norm() < 0.01 * expected.norm()


def test_the_processor_takes_over_from_a_full_card(spheres: Spheres, tiny_weights: SessionSettings) -> None:
    told: set[str] = set()
    with no_memory():
        session = open_session(spheres[0], replace(tiny_weights, device="cuda"))
        assert session.load_features(lambda done, total, what: told.add(what)).device == "cpu"
    assert any("too little memory" in what for what in told)
