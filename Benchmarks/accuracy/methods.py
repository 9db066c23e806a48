"""The ways from clicks to labels that are compared: ours, ours by the paper's Eq. 1, and what else there is.

Every method keeps, of each structure, only the connected parts that hold one of its positive clicks, so that none is ahead by
that step alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from Benchmarks.accuracy.baseline_classifiers import ClassifierKind, FeatureClassifier, LocalClassifier
from Benchmarks.accuracy.baseline_grow_from_seeds import GrowFromSeeds
from Benchmarks.accuracy.baseline_threshold import ClickedThreshold
from Benchmarks.accuracy.seeds import Seeds, painted, seeds_of
from Benchmarks.shared.labelled_cases import LabelledVolume, classes_of
from Benchmarks.shared.sessions import labels_of, session_on
from Benchmarks.shared.simulated_clicker import Clicks
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.features.whitening import Statistics, normalised_features
from ViTTransferFunction.Logic.refinement.refinement import RefinementMethod
from ViTTransferFunction.Logic.session.labels import keep_annotated_components
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.similarity.similarity_rule import SimilarityMethod

Segment = Callable[[LabelledVolume, Clicks], np.ndarray]
"""From the clicks of each structure of a labelled volume to labels like its truth's. The truth is there for what a user would
say of the clicked voxels alone."""


class Method(Protocol):
    """One way from clicks to labels.

    Attributes:
        name: in reports.
        negatives: whether it makes use of negative clicks.
        own_clicks: whether it is also given a clicker that reacts to its own errors, which takes an update for every click.
        every_path: whether it is fast enough to be given all paths of clicks; else it gets the first.
    """

    @property
    def name(self) -> str:
        """See above."""

    @property
    def negatives(self) -> bool:
        """See above."""

    @property
    def own_clicks(self) -> bool:
        """See above."""

    @property
    def every_path(self) -> bool:
        """See above."""

    def segmenter(self, volume: Volume, features: FeatureVolume) -> Segment:
        """Prepare the method for a volume: what is done once, and not counted as the time of a click."""


@dataclass(frozen=True)
class SessionMethod:
    """The default preset with some of its parts replaced, on the same features."""

    name: str
    similarity: SimilarityMethod = PRESETS[DEFAULT_PRESET].similarity
    statistics: Statistics = PRESETS[DEFAULT_PRESET].statistics
    refinement: RefinementMethod = "bilateral"
    negatives: bool = True
    own_clicks: bool = True
    every_path: bool = False

    def segmenter(self, volume: Volume, features: FeatureVolume) -> Segment:
        """See `Method`."""
        preset = replace(PRESETS[DEFAULT_PRESET], similarity=self.similarity, statistics=self.statistics)
        session = session_on(volume, features, preset)

        def segment(labelled: LabelledVolume, clicks: Clicks) -> np.ndarray:
            return labels_of(session, labelled, clicks, self.refinement, self.negatives)

        return segment


@dataclass(frozen=True)
class Baseline:
    """A method that is no part of this project.

    Attributes:
        name: see `Method`.
        prepare: makes of a volume and its features what turns seeds into labels.
        true_background: where its background voxels come from (`seeds`).
        brush_mm: radius of what a click paints; 0: a voxel.
        negatives, own_clicks, every_path: see `Method`.
    """

    name: str
    prepare: Callable[[Volume, FeatureVolume], Callable[[Seeds], np.ndarray]]
    true_background: bool = True
    brush_mm: float = 0.0
    negatives: bool = True
    own_clicks: bool = True
    every_path: bool = True

    def segmenter(self, volume: Volume, features: FeatureVolume) -> Segment:
        """See `Method`."""
        segment_seeds = self.prepare(volume, features)

        def segment(labelled: LabelledVolume, clicks: Clicks) -> np.ndarray:
            seeds = seeds_of(clicks, labelled.truth, self.true_background)
            labels = segment_seeds(painted(seeds, labelled.truth, labelled.spacing_mm, self.brush_mm))
            for label, annotated in enumerate(classes_of(labelled.names, clicks, volume.geometry), start=1):
                keep_annotated_components(labels, volume.geometry, {label: annotated.positive})
            return labels

        return segment


def _on_local_features(kind: ClassifierKind) -> Baseline:
    return Baseline(
        f"{kind} on 11 local features", lambda volume, _: LocalClassifier(volume, kind), own_clicks=False, every_path=False
    )


def _on_network_features(kind: ClassifierKind) -> Baseline:
    return Baseline(
        f"{kind} on the network's features",
        lambda volume, features: FeatureClassifier(volume, normalised_features(features, "whitened"), kind),
    )


def _grow_from_seeds(volume: Volume, _: FeatureVolume) -> GrowFromSeeds:
    return GrowFromSeeds(volume)


DEFAULT = SessionMethod("default", every_path=True)
"""Whose clicks the others are given."""
OURS: tuple[Method, ...] = (
    DEFAULT,
    SessionMethod("default, guided filter", refinement="guided"),
    SessionMethod("default, not refined", refinement="none"),
    SessionMethod("Eq. 1, whitened features", similarity="cosine", negatives=False, own_clicks=False),
    SessionMethod("Eq. 1, raw features", similarity="cosine", statistics="none", negatives=False, own_clicks=False),
)
BASELINES: tuple[Method, ...] = (
    Baseline("Grow from seeds", _grow_from_seeds, true_background=False, brush_mm=4.0, own_clicks=False, every_path=False),
    Baseline("Grow from seeds, true background", _grow_from_seeds, brush_mm=4.0, own_clicks=False, every_path=False),
    _on_network_features("SVM"),
    _on_network_features("RF"),
    _on_local_features("SVM"),
    _on_local_features("RF"),
    Baseline("threshold", lambda volume, _: ClickedThreshold(volume)),
)
METHODS = (*OURS, *BASELINES)

TRUE_SAMPLES: dict[ClassifierKind, tuple[int, ...]] = {"SVM": (1024, 2048), "RF": (1024, 2048, 8192)}
"""Voxels a class that the paper's comparison trains on; 8192 would take the SVM longer than all the rest together."""
