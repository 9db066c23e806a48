"""What is run to extract features: which slices, and which of their patches."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..core.volumes.orientation import AS_STORED, canonical_orientation
from ..core.volumes.volume import Volume
from .background_tokens import BACKGROUND_STRIDE, TokenSelection, background_cells, select_tokens
from .settings import SMALLEST_GRID, FeatureSettings, grid_shape, shape_along
from .slice_patches import SlicePatches
from .slice_sampling import SliceSample, slice_count, slice_samples

if TYPE_CHECKING:
    import torch

BODY_SHARE_GRID = 24
"""Cells along the longest edge to tell how much of the volume is background: about as many as there will be patches."""


@dataclass(frozen=True, eq=False)
class PlannedSlice:
    """A slice to run.

    Attributes:
        axis: across which it lies.
        sample: where it lies, and the layers that it contributes to.
        chosen: its patches that the network gets.
    """

    axis: int
    sample: SliceSample
    chosen: TokenSelection


class ExtractionPlan:
    """The slices and patches that settings ask for on a volume; nothing is computed yet but where background is.

    Args:
        volume: intensities and geometry.
        settings: grid and sampling.

    Attributes:
        orientation: in which the network sees the volume.
        shape: patches along the canonical axes.
        patches_geometry: the patches' grid, along the stored axes.
    """

    def __init__(self, volume: Volume, settings: FeatureSettings) -> None:
        self.orientation = canonical_orientation(volume.geometry) if settings.canonical else AS_STORED
        self._array = self.orientation.to_canonical(volume.array)
        self._geometry = volume.geometry
        self._settings = settings
        self._channels = settings.channels_for(volume)
        stored_shape = self._patch_shape()
        self.shape = self.orientation.canonical_shape(stored_shape)
        self.patches_geometry = volume.geometry.resized(stored_shape)

    @cached_property
    def slices(self) -> tuple[PlannedSlice, ...]:
        """Everything to run, axis after axis."""
        background, samples = self._background(self.shape), self._samples(self.shape)
        return tuple(
            PlannedSlice(axis, sample, _chosen(axis, sample, background))
            for axis, of_axis in enumerate(samples)
            for sample in of_axis
        )

    def patches(self, patch_size: int, device: torch.device) -> list[SlicePatches]:
        """The patches of the slices across each axis."""
        return [SlicePatches(self._array, self._channels, axis, self.shape, patch_size, device) for axis in range(3)]

    def tokens_of_slices(self) -> list[int]:
        """Number of patches of every slice that is run."""
        return [len(of_slice.chosen.places) for of_slice in self.slices]

    def _patch_shape(self) -> tuple[int, int, int]:
        """As many patches along the stored axes as there are cells, or as many as make `most_patches` in all slices."""
        most = self._settings.most_patches
        if most is None:
            return grid_shape(self._geometry, self._settings)
        background = self._background(self.orientation.canonical_shape(self._shape_along(BODY_SHARE_GRID)))
        run = 1.0 - background.mean() * (1.0 - 1.0 / BACKGROUND_STRIDE**2)
        coarser = (self._shape_along(longest) for longest in range(self._settings.grid, SMALLEST_GRID, -1))
        return next((shape for shape in coarser if run * self._patches_in(shape) <= most), self._shape_along(SMALLEST_GRID))

    def _shape_along(self, longest: int) -> tuple[int, int, int]:
        return shape_along(self._geometry, longest, self._settings.isotropic)

    def _patches_in(self, stored_shape: tuple[int, int, int]) -> int:
        """Number of patches in all slices, background included."""
        shape, settings = self.orientation.canonical_shape(stored_shape), self._settings
        counts = (
            slice_count(slices, layers, settings.every_slice, settings.layer_step)
            for slices, layers in zip(self._array.shape, shape, strict=True)
        )
        return sum(count * math.prod(shape) // layers for count, layers in zip(counts, shape, strict=True))

    def _samples(self, shape: tuple[int, int, int]) -> list[list[SliceSample]]:
        """The slices to run across each axis."""
        return [
            slice_samples(slices, layers, self._settings.every_slice, self._settings.layer_step)
            for slices, layers in zip(self._array.shape, shape, strict=True)
        ]

    def _background(self, shape: tuple[int, int, int]) -> np.ndarray:
        """Which patches show nothing but background."""
        if self._settings.merge_background:
            return background_cells(self._array, self._channels.background, shape)
        return np.zeros(shape, dtype=bool)


def _chosen(axis: int, sample: SliceSample, background: np.ndarray) -> TokenSelection:
    """The patches of a slice to run. One is background where it is so in every layer that the slice represents."""
    layers = [layer for layer, _ in sample.layers]
    return select_tokens(np.logical_and.reduce(background.take(layers, axis=axis), axis=axis))
