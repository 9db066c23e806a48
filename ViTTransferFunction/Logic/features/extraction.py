"""From a volume to its feature volume F: slices along three axes through the ViT, pooled and merged (paper §III-A).

    F = ⅓ (pool_K keys(slices along K) + pool_J keys(slices along J) + pool_I keys(slices along I))

The keys of each slice are added to the layers of F that they belong to as soon as they are computed, so that memory is
the sums, the result and a batch of slices for each thread. Three things keep the cost at what the scene needs: slices of fewer
patches than F has cells along an edge, background that a few patches represent (`background_tokens`), and the precision that
suits the device.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ..core.system.errors import Cancelled
from ..core.system.freed_memory import give_back_freed_memory
from ..core.system.progress import Between, Progress, no_progress, one_at_a_time
from ..core.system.undivided_threads import UndividedThreads
from ..core.volumes.geometry import Geometry
from ..core.volumes.torch_arrays import array_of
from ..core.volumes.volume import Volume
from ..weights.models import PretrainedModel
from .accumulation import FeatureSums
from .bounded_memory import BoundedMemory
from .extraction_plan import ExtractionPlan, PlannedSlice
from .feature_volume import FeatureVolume
from .settings import FeatureSettings, feature_key, grid_shape
from .slice_batches import in_batches, tokens_at_once

if TYPE_CHECKING:
    from torch import Tensor

    from .vision_transformer import VisionTransformer


def extract_features(
    volume: Volume, network: VisionTransformer, settings: FeatureSettings, progress: Progress = no_progress
) -> FeatureVolume:
    """Compute the feature volume.

    Args:
        volume: intensities and geometry.
        network: loaded weights on the device to compute on.
        settings: grid and sampling.
        progress: called with slices done, and where memory was too small, by one thread or another; may raise `Cancelled`.

    Returns:
        Features in float16, whose rounding (2⁻¹¹ relative) is far below the differences between neighbouring cells.

    Raises:
        InputError: not even one slice fits into the processor's memory.
        RuntimeError, MemoryError: nor into another device's (`BoundedMemory`).
    """
    run = FeatureRun(volume, network, settings)
    run.run(run.plan.slices, progress)
    return run.features()


def features_size_bytes(geometry: Geometry, settings: FeatureSettings, model: PretrainedModel) -> int:
    """Size of the feature volume that `extract_features` returns, at most: where every cell has a patch."""
    return math.prod(grid_shape(geometry, settings)) * model.embed_dim * np.dtype(np.float16).itemsize


class FeatureRun:
    """An extraction that is planned: slices are run, then there are features.

    Args:
        volume: intensities and geometry.
        network: loaded weights on the device to compute on.
        settings: grid and sampling.

    Attributes:
        plan: what is to be run.
    """

    def __init__(self, volume: Volume, network: VisionTransformer, settings: FeatureSettings) -> None:
        self.plan = ExtractionPlan(volume, settings)
        self._key = feature_key(volume, network.model.name, network.weights_digest, settings, network.device)
        self._cells = volume.geometry.resized(grid_shape(volume.geometry, settings))
        self._patches = self.plan.patches(network.model.patch_size, network.device)
        self._network, self._precision = network, settings.dtype_on(network.device)
        self._device, self._channels = network.device, network.model.embed_dim
        self._sums = FeatureSums(self.plan.shape, self._channels, network.device)

    def run(self, slices: Sequence[PlannedSlice], progress: Progress = no_progress) -> None:
        """Run slices of the plan, each once: on a CPU several batches at once, whose keys are added up in the slices' order.

        For arguments and errors, see `extract_features`.
        """
        self._run(slices, progress)
        # What it needed is free again, and next it is something else that needs memory.
        give_back_freed_memory()

    def _run(self, slices: Sequence[PlannedSlice], progress: Progress) -> None:
        done, stopped = 0, threading.Event()
        # Weights in this precision are in memory only while slices are run, and not once for every run that is planned.
        memory = BoundedMemory(self._network.converted(self._device, self._precision))

        def tell() -> None:
            if stopped.is_set():
                raise Cancelled
            progress(done, len(slices), f"Computing features{memory.trouble}")

        # Also while slices are run: large ones take a thread many seconds, in which somebody may cancel.
        tell_in_turn = one_at_a_time(tell)
        with UndividedThreads(self._device) as threads:
            tokens = [len(of_slice.chosen.places) for of_slice in slices]
            batches = list(in_batches(slices, tokens_at_once(tokens, self._device, threads.count)))
            try:
                tell_in_turn()
                results = threads.results(batches, partial(self._keys, memory, between=tell_in_turn))
                for batch, keys in zip(batches, results, strict=True):
                    self._add(batch, keys)
                    done += len(batch)
                    tell_in_turn()
            except BaseException:
                # What other threads have begun is of no use any more, be it an error of one of them or Ctrl-C here.
                stopped.set()
                raise

    def _keys(self, memory: BoundedMemory, batch: Sequence[PlannedSlice], between: Between) -> Tensor:
        """The keys of a batch's chosen patches, slice by slice, (T, C)."""
        tokens = [self._patches[of_slice.axis].tokens(of_slice.sample.position, of_slice.chosen) for of_slice in batch]
        return memory.keys_of_tokens(tokens, between)

    def _add(self, batch: Sequence[PlannedSlice], keys: Tensor) -> None:
        of_slices = keys.split([len(of_slice.chosen.places) for of_slice in batch])
        for of_slice, of_chosen in zip(batch, of_slices, strict=True):
            spread = self._patches[of_slice.axis].spread(of_chosen, of_slice.chosen)
            self._sums.add(of_slice.axis, of_slice.sample, spread)

    def features(self) -> FeatureVolume:
        """The features of the slices that were run."""
        # Each layer is written where it belongs: beside the sums, there is never a second volume of features.
        array = np.empty((*self.plan.patches_geometry.shape, self._channels), dtype=np.float16)
        for place, layer in zip(self.plan.orientation.to_canonical(array), self._sums.means(), strict=True):
            place[...] = array_of(layer)
        return FeatureVolume(array, self.plan.patches_geometry, self._key, self._cells)
