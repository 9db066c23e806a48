"""One method on one labelled volume: metrics of every structure after every round of clicks, and what a round took."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from Benchmarks.accuracy.baseline_classifiers import ClassifierKind, LocalClassifier
from Benchmarks.accuracy.methods import Segment
from Benchmarks.accuracy.seeds import random_seeds
from Benchmarks.shared.aim import Aim
from Benchmarks.shared.click_sequence import ClickSequence
from Benchmarks.shared.labelled_cases import LabelledVolume
from Benchmarks.shared.segmentation_metrics import segmentation_metrics
from Benchmarks.shared.simulated_clicker import ClickedRound, Clicks, Gesture, click_in_rounds

Metrics = dict[str, float]
Rounds = dict[str, dict[str, Metrics]]
"""Number of clicks → structure → metrics, and `seconds` that the method took for the update, of all structures together."""

DIGITS = 4


def run_with_own_clicks(
    labelled: LabelledVolume,
    segment: Segment,
    rounds: int,
    with_negatives: bool,
    aims: Sequence[Aim],
    begun_by: Sequence[Sequence[Gesture]] | None = None,
) -> tuple[Rounds, ClickSequence]:
    """Let the clicker react to the method's own errors, in all structures together; see `click_in_rounds`."""
    measured: Rounds = {}
    timed, states = _Timed(segment, labelled), []
    for state in click_in_rounds(labelled.truth, labelled.spacing_mm, timed, rounds, with_negatives, aims, begun_by):
        measured[str(state.number)] = metrics_of(labelled, state.labels, timed.seconds)
        states.append(ClickedRound(state.number, state.clicks, np.empty(0)))
    return measured, ClickSequence.of_rounds(states)


def run_one_by_one(labelled: LabelledVolume, segment: Segment, rounds: int, aims: Sequence[Aim]) -> Rounds:
    """The same for each structure alone, all else being background."""
    measured: Rounds = {}
    for index, aim in enumerate(aims):
        alone, _ = run_with_own_clicks(labelled.alone(index), segment, rounds, True, [aim])
        for number, structures in alone.items():
            measured.setdefault(number, {}).update(structures)
    return measured


def run_on_clicks(labelled: LabelledVolume, segment: Segment, clicks: ClickSequence, rounds: Sequence[int]) -> Rounds:
    """Give the method the clicks that another one led to, at some of the rounds."""
    measured: Rounds = {}
    timed = _Timed(segment, labelled)
    for number in rounds:
        labels = timed(clicks.at(number))
        measured[str(number)] = metrics_of(labelled, labels, timed.seconds)
    return measured


def run_on_true_samples(labelled: LabelledVolume, kind: ClassifierKind, samples: Sequence[int]) -> Rounds:
    """Train a classifier on so many random voxels of every class, as the paper does for comparison."""
    classifier = LocalClassifier(labelled.volume, kind)
    measured: Rounds = {}
    for count in samples:
        start = time.perf_counter()
        labels = classifier(random_seeds(labelled.truth, count))
        measured[str(count)] = metrics_of(labelled, labels, time.perf_counter() - start)
    return measured


class _Timed:
    """A method on one labelled volume; `seconds` says how long its last answer took."""

    def __init__(self, segment: Segment, labelled: LabelledVolume) -> None:
        self._segment, self._labelled = segment, labelled
        self.seconds = 0.0

    def __call__(self, clicks: Clicks) -> np.ndarray:
        start = time.perf_counter()
        labels = self._segment(self._labelled, clicks)
        self.seconds = time.perf_counter() - start
        return labels


def metrics_of(labelled: LabelledVolume, labels: np.ndarray, seconds: float) -> dict[str, Metrics]:
    """Metrics of every structure of a label map (K, J, I)."""
    return {
        name: rounded_metrics(labels == label, labelled.truth == label, labelled, seconds=seconds)
        for label, name in enumerate(labelled.names, start=1)
    }


def rounded_metrics(mask: np.ndarray, truth: np.ndarray, labelled: LabelledVolume, **others: float) -> dict[str, Any]:
    """Metrics of one structure, and what else is to be kept with them, rounded for a file."""
    metrics = {**asdict(segmentation_metrics(mask, truth, labelled.spacing_mm)), **others}
    return {key: round(value, DIGITS) for key, value in metrics.items()}
