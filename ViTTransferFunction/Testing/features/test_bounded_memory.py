"""Making do with the memory there is."""

from __future__ import annotations

import threading
from collections.abc import Sequence

import numpy as np
import pytest
import torch

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.system.progress import Between, nothing_between
from ViTTransferFunction.Logic.core.system.undivided_threads import UndividedThreads
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.bounded_memory import BoundedMemory
from ViTTransferFunction.Logic.features.buffer_pool import BufferPool
from ViTTransferFunction.Logic.features.extraction import extract_features
from ViTTransferFunction.Logic.features.packed_slices import PatchTokens
from ViTTransferFunction.Logic.features.settings import FeatureSettings
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S
from ViTTransferFunction.Testing.support.tiny_model import TINY_MODEL, random_state_dict
from ViTTransferFunction.Testing.support.torch_threads import torch_threads


class SmallNetwork(VisionTransformer):
    """A network on a device that holds so many slices at once, or none."""

    def __init__(self, at_once: int, error: Exception, claimed_device: str = "cpu") -> None:
        super().__init__(TINY_MODEL, random_state_dict(TINY_MODEL), "tiny")
        self.at_once, self.error, self.device = at_once, error, torch.device(claimed_device)

    def keys_of_tokens(
        self, slices: Sequence[PatchTokens], workspace: BufferPool | None = None, between: Between = nothing_between
    ) -> torch.Tensor:
        if len(slices) > self.at_once:
            raise self.error
        self.device = torch.device("cpu")
        return super().keys_of_tokens(slices, workspace, between)


class CrowdedNetwork(VisionTransformer):
    """A network for which there is memory in one thread at a time. The first call takes until there is a second."""

    def __init__(self) -> None:
        super().__init__(TINY_MODEL, random_state_dict(TINY_MODEL), "tiny")
        self.running, self.counting = 0, threading.Lock()
        self.second_came = threading.Event()

    def keys_of_tokens(
        self, slices: Sequence[PatchTokens], workspace: BufferPool | None = None, between: Between = nothing_between
    ) -> torch.Tensor:
        with self.counting:
            self.running += 1
            crowded = self.running > 1
        try:
            if crowded:
                self.second_came.set()
                raise MemoryError
            assert self.second_came.wait(LONGEST_WAIT_S)
            return super().keys_of_tokens(slices, workspace, between)
        finally:
            with self.counting:
                self.running -= 1


def slices(count: int) -> list[PatchTokens]:
    generator = torch.Generator().manual_seed(0)
    return [PatchTokens(torch.randn(12, 48, generator=generator), 3, 4) for _ in range(count)]


@pytest.mark.parametrize(
    "error",
    [
        torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2 GiB"),
        RuntimeError("MPS backend out of memory"),
        RuntimeError("[enforce fail] DefaultCPUAllocator: can't allocate memory: you tried to allocate 9 bytes"),
        MemoryError(),
    ],
    ids=["cuda", "mps", "cpu", "python"],
)
def test_fewer_slices_at_once_give_the_same_keys_and_are_reported(error: Exception, tiny_network: VisionTransformer) -> None:
    memory = BoundedMemory(SmallNetwork(2, error))
    keys = memory.keys_of_tokens(slices(7))
    torch.testing.assert_close(keys, tiny_network.keys_of_tokens(slices(7)), atol=1e-5, rtol=0)
    assert "slices at once" in memory.trouble


def test_threads_do_not_overwrite_each_others_work(tiny_network: VisionTransformer) -> None:
    memory = BoundedMemory(tiny_network)
    expected = tiny_network.keys_of_tokens(slices(7))
    with torch_threads(3), UndividedThreads(torch.device("cpu")) as threads:
        found = list(threads.results([slices(7)] * 60, memory.keys_of_tokens))
    assert all(torch.equal(keys, expected) for keys in found)


def test_where_there_is_memory_for_one_slice_but_not_for_one_in_every_thread_they_take_turns(
    tiny_network: VisionTransformer,
) -> None:
    memory = BoundedMemory(CrowdedNetwork())
    with torch_threads(2), UndividedThreads(torch.device("cpu")) as threads:
        found = list(threads.results([slices(1)] * 12, memory.keys_of_tokens))
    assert all(torch.equal(keys, tiny_network.keys_of_tokens(slices(1))) for keys in found)
    assert "slices at once" in memory.trouble


def test_another_device_without_memory_for_one_slice_is_left_to_whoever_chose_it() -> None:
    memory = BoundedMemory(SmallNetwork(0, torch.OutOfMemoryError("CUDA out of memory"), "cuda"))
    with pytest.raises(torch.OutOfMemoryError):
        memory.keys_of_tokens(slices(3))


def test_too_little_for_one_slice_on_the_processor_is_an_error_that_says_what_to_do() -> None:
    with pytest.raises(InputError, match="faster preset"):
        BoundedMemory(SmallNetwork(0, MemoryError())).keys_of_tokens(slices(3))


def test_other_errors_are_not_taken_for_it() -> None:
    with pytest.raises(RuntimeError, match="shapes"):
        BoundedMemory(SmallNetwork(0, RuntimeError("shapes cannot be multiplied"))).keys_of_tokens(slices(3))


def test_an_extraction_reports_fewer_slices_in_its_progress(spheres: tuple[Volume, np.ndarray]) -> None:
    reported: set[str] = set()
    network = SmallNetwork(2, MemoryError())
    extract_features(
        spheres[0], network, FeatureSettings(grid=8, precision="float32"), lambda done, total, what: reported.add(what)
    )
    assert any("slices at once" in what for what in reported)
