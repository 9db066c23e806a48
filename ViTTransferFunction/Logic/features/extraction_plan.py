"""What is run to extract features: which slices, which of their patches, in which batches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..core.orientation import AS_STORED, canonical_orientation
from ..core.volume import Volume
from .background_tokens import TokenSelection, background_cells, select_tokens
from .settings import FeatureSettings, patch_grid_shape
from .slice_patches import SlicePatches
from .slice_sampling import SliceSample, slice_samples

if TYPE_CHECKING:
    import torch

TOKENS_PER_BATCH = 8192
"""Enough to keep the arithmetic busy; beyond it memory grows and time does not shrink."""


@dataclass(frozen=True, eq=False)
class SliceBatch:
    """Slices that are run at once.

    Attributes:
        axis: across which they run.
        samples: the slices.
        chosen: the patches of each.
    """

    axis: int
    samples: tuple[SliceSample, ...]
    chosen: tuple[TokenSelection, ...]


class ExtractionPlan:
    """The slices and patches that settings ask for on a volume; nothing is computed yet but where background is.

    Args:
        volume: intensities and geometry.
        settings: grid and sampling.

    Attributes:
        orientation: in which the network sees the volume.
        shape: patches along the canonical axes.
        batches: everything to run, axis after axis.
    """

    def __init__(self, volume: Volume, settings: FeatureSettings) -> None:
        self.orientation = canonical_orientation(volume.geometry) if settings.canonical else AS_STORED
        self.shape = self.orientation.canonical_shape(patch_grid_shape(volume.geometry, settings))
        self._array = self.orientation.to_canonical(volume.array)
        self._geometry = volume.geometry
        self._windows = settings.windows_for(volume)
        background = np.zeros(self.shape, dtype=bool)
        if settings.merge_background:
            background = background_cells(self._array, self._windows, self.shape)
        samples = (
            slice_samples(slices, layers, settings.every_slice, settings.layer_step)
            for slices, layers in zip(self._array.shape, self.shape, strict=True)
        )
        self.batches = tuple(batch for axis, of_axis in enumerate(samples) for batch in _batches(axis, of_axis, background))

    def patches(self, patch_size: int, device: torch.device) -> list[SlicePatches]:
        """The patches of the slices across each axis."""
        return [SlicePatches(self._array, self._windows, axis, self.shape, patch_size, device) for axis in range(3)]

    def distance_mm(self, batch: SliceBatch, point_ras: np.ndarray) -> float:
        """How far a batch's slices are from a point (3,) in RAS millimetres, on average."""
        stored_axis = self.orientation.order[batch.axis]
        index = float(self._geometry.ras_to_ijk(point_ras)[0, ::-1][stored_axis])
        if self.orientation.mirrored[batch.axis]:
            index = self._geometry.shape[stored_axis] - 1.0 - index
        steps = np.mean([abs(sample.position - index) for sample in batch.samples])
        return float(steps * self._geometry.spacing_mm[2 - stored_axis])

    def tokens_of_slices(self) -> list[int]:
        """Number of patches of every slice that is run."""
        return [len(chosen.places) for batch in self.batches for chosen in batch.chosen]


def _batches(axis: int, samples: Sequence[SliceSample], background: np.ndarray) -> Iterator[SliceBatch]:
    batch: list[tuple[SliceSample, TokenSelection]] = []
    tokens = 0
    for sample in samples:
        # A patch is background where it is so in every layer that the slice represents.
        layers = [layer for layer, _ in sample.layers]
        chosen = select_tokens(np.logical_and.reduce(background.take(layers, axis=axis), axis=axis))
        if batch and tokens + len(chosen.places) > TOKENS_PER_BATCH:
            yield _batch(axis, batch)
            batch, tokens = [], 0
        batch.append((sample, chosen))
        tokens += len(chosen.places)
    yield _batch(axis, batch)


def _batch(axis: int, members: list[tuple[SliceSample, TokenSelection]]) -> SliceBatch:
    return SliceBatch(axis, tuple(sample for sample, _ in members), tuple(chosen for _, chosen in members))
