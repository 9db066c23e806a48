"""One method on one labelled volume: metrics of every structure after every round of clicks, and what a round took."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any, Literal

import numpy as np

from Benchmarks.accuracy.baseline_classifiers import ClassifierKind, LocalClassifier
from Benchmarks.accuracy.methods import Segment
from Benchmarks.accuracy.seeds import random_seeds
from Benchmarks.shared.click_sequence import ClickSequence
from Benchmarks.shared.labelled_cases import LabelledVolume
from Benchmarks.shared.segmentation_metrics import segmentation_metrics
from Benchmarks.shared.simulated_clicker import ClickedRound, Clicks, click_in_rounds

Mode = Literal["together", "one by one"]
"""All structures annotated at once, competing for voxels; or each alone, all else being background."""

Rounds = dict[str, dict[str, dict[str, float]]]
"""Number of clicks → structure → metrics, and `seconds` that the method took for the update: in mode "together" that of all."""

DIGITS = 4


def run_with_own_clicks(
    labelled: LabelledVolume, segment: Segment, mode: Mode, rounds: int, with_negatives: bool
) -> tuple[Rounds, ClickSequence]:
    """Let the clicker react to the method's own errors."""
    measured: Rounds = {}
    sequences = []
    for part, _ in _parts(labelled, mode):
        timed = _Timed(segment, part)
        states = []
        for state in click_in_rounds(part.truth, part.spacing_mm, timed, rounds, with_negatives):
            measured.setdefault(str(state.number), {}).update(_metrics(part, state.labels, timed.seconds))
            states.append(ClickedRound(state.number, state.clicks, np.empty(0)))
        sequences.append(ClickSequence.of_rounds(states))
    return measured, sequences[0] if mode == "together" else ClickSequence.side_by_side(sequences)


def run_on_clicks(
    labelled: LabelledVolume, segment: Segment, mode: Mode, sequence: ClickSequence, rounds: Sequence[int]
) -> Rounds:
    """Give the method the clicks that another one led to, at some of the rounds."""
    measured: Rounds = {}
    for part, index in _parts(labelled, mode):
        clicks = sequence if index is None else sequence.of_class(index)
        for number in rounds:
            timed = _Timed(segment, part)
            labels = timed(clicks.at(number))
            measured.setdefault(str(number), {}).update(_metrics(part, labels, timed.seconds))
    return measured


def run_on_true_samples(labelled: LabelledVolume, kind: ClassifierKind, samples: Sequence[int]) -> Rounds:
    """Train a classifier on so many random voxels of every class, as the paper does for comparison."""
    classifier = LocalClassifier(labelled.volume, kind)
    measured: Rounds = {}
    for count in samples:
        start = time.perf_counter()
        labels = classifier(random_seeds(labelled.truth, count))
        measured[str(count)] = _metrics(labelled, labels, time.perf_counter() - start)
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


def _parts(labelled: LabelledVolume, mode: Mode) -> Iterator[tuple[LabelledVolume, int | None]]:
    """What is annotated at once, and which structure alone that is."""
    if mode == "together":
        yield labelled, None
    else:
        for index in range(len(labelled.names)):
            yield labelled.alone(index), index


def _metrics(labelled: LabelledVolume, labels: np.ndarray, seconds: float) -> dict[str, dict[str, Any]]:
    entries = {}
    for label, name in enumerate(labelled.names, start=1):
        metrics = asdict(segmentation_metrics(labels == label, labelled.truth == label, labelled.spacing_mm))
        entries[name] = {key: round(value, DIGITS) for key, value in {**metrics, "seconds": seconds}.items()}
    return entries
