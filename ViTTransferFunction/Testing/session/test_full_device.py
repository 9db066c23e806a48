"""A graphics card without memory for the features, or that computes others: the processor computes them, under its own key.

PyTorch's device `meta`, which holds no values, stands in for the card.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from ViTTransferFunction.Logic.features import networks as networks_module
from ViTTransferFunction.Logic.features.precision import precision_name
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer
from ViTTransferFunction.Logic.session import feature_source
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Testing.support.spheres import Spheres

FULL = torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2.00 GiB")
CARD = torch.device("meta")


@pytest.fixture
def with_card(tiny_weights: SessionSettings, monkeypatch: pytest.MonkeyPatch) -> SessionSettings:
    """Settings that choose the card, and a tiny model."""
    monkeypatch.setattr(feature_source, "choose_device", lambda name: torch.device("cpu") if name == "cpu" else CARD)
    return replace(tiny_weights, device="cuda")


@pytest.fixture(params=["where the network is loaded", "where a slice is run", "nowhere"])
def full(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Memory of the card runs out there; or nowhere, but what it computes is wrong."""
    if request.param == "nowhere":
        monkeypatch.setattr(networks_module, "device_trouble", lambda network: f"features on {network.device} differ")
        return
    owner, name = {
        "where the network is loaded": (networks_module, "open_network"),
        "where a slice is run": (VisionTransformer, "keys_of_tokens"),
    }[request.param]
    on_processor = getattr(owner, name)

    def run_out(first: object, second: object, *others: object) -> object:
        if CARD in (second, getattr(first, "device", None)):
            raise FULL
        return on_processor(first, second, *others)

    monkeypatch.setattr(owner, name, run_out)


@pytest.mark.usefixtures("full")
def test_the_processors_own_features_are_computed_and_kept_under_its_own_key(
    spheres: Spheres, with_card: SessionSettings, request: pytest.FixtureRequest
) -> None:
    told: set[str] = set()
    session = open_session(spheres[0], with_card)
    assert session.estimate().seconds is not None
    provenance = session.load_features(lambda done, total, what: told.add(what))
    assert (provenance.device, provenance.precision) == ("cpu", precision_name(torch.device("cpu")))
    trouble = "does not compute rightly" if request.node.callspec.params["full"] == "nowhere" else "has too little memory"
    assert any(f"(the graphics card {trouble}; the processor computes)" in what for what in told)
    by_processor = open_session(spheres[0], replace(with_card, device="cpu"))
    assert by_processor.load_features().cached
    assert by_processor.features.source.key == session.features.source.key
    np.testing.assert_array_equal(by_processor.features.array, session.features.array)


@pytest.mark.usefixtures("full")
def test_what_the_processor_computed_is_found_when_the_card_is_full_again(spheres: Spheres, with_card: SessionSettings) -> None:
    first, second = (open_session(spheres[0], with_card).load_features() for _ in range(2))
    assert (first.cached, second.cached, second.device) == (False, True, "cpu")


def test_other_errors_of_a_card_are_not_taken_for_a_lack_of_memory(
    spheres: Spheres, with_card: SessionSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[int] = []

    def fail(*arguments: object) -> None:
        tried.append(1)
        raise RuntimeError("CUDA error: an illegal memory access was encountered")

    monkeypatch.setattr(networks_module, "open_network", fail)
    with pytest.raises(RuntimeError, match="illegal memory access"):
        open_session(spheres[0], with_card).load_features()
    # On the processor, it would fail as well.
    assert len(tried) == 1


def test_a_processor_without_memory_is_not_tried_twice(
    spheres: Spheres, with_card: SessionSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[int] = []

    def run_out(*arguments: object) -> None:
        tried.append(1)
        raise MemoryError

    monkeypatch.setattr(networks_module, "open_network", run_out)
    with pytest.raises(MemoryError):
        open_session(spheres[0], replace(with_card, device="cpu")).load_features()
    assert len(tried) == 1
