"""Classifiers trained on the clicks, after Soundararajan & Schultz (2015): support vector machine and random forest.

With scikit-learn's own settings, but that classes count equally however many samples they have: else the hundred voxels of the
background decide everything. The same classifiers can be given local features, as published, or the network's.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, Literal

import numpy as np

from Benchmarks.accuracy.body_mask import body_mask
from Benchmarks.accuracy.local_features import LocalFeatures
from Benchmarks.accuracy.seeds import Seeds
from Benchmarks.accuracy.svm_scores import svm_scores
from ViTTransferFunction.Logic.core.volumes.resampling import cell_positions, interpolated
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.whitening import NormalisedFeatures

ClassifierKind = Literal["SVM", "RF"]
COARSEST_MM = 3.2
"""Every second voxel along an axis is classified where they are no farther apart; between them scores are interpolated."""
ROWS_AT_ONCE = 50_000


class LocalClassifier:
    """Classifies voxels by their local features. Air around the body is background without being asked for.

    Args:
        volume: the intensities.
        kind: of classifier.
    """

    def __init__(self, volume: Volume, kind: ClassifierKind) -> None:
        self._kind: ClassifierKind = kind
        self._features = LocalFeatures(volume)
        self._shape = volume.shape
        steps = [2 if 2.0 * mm <= COARSEST_MM else 1 for mm in volume.geometry.spacing_mm[::-1]]
        self._lattice = [np.arange(0, count, step) for count, step in zip(volume.shape, steps, strict=True)]
        self._between = [np.arange(count) / step for count, step in zip(volume.shape, steps, strict=True)]
        self._asked = body_mask(volume)[np.ix_(*self._lattice)]

    def __call__(self, seeds: Seeds) -> np.ndarray:
        """Labels (K, J, I) uint16 from the seeds."""
        classifier = trained(self._kind, self._features.of(self._flat(*seeds.kji.T)), seeds.labels)
        asked = np.nonzero(self._asked)
        voxels = self._flat(*(along[index] for along, index in zip(self._lattice, asked, strict=True)))
        scores = np.zeros((*self._asked.shape, int(seeds.labels.max()) + 1), dtype=np.float32)
        # Air: as much background as can be.
        scores[..., 0] = 1.0
        parts = (self._features.of(voxels[start : start + ROWS_AT_ONCE]) for start in range(0, len(voxels), ROWS_AT_ONCE))
        scores[asked] = class_scores(classifier, parts, scores.shape[-1])
        return strongest(scores, lambda one: interpolated(one, self._between))

    def _flat(self, k: np.ndarray, j: np.ndarray, i: np.ndarray) -> np.ndarray:
        return np.ravel_multi_index((k, j, i), self._shape)


class FeatureClassifier:
    """Classifies the cells of the feature volume by the network's features; scores are interpolated to the voxels.

    Args:
        volume: the intensities' grid.
        features: of the volume.
        kind: of classifier.
    """

    def __init__(self, volume: Volume, features: NormalisedFeatures, kind: ClassifierKind) -> None:
        self._volume, self._features = volume, features
        self._kind: ClassifierKind = kind
        self._between = [
            cell_positions(cells, voxels) for cells, voxels in zip(features.geometry.shape, volume.shape, strict=True)
        ]

    def __call__(self, seeds: Seeds) -> np.ndarray:
        """Labels (K, J, I) uint16 from the seeds."""
        at_seeds = self._features.at(self._volume.geometry.ijk_to_ras_points(seeds.kji[:, ::-1]))
        classifier = trained(self._kind, at_seeds, seeds.labels)
        cells = self._features.array.reshape(-1, self._features.array.shape[-1])
        parts = (cells[start : start + ROWS_AT_ONCE] for start in range(0, len(cells), ROWS_AT_ONCE))
        scores = class_scores(classifier, parts, int(seeds.labels.max()) + 1)
        return strongest(scores.reshape(*self._features.geometry.shape, -1), lambda one: interpolated(one, self._between))


def trained(kind: ClassifierKind, features: np.ndarray, labels: np.ndarray) -> Any:
    """A classifier fitted to features (N, F) and their labels (N,)."""
    if kind == "SVM":
        from sklearn.svm import SVC

        return SVC(class_weight="balanced").fit(features, labels)
    from sklearn.ensemble import RandomForestClassifier

    return RandomForestClassifier(class_weight="balanced", random_state=0).fit(features, labels)


def class_scores(classifier: Any, parts: Iterable[np.ndarray], count: int) -> np.ndarray:
    """(N, count) float32, the larger the likelier, for labels 0 … count − 1; labels that it was never shown get the least.

    Args:
        classifier: from `trained`.
        parts: features (n, F), N in all.
        count: of labels.
    """
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        scores = np.concatenate(list(pool.map(partial(_scores_of_known, classifier), parts)))
    all_scores = np.full((len(scores), count), scores.min(), dtype=np.float32)
    all_scores[:, classifier.classes_] = scores
    return all_scores


def _scores_of_known(classifier: Any, features: np.ndarray) -> np.ndarray:
    """(N, known labels)."""
    if hasattr(classifier, "predict_proba"):
        return classifier.predict_proba(features)
    if len(classifier.classes_) > 2:
        return svm_scores(classifier, features)
    decision = classifier.decision_function(features)
    return np.stack([-decision, decision], axis=1)


def strongest(scores: np.ndarray, upsample: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """The label of the highest score at each voxel, uint16; scores (K', J', I', classes) are upsampled class by class."""
    best = upsample(scores[..., 0])
    labels = np.zeros(best.shape, dtype=np.uint16)
    for label in range(1, scores.shape[-1]):
        of_class = upsample(scores[..., label])
        wins = of_class > best
        labels[wins] = label
        best[wins] = of_class[wins]
    return labels
