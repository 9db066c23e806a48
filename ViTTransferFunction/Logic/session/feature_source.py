"""The features of one volume: estimates their cost, and gets them from the cache or computes them."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from ..core.system.out_of_memory import is_out_of_memory
from ..core.system.progress import Progress
from ..core.volumes.geometry import Geometry
from ..core.volumes.volume import Volume
from ..features.cache import FeatureCache
from ..features.cost import feature_cost, feature_memory_bytes
from ..features.device import choose_device
from ..features.device_check import UnsoundDevice
from ..features.extraction import extract_features, features_size_bytes
from ..features.networks import Networks
from ..features.progressive import progressive_cost, progressive_features
from ..features.settings import FeatureSettings, feature_key, grid_shape
from ..features.whitening import NormalisedFeatures, Statistics, normalised_features, normalised_size_bytes
from ..weights.sources import WeightsFile
from .feature_estimate import FeatureEstimate
from .memory_need import check_memory_for_features
from .model_weights import ModelWeights

if TYPE_CHECKING:
    import torch

CLICK_BYTES_PER_CELL = 600
"""Measured: what is prepared for clicks from the intensities (180), and from the coarse or the fine features (400)."""

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class FeatureProvenance:
    """Where features come from.

    Attributes:
        weights: the weights that they were computed with.
        device: the device that they were computed on, or would have been if they had not been cached.
        precision: the precision in which they were computed.
        cached: whether they were found in the cache.
        not_kept: why they could not be stored in the cache, as a sentence for the user; "" if they are stored.
    """

    weights: WeightsFile
    device: str
    precision: str
    cached: bool
    not_kept: str = ""


class FeatureSource:
    """Estimates and gets a volume's features; opens the network and hashes volume and weights only once for both.

    Args:
        volume: intensities and geometry.
        settings: grid and sampling.
        statistics: how the features are normalised.
        weights: those of the model to compute the features with.
        device_name: the device to compute on, one of `DEVICE_NAMES`.
        cache: keeps features between sessions.
        networks: the networks that are open already.

    Attributes:
        provenance: where the last features came from; None before there are any.
    """

    def __init__(
        self,
        volume: Volume,
        settings: FeatureSettings,
        statistics: Statistics,
        weights: ModelWeights,
        device_name: str,
        cache: FeatureCache,
        networks: Networks,
    ) -> None:
        self._volume = volume
        self._settings = settings
        self._statistics = statistics
        self._weights = weights
        self._model = weights.model
        self._device_name = device_name
        self._cache = cache
        self._networks = networks
        self._note = ""
        self.provenance: FeatureProvenance | None = None

    @property
    def cells(self) -> Geometry:
        """The grid of the features' cells."""
        return self._volume.geometry.resized(grid_shape(self._volume.geometry, self._settings))

    def estimate(self, coarse_first: bool) -> FeatureEstimate:
        """What the features will cost. Takes a second or two if they are not in the cache.

        Args:
            coarse_first: whether coarse features are wanted first, to answer clicks meanwhile.

        Raises:
            InputError: the weights are not those of the model, or this computer has no such device.
        """
        try:
            estimate = self._estimate(coarse_first)
        except (RuntimeError, MemoryError) as error:
            self._leave_device(error)
            estimate = self._estimate(coarse_first)
        self._weights.announced(estimate.download)
        return estimate

    def _estimate(self, coarse_first: bool) -> FeatureEstimate:
        weights = self._weights.known
        cached = weights is not None and self._key(weights) in self._cache
        if weights is not None and weights.path.exists() and not cached:
            network = self._networks.network(weights, self._device)
            cost_of = progressive_cost if coarse_first else feature_cost
            cost = cost_of(self._volume, self._settings, network, self._networks.speed(network, self._settings))
            memory = cost.peak_bytes + self._clicked_bytes(coarse_first)
            return FeatureEstimate(cached, cost.seconds, memory, model=self._model.name)
        if cached:
            return FeatureEstimate(cached, None, self._size_bytes, model=self._model.name)
        memory = feature_memory_bytes(self._volume, self._settings, self._model, self._device)
        memory += self._clicked_bytes(coarse_first)
        return FeatureEstimate(cached, None, memory, self._weights.download, self._model.name)

    def features(self, progress: Progress, coarse_first: bool) -> Iterator[NormalisedFeatures]:
        """Get the features, normalised; the slow step, once for a volume.

        Args:
            progress: called with bytes downloaded and slices done.
            coarse_first: whether coarse features are wanted first (`progressive_features`).

        Yields:
            Features of ever finer detail; the last are the final ones. They are in the cache when the iteration ends, if it can
            keep them (`FeatureProvenance.not_kept`). If a graphics card runs out of memory or gives wrong results, the
            processor begins again with the first features.

        Raises:
            InputError: weights or device are not to be had, the weights do not fit, or memory is not enough.
            Cancelled: by the progress callback.
        """

        def noted(done: int, total: int, what: str) -> None:
            progress(done, total, what + self._note)

        try:
            yield from self._features(noted, coarse_first)
            return
        except (RuntimeError, MemoryError) as error:
            self._leave_device(error)
        yield from self._features(noted, coarse_first)

    def _features(self, progress: Progress, coarse_first: bool) -> Iterator[NormalisedFeatures]:
        weights = self._weights.known
        if weights is None:
            weights = self._weights.get(progress)
        check_memory_for_features(self._volume, self._size_bytes, self._key(weights) in self._cache)
        cached = self._cached(self._key(weights))
        if cached is None and not weights.path.exists():
            weights = self._weights.get(progress)  # Only now: features in the cache need none, unless they prove damaged.
        self.provenance = FeatureProvenance(
            weights, str(self._device), self._settings.on(self._device).precision, cached is not None
        )
        if cached is not None:
            yield cached
            return
        network = self._networks.network(weights, self._device)
        if coarse_first:
            stages = progressive_features(self._volume, network, self._settings, progress)
        else:
            stages = iter([extract_features(self._volume, network, self._settings, progress)])
        for features in stages:
            normalised = normalised_features(features, self._statistics)
            yield normalised
        self.provenance = replace(self.provenance, not_kept=self._cache.put(normalised.source))

    def _cached(self, key: str) -> NormalisedFeatures | None:
        """The features from the cache; None if it has none, or if their grid is not the expected one."""
        features = self._cache.get(key)
        if features is None or features.cells.shape != self.cells.shape:
            return None
        return normalised_features(features.placed_in(self._volume.geometry), self._statistics)

    def _leave_device(self, error: Exception) -> None:
        """Change to the processor if a graphics card ran out of memory or gives wrong results; raise any other error again.

        All features are then computed in the processor's own precision, and cached under the key of that precision.
        """
        import torch

        if self._device.type == "cpu" or not (is_out_of_memory(error) or isinstance(error, UnsoundDevice)):
            raise error
        logger.warning("The processor computes the features, not %s: %s", self._device, error)
        trouble = "does not compute rightly" if isinstance(error, UnsoundDevice) else "has too little memory"
        self._note = f" (the graphics card {trouble}; the processor computes)"
        self._device = torch.device("cpu")

    @cached_property
    def _device(self) -> torch.device:
        return choose_device(self._device_name)

    def _clicked_bytes(self, coarse_first: bool) -> int:
        """Memory for answering clicks from coarse features while the fine ones are computed, and until these replace them."""
        if not coarse_first:
            return 0
        normalised = normalised_size_bytes(self.cells, self._model.embed_dim, self._statistics)
        return 2 * normalised + CLICK_BYTES_PER_CELL * math.prod(self.cells.shape)

    @property
    def _size_bytes(self) -> int:
        return features_size_bytes(self._volume.geometry, self._settings, self._model)

    def _key(self, weights: WeightsFile) -> str:
        return feature_key(self._volume, self._model.name, weights.sha256, self._settings, self._device)
