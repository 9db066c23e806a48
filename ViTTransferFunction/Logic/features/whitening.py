"""Features normalised by the volume's own statistics: centred, whitened, scaled to unit length.

Un-centred keys of the DINOv2 family have cosine above 0.9 between any two cells: no threshold separates anything. What
tells cells apart is how they differ from the volume's mean, measured against how much each direction varies anyway.
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
"""Directions of largest variance that are kept; the rest is mostly noise that whitening would blow up."""
STATISTICS_PATCHES = 30_000
"""Enough for a covariance of some hundred channels: with all patches of a 64³ grid the result is the same to a few percent."""
PATCHES_PER_COMPONENT = 50
"""Fewer patches than this for each direction would make every cell look unlike its neighbours."""
MOMENTS_BLOCK = 2048
"""So many patches are multiplied in float32, and their sums added in float64: several times as fast, and off by no more than
features are that are kept in float16."""
SMALLEST_NORM = 1e-12


@dataclass(frozen=True)
class FeatureTransform:
    """An affine map of feature vectors: `(F − mean) · projection`.

    Attributes:
        mean: (C,) float32.
        projection: (C, C') float32, or None to keep all channels as they are.
    """

    mean: np.ndarray
    projection: np.ndarray | None

    @property
    def channels(self) -> int:
        """C'."""
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
        array: (K', J', I', C') float32, each vector of length 1 (or 0 where the feature was the mean itself). It lies in memory
            channel by channel: then the products of all vectors with one take less than half as long.
        transform: what was applied before normalising.
        source: the features as extracted, with their moments where these were needed.
    """

    array: np.ndarray
    transform: FeatureTransform
    source: FeatureVolume

    @property
    def geometry(self) -> Geometry:
        """The grid of the cells, which may be finer than that of the features as extracted."""
        return self.source.cells

    def at(self, points_ras: np.ndarray) -> np.ndarray:
        """Unit vectors (N, C') at world points (N, 3), RAS millimetres: features are interpolated, then transformed."""
        return unit_vectors(self.transform.apply(sample_by(self.source.vectors_at, self.source.geometry, points_ras)))


def normalised_features(features: FeatureVolume, statistics: Statistics) -> NormalisedFeatures:
    """Prepare a feature volume for cosine similarity.

    Args:
        features: as extracted.
        statistics: "none": as they are, the paper's way; "centred": minus the volume's mean; "whitened": centred, then
            the `WHITENED_COMPONENTS` principal directions, or fewer of few patches (`PATCHES_PER_COMPONENT`), each scaled to
            unit variance over the volume.

    Raises:
        InputError: the features are to be whitened, and do not vary or are not finite.
    """
    if statistics != "none" and features.moments is None:
        features = replace(features, moments=_moments(features))
    transform = _fit_transform(features, statistics)
    by_channels = array_of(long_rows(transform.channels, int(np.prod(features.cells.shape))).unflatten(1, features.cells.shape))
    # An affine map of what is interpolated is what is interpolated of its values: the latter has fewer channels. Layer by
    # layer, so that no full-size float32 copy of the raw features is ever made.
    mapped = (np.moveaxis(transform.apply(layer), -1, 0) for layer in features.array)
    layers = interpolated_layers(mapped, features.geometry.shape, features.cells.shape)
    for k, layer in enumerate(layers):
        unit_vectors(layer, axis=0, out=by_channels[:, k])
    return NormalisedFeatures(np.moveaxis(by_channels, 0, -1), transform, features)


def normalised_size_bytes(cells: Geometry, channels: int, statistics: Statistics) -> int:
    """Size of the array of `NormalisedFeatures` on these cells, at most; `channels` of the features as extracted."""
    kept = min(channels, WHITENED_COMPONENTS) if statistics == "whitened" else channels
    return math.prod(cells.shape) * kept * np.dtype(np.float32).itemsize


def unit_vectors(vectors: np.ndarray, axis: int = -1, out: np.ndarray | None = None) -> np.ndarray:
    """Vectors scaled to length 1; zero vectors stay zero.

    Args:
        vectors: of any shape.
        axis: along which a vector's channels lie.
        out: where to write them; None: a new array.
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
    # Directions that do not vary (fewer cells than channels, say) carry nothing and would only be divided by zero.
    order = order[variances[order] > variances[order[0]] * 1e-6]
    if not len(order):
        raise InputError(
            "The features are the same everywhere in this volume, so nothing can be told apart. Check that the weights are "
            "those of a trained network, and that the volume shows something."
        )
    projection = directions[:, order] / np.sqrt(variances[order])
    return FeatureTransform(mean.astype(np.float32), projection.astype(np.float32))


def _moments(features: FeatureVolume) -> Moments:
    """Over evenly spread patches, at most `STATISTICS_PATCHES`."""
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
    """As float32; the same array where it is that already."""
    if vectors.dtype != np.float16:
        return np.asarray(vectors, dtype=np.float32)

    # The same values, several times faster than numpy finds them. PyTorch knows no arrays that cannot be written to.
    single: np.ndarray = array_of(tensor_of(np.require(vectors, requirements=("C", "W"))).float())
    return single
