"""From a volume to its feature volume F: slices along three axes through the ViT, pooled and merged (paper §III-A).

    F = ⅓ (pool_K keys(slices along K) + pool_J keys(slices along J) + pool_I keys(slices along I))

The keys of each slice are added to the layers of F that they belong to as soon as they are computed, so that memory is
the result plus one batch of slices.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from .errors import InputError
from .feature_volume import FeatureVolume
from .geometry import Geometry
from .intensity_window import ChannelWindows, full_range_window, network_windows
from .orientation import AS_STORED, upright_orientation
from .pretrained_models import PretrainedModel
from .progress import Progress, no_progress
from .volume import Volume

if TYPE_CHECKING:
    from torch import Tensor

    from .vision_transformer import VisionTransformer

SMALLEST_GRID, LARGEST_GRID = 4, 128
TOKENS_PER_BATCH = 8192
"""Enough to keep the arithmetic busy; beyond it memory grows and time does not shrink."""
CHANNEL_MEAN = (0.485, 0.456, 0.406)
CHANNEL_STD = (0.229, 0.224, 0.225)
FORMAT_VERSION = 1
"""Part of every key: to be raised when the same settings come to give other features."""


@dataclass(frozen=True)
class FeatureSettings:
    """How features are extracted.

    Attributes:
        grid: number of cells along the volume's longest edge.
        isotropic: cells are cubes in millimetres; otherwise they have the voxels' proportions, as published.
        upright: show the network slices as a person would look at them (`orientation`); otherwise as they are stored, as
            published.
        every_slice: run every slice and average-pool, as published; otherwise one slice through each layer's centre.
        windows: intensity windows of the three colour channels: chosen from the volume ("robust", `network_windows`), from
            its smallest to its largest value ("full range", as published), or as given.

    Raises:
        InputError: `grid` is out of range.
    """

    grid: int = 64
    isotropic: bool = True
    upright: bool = True
    every_slice: bool = False
    windows: ChannelWindows | Literal["robust", "full range"] = "robust"

    def __post_init__(self) -> None:
        if not SMALLEST_GRID <= self.grid <= LARGEST_GRID:
            raise InputError(f"The feature grid must have {SMALLEST_GRID} to {LARGEST_GRID} cells; got {self.grid}.")

    def windows_for(self, volume: Volume) -> ChannelWindows:
        """The windows to use for `volume`."""
        if self.windows == "robust":
            return network_windows(volume)
        if self.windows == "full range":
            return (full_range_window(volume),) * 3
        return self.windows


@dataclass(frozen=True)
class SliceSample:
    """One slice to run, and the layers of F that its keys contribute to.

    Attributes:
        position: index along the sliced axis; fractional positions interpolate linearly between neighbours.
        layers: (layer, weight) pairs; over all samples of an axis the weights of each layer sum to 1.
    """

    position: float
    layers: tuple[tuple[int, float], ...]


def extract_features(
    volume: Volume, network: VisionTransformer, settings: FeatureSettings, progress: Progress = no_progress
) -> FeatureVolume:
    """Compute the feature volume.

    Args:
        volume: intensities and geometry.
        network: loaded weights on the device to compute on.
        settings: grid and sampling.
        progress: told of slices done; may raise `Cancelled`.

    Returns:
        Features in float16, whose rounding (2⁻¹¹ relative) is far below the differences between neighbouring cells.
    """
    import torch

    geometry = volume.geometry.resized(grid_shape(volume.geometry, settings))
    orientation = upright_orientation(volume.geometry) if settings.upright else AS_STORED
    array, grid = orientation.upright(volume.array), orientation.upright_shape(geometry.shape)
    merged = torch.zeros((*grid, network.model.embed_dim), dtype=torch.float32, device=network.device)
    plan = [
        (axis, samples)
        for axis in range(3)
        for samples in _batches(slice_samples(array.shape[axis], grid[axis], settings.every_slice), grid, axis)
    ]
    total = sum(len(samples) for _, samples in plan)
    windows = settings.windows_for(volume)
    done = 0
    progress(done, total, "Extracting features")
    for axis, samples in plan:
        images = _network_input(array, windows, axis, samples, grid, network.model.patch_size)
        keys = network.last_block_keys(images).float()
        _accumulate(merged, keys, axis, samples)
        done += len(samples)
        progress(done, total, "Extracting features")
    merged /= 3.0
    features = orientation.restored(merged.to(torch.float16).cpu().numpy())
    return FeatureVolume(
        np.ascontiguousarray(features), geometry, feature_key(volume, network.model.name, network.weights_digest, settings)
    )


def grid_shape(geometry: Geometry, settings: FeatureSettings) -> tuple[int, int, int]:
    """Number of cells along (K, J, I): `settings.grid` along the longest edge, the others in proportion, at least 1."""
    edges = geometry.extent_mm[::-1] if settings.isotropic else np.array(geometry.shape, dtype=float)
    cells = np.maximum(1, np.round(edges * settings.grid / edges.max())).astype(int)
    return int(cells[0]), int(cells[1]), int(cells[2])


def features_size_bytes(geometry: Geometry, settings: FeatureSettings, model: PretrainedModel) -> int:
    """Size of the feature volume that `extract_features` returns."""
    return math.prod(grid_shape(geometry, settings)) * model.embed_dim * np.dtype(np.float16).itemsize


def slice_samples(slices: int, layers: int, every_slice: bool) -> list[SliceSample]:
    """Which of an axis' `slices` to run for its `layers`, and how they pool.

    With `every_slice` this is adaptive average pooling: layer l averages slices ⌊l·n/m⌋ to ⌈(l+1)·n/m⌉ − 1.
    Otherwise one slice through each layer's centre.
    """
    if not every_slice:
        centres = [min(max((layer + 0.5) * slices / layers - 0.5, 0.0), slices - 1.0) for layer in range(layers)]
        return [SliceSample(centre, ((layer, 1.0),)) for layer, centre in enumerate(centres)]
    members = [range(layer * slices // layers, -(-(layer + 1) * slices // layers)) for layer in range(layers)]
    return [
        SliceSample(float(index), tuple((layer, 1.0 / len(m)) for layer, m in enumerate(members) if index in m))
        for index in range(slices)
    ]


def feature_key(volume: Volume, model_name: str, weights_digest: str, settings: FeatureSettings) -> str:
    """A name for the features of this content, model and settings: hexadecimal SHA-256.

    The volume's place in the patient is part of it (feature cells lie in the patient), its name is not.
    """
    digest = hashlib.sha256()
    digest.update(f"{FORMAT_VERSION} {model_name} {weights_digest} {sorted(asdict(settings).items())}".encode())
    digest.update(f"{volume.array.shape} {volume.array.dtype.str}".encode())
    digest.update(volume.geometry.ijk_to_ras.astype("<f8").tobytes())
    digest.update(np.ascontiguousarray(volume.array).data)
    return digest.hexdigest()


def _batches(samples: list[SliceSample], shape: tuple[int, int, int], axis: int) -> Iterator[list[SliceSample]]:
    tokens_per_slice = math.prod(shape) // shape[axis]
    size = max(1, TOKENS_PER_BATCH // tokens_per_slice)
    for start in range(0, len(samples), size):
        yield samples[start : start + size]


def _network_input(
    array: np.ndarray,
    windows: ChannelWindows,
    axis: int,
    samples: list[SliceSample],
    shape: tuple[int, int, int],
    patch_size: int,
) -> Tensor:
    """Slices as the network's input images, (B, 3, rows·p, columns·p) float32, one patch for each cell of the layer."""
    import torch
    import torch.nn.functional as F

    slices = np.stack([_slice_at(array, axis, sample.position) for sample in samples])
    images = torch.from_numpy(np.stack([window.apply(slices) for window in windows], axis=1))
    rows, columns = (cells for a, cells in enumerate(shape) if a != axis)
    size = (rows * patch_size, columns * patch_size)
    images = F.interpolate(images, size=size, mode="bilinear", antialias=True, align_corners=False)
    mean, std = (torch.tensor(values).view(1, 3, 1, 1) for values in (CHANNEL_MEAN, CHANNEL_STD))
    return (images - mean) / std


def _slice_at(array: np.ndarray, axis: int, position: float) -> np.ndarray:
    """One slice across `axis`, float32, linearly interpolated where the position lies between two."""
    lower = math.floor(position)
    fraction = np.float32(position - lower)
    first = array.take(lower, axis=axis).astype(np.float32)
    if fraction == 0.0:
        return first
    return first * (1 - fraction) + array.take(lower + 1, axis=axis).astype(np.float32) * fraction


def _accumulate(merged: Tensor, keys: Tensor, axis: int, samples: list[SliceSample]) -> None:
    """Add the keys (B, rows, columns, C) of each slice to its layers of the merged volume, in place."""
    for slice_keys, sample in zip(keys, samples, strict=True):
        for layer, weight in sample.layers:
            merged.select(axis, layer).add_(slice_keys, alpha=weight)
