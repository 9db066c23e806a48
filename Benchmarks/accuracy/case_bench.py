"""Everything that `bench accuracy` measures on one labelled volume."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, partial
from typing import Any

from Benchmarks.accuracy.baseline_classifiers import ClassifierKind
from Benchmarks.accuracy.cases import CaseGroup
from Benchmarks.accuracy.failures import Failure, worst_structures
from Benchmarks.accuracy.methods import DEFAULT, Method, Segment
from Benchmarks.accuracy.runs import run_on_clicks, run_on_true_samples, run_one_by_one, run_with_own_clicks
from Benchmarks.accuracy.single_clicks import run_single_clicks
from Benchmarks.accuracy.size_steps import run_size_steps
from Benchmarks.shared.aim import persons_aims
from Benchmarks.shared.click_sequence import ClickSequence
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.labelled_cases import LabelledVolume
from Benchmarks.shared.sessions import load_features, session_on
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession
from ViTTransferFunction.Logic.weights.sources import WeightsFile

PATHS = 5
ROUNDS = 5
REPLAYED_ROUNDS = (1, 3, 5, 10)
"""At which other methods are given the default's clicks, and steps of size are tried: every round would take too long."""
FIRST_PATH = 1

Run = dict[str, Any]


class CaseBench:
    """Everything that is measured on one labelled volume.

    Args:
        name: of the case.
        labelled: the volume and its truth.
        weights: what its features are computed with, which all methods share that use any.
        preset: how they are computed.
        rounds: clicks for each structure.
        kept: what was measured already.
    """

    def __init__(
        self, name: str, labelled: LabelledVolume, weights: WeightsFile, preset: str, rounds: int, kept: KeptResults
    ) -> None:
        self._name, self._labelled, self._weights, self._preset = name, labelled, weights, preset
        self._rounds, self._kept = rounds, kept
        self._replayed = [number for number in REPLAYED_ROUNDS if number <= rounds]

    def measure(
        self, group: CaseGroup, paths: int, methods: Sequence[Method], samples: dict[ClassifierKind, tuple[int, ...]]
    ) -> Iterator[Run]:
        """What the group asks for, on so many paths of clicks."""
        for path in range(FIRST_PATH, FIRST_PATH + (paths if group.every_path else 1)):
            reference = self._run(DEFAULT.name, "own", path, partial(self._with_own_clicks, DEFAULT, path))
            yield reference
            clicks = ClickSequence.from_json(reference["placed"])
            if group.every_path:
                yield self._run(DEFAULT.name, "size step", path, partial(self._size_steps, clicks))
            if group.compared:
                yield from self._others(clicks, path, methods)
        if group.compared:
            yield from self._on_first_path(methods)
            for kind, counts in samples.items():
                measure = partial(self._on_true_samples, kind, counts)
                yield self._run(f"{kind} on 11 local features, true samples", "true samples", FIRST_PATH, measure)

    def failures(self, runs: Sequence[Run]) -> list[Failure]:
        """Pictures of the worst structures of the default method's first path, of all that was measured here."""
        reference = next(run for run in runs if run["clicks"] == "own" and run["method"] == DEFAULT.name)
        clicks = ClickSequence.from_json(reference["placed"]).at(self._rounds)
        return worst_structures(self._name, self._labelled, clicks, self._segmenter(DEFAULT)(self._labelled, clicks))

    def _others(self, clicks: ClickSequence, path: int, methods: Sequence[Method]) -> Iterator[Run]:
        for method in methods:
            if method is not DEFAULT and (method.every_path or path == FIRST_PATH):
                yield self._run(method.name, "same", path, partial(self._on_same_clicks, method, clicks))

    def _on_first_path(self, methods: Sequence[Method]) -> Iterator[Run]:
        for method in methods:
            if method is not DEFAULT and method.own_clicks:
                yield self._run(method.name, "own", FIRST_PATH, partial(self._with_own_clicks, method, FIRST_PATH))
        yield self._run(DEFAULT.name, "one by one", FIRST_PATH, self._one_by_one)
        yield self._run(DEFAULT.name, "single clicks", FIRST_PATH, self._single_clicks)

    def _run(self, method: str, clicks: str, path: int, measure: Callable[[], dict[str, Any]]) -> Run:
        name = f"accuracy, {self._name}, {method}, {clicks}, path {path}, {self._rounds} rounds"
        return {"case": self._name, "method": method, "clicks": clicks, "path": path, **self._kept.get(name, measure)}

    def _with_own_clicks(self, method: Method, path: int) -> dict[str, Any]:
        segment, aims = self._segmenter(method), persons_aims(path, len(self._labelled.names))
        rounds, sequence = run_with_own_clicks(self._labelled, segment, self._rounds, method.negatives, aims)
        return {"rounds": rounds, "placed": sequence.as_json()}

    def _size_steps(self, clicks: ClickSequence) -> dict[str, Any]:
        return {"rounds": run_size_steps(self._labelled, self._session, clicks, self._replayed)}

    def _on_same_clicks(self, method: Method, clicks: ClickSequence) -> dict[str, Any]:
        return {"rounds": run_on_clicks(self._labelled, self._segmenter(method), clicks, self._replayed)}

    def _one_by_one(self) -> dict[str, Any]:
        aims = persons_aims(FIRST_PATH, len(self._labelled.names))
        return {"rounds": run_one_by_one(self._labelled, self._segmenter(DEFAULT), self._rounds, aims)}

    def _single_clicks(self) -> dict[str, Any]:
        aims = persons_aims(FIRST_PATH, len(self._labelled.names))
        return {"changes": run_single_clicks(self._labelled, self._segmenter(DEFAULT), self._rounds, aims)}

    def _on_true_samples(self, kind: ClassifierKind, counts: Sequence[int]) -> dict[str, Any]:
        return {"rounds": run_on_true_samples(self._labelled, kind, counts)}

    def _segmenter(self, method: Method) -> Segment:
        return method.segmenter(self._labelled.volume, self._features)

    @cached_property
    def _session(self) -> SegmentationSession:
        return session_on(self._labelled.volume, self._features)

    @cached_property
    def _features(self) -> FeatureVolume:
        # Only where something is left to be measured.
        return load_features(self._labelled.volume, self._weights, self._preset)
