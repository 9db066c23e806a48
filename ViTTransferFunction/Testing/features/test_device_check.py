"""A device that computes something else than the processor, or fails, is found out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
import torch
from torch import Tensor

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.system.progress import Between, nothing_between
from ViTTransferFunction.Logic.features import device_check as device_check_module
from ViTTransferFunction.Logic.features import networks as networks_module
from ViTTransferFunction.Logic.features.buffer_pool import BufferPool
from ViTTransferFunction.Logic.features.device_check import UnsoundDevice, device_trouble
from ViTTransferFunction.Logic.features.networks import Networks
from ViTTransferFunction.Logic.features.packed_slices import PatchTokens
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer
from ViTTransferFunction.Logic.weights.sources import WeightsFile
from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL, random_state_dict

PROCESSOR = VisionTransformer(TINY_MODEL, random_state_dict(TINY_MODEL), "random")


class OnDevice(VisionTransformer):
    """The same network as `PROCESSOR`, on a device that does something to the keys."""

    def __init__(self, does: Callable[[Tensor], Tensor]) -> None:
        super().__init__(TINY_MODEL, random_state_dict(TINY_MODEL), "random")
        self._does = does
        self._asked = 0

    def converted(self, device: torch.device | str, dtype: torch.dtype) -> VisionTransformer:
        self._asked += 1
        return self if self._asked == 1 else PROCESSOR.converted(device, dtype)

    def keys_of_tokens(
        self, slices: Sequence[PatchTokens], buffers: BufferPool | None = None, between: Between = nothing_between
    ) -> Tensor:
        return self._does(super().keys_of_tokens(slices, buffers, between))


def unsupported(keys: Tensor) -> Tensor:
    raise NotImplementedError("The operator 'aten::gelu_' is not currently implemented for the MPS device")


@pytest.mark.parametrize(
    "does",
    [torch.zeros_like, lambda keys: keys.flip(0), lambda keys: keys * float("nan"), lambda keys: 1.2 * keys, unsupported],
    ids=["zeros", "other places", "not numbers", "other values", "unsupported"],
)
def test_what_differs_is_told(does: Callable[[Tensor], Tensor]) -> None:
    assert "cpu" in device_trouble(OnDevice(does))


@pytest.mark.parametrize(
    "does", [lambda keys: keys, lambda keys: keys.half().float(), lambda keys: keys * 1.01], ids=["same", "half", "rounded"]
)
def test_a_devices_own_rounding_is_no_trouble(does: Callable[[Tensor], Tensor]) -> None:
    assert not device_trouble(OnDevice(does))


def test_a_lack_of_memory_is_not_taken_for_an_unsound_device() -> None:
    def run_out(keys: Tensor) -> Tensor:
        raise RuntimeError("MPS backend out of memory")

    # What the processor says; of another device it is the error itself.
    with pytest.raises(InputError, match="too little memory"):
        device_trouble(OnDevice(run_out))


def test_a_graphics_card_whose_memory_others_use_is_no_unsound_one(monkeypatch: pytest.MonkeyPatch) -> None:
    def run_out(*_: object) -> None:
        raise RuntimeError("CUDA out of memory")

    monkeypatch.setattr(device_check_module, "extract_features", run_out)
    with pytest.raises(RuntimeError, match="CUDA out of memory"):
        device_trouble(PROCESSOR)


def test_a_device_is_tried_once_and_the_processor_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    weights = WeightsFile(tmp_path / "tiny.pth", "random", TINY_MODEL, "made up")
    torch.save(random_state_dict(TINY_MODEL), weights.path)
    tried: list[torch.device] = []

    def trouble(network: VisionTransformer) -> str:
        tried.append(network.device)
        return "meta computes nothing"

    monkeypatch.setattr(networks_module, "device_trouble", trouble)
    networks = Networks()
    for _ in range(2):
        with pytest.raises(UnsoundDevice, match="computes nothing"):
            networks.network(weights, torch.device("meta"))
    assert networks.network(weights, torch.device("cpu")).device.type == "cpu"
    assert tried == [torch.device("meta")]


def test_the_processor_is_used_where_it_is_chosen_after_another_device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    weights = WeightsFile(tmp_path / "tiny.pth", "random", TINY_MODEL, "made up")
    torch.save(random_state_dict(TINY_MODEL), weights.path)
    monkeypatch.setattr(networks_module, "device_trouble", lambda network: "")
    networks = Networks()
    devices = [networks.network(weights, torch.device(name)).device.type for name in ("meta", "cpu")]
    assert devices == ["meta", "cpu"]
