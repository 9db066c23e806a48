"""Normalises features by the volume's own statistics: they are centred, whitened and scaled to unit length.

For keys of the DINOv2 family that are not centred, the cosine between any two cells is above 0.9, so that no threshold
separates anything. Cells are distinguished by their differences from the volume's mean, relative to the variance in each
direction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..core.system.errors import InputError
from ..core.volumes.geometry import Geometry
from ..core.volumes.long_rows import long_rows
from ..core.volumes.orientation import canonical_orientation
from ..core.volumes.resampling import sample_by
from ..core.volumes.torch_arrays import array_of, tensor_of
from .feature_volume import FeatureVolume, Moments
from .layer_interpolation import interpolated_layers

Statistics = Literal["none", "centred", "whitened"]

WHITENED_COMPONENTS = 64
"""Number of directions of largest variance that are kept; the rest is mostly noise, which whitening would amplify."""
STATISTICS_PATCHES = 30_000
"""Largest number of patches from which moments are computed. All patches of a 64³ grid change the result by a few percent."""
PATCHES_PER_COMPONENT = 50
"""Least number of patches for each kept direction; with fewer, every cell would look unlike its neighbours."""
MOMENTS_BLOCK = 2048
"""Patches whose products are computed together in float32, before sums are added in float64. This is several times as fast as
float64, and its error is no larger than that of storing features in float16."""
SMALLEST_NORM = 1e-12


@dataclass(frozen=True)
class FeatureTransform:
    """An affine map of feature vectors: `(F − mean) · projection`.

    Attributes:
        mean: (C,) float32.
        projection: (C, C') float32; None: all channels are kept.
    """

    mean: np.ndarray
    projection: np.ndarray | None

    @property
    def channels(self) -> int:
        """C', the number of channels after the map."""
        return len(self.mean) if self.projection is None else self.projection.shape[1]

    def apply(self, vectors: np.ndarray) -> np.ndarray:
        """Map vectors (…, C) to (…, C') float32."""
        centred = _as_single(vectors)
        centred = centred - self.mean if centred is vectors else np.subtract(centred, self.mean, out=centred)
        mapped: np.ndarray = centred if self.projection is None else centred @ self.projection
        return mapped


@dataclass(frozen=True, eq=False)
class NormalisedFeatures:
    """Unit vectors whose dot products are the cosine similarities of Eq. 1.

    Attributes:
        array: (K', J', I', C') float32; each vector has length 1, or 0 if the transformed feature is 0. The channels lie one
            after the other in memory, so that products of all vectors with one vector take less than half as long.
        transform: the map that was applied before scaling to unit length.
        source: the features as extracted, with their moments if these were needed.
    """

    array: np.ndarray
    transform: FeatureTransform
    source: FeatureVolume

    @property
    def geometry(self) -> Geometry:
        """The grid of the cells, which may be finer than that of the extracted features."""
        return self.source.cells

    def at(self, points_ras: np.ndarray) -> np.ndarray:
        """Unit vectors (N, C') at world points (N, 3), RAS millimetres: features are interpolated, then transformed."""
        return unit_vectors(self.transform.apply(sample_by(self.source.vectors_at, self.source.geometry, points_ras)))


def normalised_features(features: FeatureVolume, statistics: Statistics) -> NormalisedFeatures:
    """Prepare a feature volume for cosine similarity.

    Args:
        features: as extracted.
        statistics: "none": no transform, as in the paper; "centred": minus the volume's mean; "whitened": centred, then
            projected to the `WHITENED_COMPONENTS` principal directions, or to fewer if there are few patches
            (`PATCHES_PER_COMPONENT`), each scaled to unit variance over the volume.

    Raises:
        InputError: features to be whitened do not vary or are not finite.
    """
    if statistics != "none" and features.moments is None:
        features = replace(features, moments=_moments(features))
    transform = _fit_transform(features, statistics)
    by_channels = array_of(long_rows(transform.channels, int(np.prod(features.cells.shape))).unflatten(1, features.cells.shape))
    # Interpolation commutes with an affine map, whose result has fewer channels and is therefore interpolated. The map is
    # applied layer by layer, so that no full-size float32 copy of the raw features is made.
    mapped = (np.moveaxis(transform.apply(layer), -1, 0) for layer in features.array)
    layers = interpolated_layers(mapped, features.geometry.shape, features.cells.shape)
    for k, layer in enumerate(layers):
        unit_vectors(layer, axis=0, out=by_channels[:, k])
    return NormalisedFeatures(np.moveaxis(by_channels, 0, -1), transform, features)


def normalised_size_bytes(cells: Geometry, channels: int, statistics: Statistics) -> int:
    """Upper bound of the size of `NormalisedFeatures.array` on these cells; `channels` is that of the extracted features."""
    kept = min(channels, WHITENED_COMPONENTS) if statistics == "whitened" else channels
    return math.prod(cells.shape) * kept * np.dtype(np.float32).itemsize


def unit_vectors(vectors: np.ndarray, axis: int = -1, out: np.ndarray | None = None) -> np.ndarray:
    """Vectors scaled to length 1; zero vectors stay zero.

    Args:
        vectors: of any shape.
        axis: the axis of the channels.
        out: array for the result; None: a new one.
    """
    norms = np.linalg.norm(vectors, axis=axis, keepdims=True)
    unit: np.ndarray = np.divide(vectors, np.maximum(norms, SMALLEST_NORM), out=out)
    return unit


def _fit_transform(features: FeatureVolume, statistics: Statistics) -> FeatureTransform:
    if statistics == "none":
        return FeatureTransform(np.zeros(features.channels, dtype=np.float32), None)
    assert features.moments is not None
    mean, covariance = features.moments.mean, features.moments.covariance
    if statistics == "centred":
        return FeatureTransform(mean.astype(np.float32), None)
    if not np.isfinite(covariance).all():
        raise InputError(
            "The features hold values that are not numbers, or beyond all measure. The weights are damaged, or not those of "
            "this network: get them again."
        )
    variances, directions = np.linalg.eigh(covariance)
    patches = features.array.size // features.channels
    count = min(WHITENED_COMPONENTS, max(1, patches // PATCHES_PER_COMPONENT))
    order = np.argsort(variances)[::-1][:count]
    # Directions without variance, for example of fewer patches than channels, carry no information, and would be divided by 0.
    order = order[variances[order] > variances[order[0]] * 1e-6]
    if not len(order):
        raise InputError(
            "The features are the same everywhere in this volume, so nothing can be told apart. Check that the weights are "
            "those of a trained network, and that the volume shows something."
        )
    projection = directions[:, order] / np.sqrt(variances[order])
    return FeatureTransform(mean.astype(np.float32), projection.astype(np.float32))


def _moments(features: FeatureVolume) -> Moments:
    """Mean and covariance over evenly spread patches, at most `STATISTICS_PATCHES`."""
    spread = canonical_orientation(features.geometry).spread(features.array, STATISTICS_PATCHES)
    cells = spread.reshape(-1, features.channels)
    blocks = [cells[start : start + MOMENTS_BLOCK] for start in range(0, len(cells), MOMENTS_BLOCK)]
    total = sum(_as_single(block).sum(axis=0, dtype=np.float64) for block in blocks)
    mean = np.asarray(total / len(cells))
    middle = mean.astype(np.float32)
    covariance = np.zeros((len(mean), len(mean)))
    for block in blocks:
        centred = tensor_of(_as_single(block) - middle)
        covariance += array_of(centred.T @ centred)
    return Moments(mean, covariance / len(cells))


def _as_single(vectors: np.ndarray) -> np.ndarray:
    """Convert to float32; returns the same array if it already is."""
    if vectors.dtype != np.float16:
        return np.asarray(vectors, dtype=np.float32)

    # The same values as by numpy, several times faster. PyTorch needs arrays that are writable.
    single: np.ndarray = array_of(tensor_of(np.require(vectors, requirements=("C", "W"))).float())
    return single
