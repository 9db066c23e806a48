"""From a volume to its feature volume F: slices along three axes through the ViT, pooled and merged (paper §III-A).

    F = ⅓ (pool_K keys(slices along K) + pool_J keys(slices along J) + pool_I keys(slices along I))

The keys of each slice are added to the layers of F that they belong to as soon as they are computed, so that memory is
the sums, the result and one batch of slices. Three things keep the cost at what the scene needs: slices of fewer patches than F
has cells along an edge, background that a few patches represent (`background_tokens`), and the precision that suits the device.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..core.system.progress import Progress, no_progress
from ..core.volumes.geometry import Geometry
from ..core.volumes.torch_arrays import array_of
from ..core.volumes.volume import Volume
from ..weights.models import PretrainedModel
from .accumulation import FeatureSums
from .bounded_memory import BoundedMemory
from .extraction_plan import ExtractionPlan, SliceBatch
from .feature_volume import FeatureVolume
from .settings import FeatureSettings, feature_key, grid_shape

if TYPE_CHECKING:
    from .vision_transformer import VisionTransformer


def extract_features(
    volume: Volume, network: VisionTransformer, settings: FeatureSettings, progress: Progress = no_progress
) -> FeatureVolume:
    """Compute the feature volume.

    Args:
        volume: intensities and geometry.
        network: loaded weights on the device to compute on.
        settings: grid and sampling.
        progress: called with slices done, and where memory was too small; may raise `Cancelled`.

    Returns:
        Features in float16, whose rounding (2⁻¹¹ relative) is far below the differences between neighbouring cells.

    Raises:
        InputError: not even one slice fits into the processor's memory.
        RuntimeError, MemoryError: nor into another device's (`BoundedMemory`).
    """
    return FeatureRun(volume, network, settings).run_all(progress)


def features_size_bytes(geometry: Geometry, settings: FeatureSettings, model: PretrainedModel) -> int:
    """Size of the feature volume that `extract_features` returns, at most: where every cell has a patch."""
    return math.prod(grid_shape(geometry, settings)) * model.embed_dim * np.dtype(np.float16).itemsize


class FeatureRun:
    """An extraction that is planned: batches of slices are run in any order, then there are features.

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
        self._memory = BoundedMemory(network.converted(network.device, settings.dtype_on(network.device)))
        self._channels = network.model.embed_dim
        self._sums = FeatureSums(self.plan.shape, self._channels, network.device)

    def run_all(self, progress: Progress) -> FeatureVolume:
        """Run every batch; see `extract_features`."""
        done, total = 0, sum(len(batch.samples) for batch in self.plan.batches)
        for batch in self.plan.batches:
            progress(done, total, f"Computing features{self._memory.trouble}")
            self.run(batch)
            done += len(batch.samples)
        progress(done, total, f"Computing features{self._memory.trouble}")
        return self.features()

    def run(self, batch: SliceBatch) -> None:
        """Run a batch of the plan; each once."""
        patches = self._patches[batch.axis]
        tokens = [patches.tokens(sample.position, chosen) for sample, chosen in zip(batch.samples, batch.chosen, strict=True)]
        keys = self._memory.keys_of_tokens(tokens).split([len(of_slice.patches) for of_slice in tokens])
        for sample, chosen, of_slice in zip(batch.samples, batch.chosen, keys, strict=True):
            self._sums.add(batch.axis, sample, patches.spread(of_slice, chosen))

    def features(self) -> FeatureVolume:
        """The features of the batches that were run."""
        # Each layer is written where it belongs: beside the sums, there is never a second volume of features.
        array = np.empty((*self.plan.patches_geometry.shape, self._channels), dtype=np.float16)
        for place, layer in zip(self.plan.orientation.to_canonical(array), self._sums.means(), strict=True):
            place[...] = array_of(layer)
        return FeatureVolume(array, self.plan.patches_geometry, self._key, self._cells)
