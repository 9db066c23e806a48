"""Accuracy by number of clicks: `python dev.py bench accuracy --volumes DIR [--weights PATH] [--paths N] [--cases NAME …]`.

A simulated user annotates the structures of a labelled volume together: clicks anywhere in the inner half of each, then on the
largest error of each, about where it is deepest (`simulated_clicker`, `aim`). Of some volumes several such paths are taken,
each with its own seed, so that figures have a spread; `cases` has what is measured on which volume. Nothing is tuned by
structure or volume, and no label is read but by the clicker, by the metrics, and in favour of the baselines (`seeds`).

Which error is corrected depends on the method. The figures to compare by are those on *the same clicks*: every method is given
the clicks that the default method's errors led to; one that takes no negative clicks leaves those out. What the faster methods
reach when the clicker reacts to their own errors is measured as well.

With `--keep`, all that was measured is kept in a folder and not measured again, so that a run can be had in parts. Constants
that were chosen on some `--cases` are to be judged on the others. Writes `accuracy.json`, `accuracy.md`, `accuracy_iou.png`
and `accuracy_failures.png`; of another preset, `accuracy_fine.json` and so on.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from Benchmarks.accuracy.baseline_classifiers import ClassifierKind
from Benchmarks.accuracy.cases import ALL_CASES, CaseGroup, group_of
from Benchmarks.accuracy.earlier import read_earlier
from Benchmarks.accuracy.failures import Failure, worst_structures
from Benchmarks.accuracy.methods import DEFAULT, METHODS, TRUE_SAMPLES, Method, Segment
from Benchmarks.accuracy.report import write_report
from Benchmarks.accuracy.runs import run_on_clicks, run_on_true_samples, run_one_by_one, run_with_own_clicks
from Benchmarks.accuracy.single_clicks import run_single_clicks
from Benchmarks.accuracy.size_steps import run_size_steps
from Benchmarks.shared.aim import persons_aims
from Benchmarks.shared.arguments import scan_parser, weights_of
from Benchmarks.shared.click_sequence import ClickSequence
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.labelled_cases import LabelledVolume
from Benchmarks.shared.machine import machine
from Benchmarks.shared.other_cases import without_missing
from Benchmarks.shared.sessions import load_features, session_on
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession
from ViTTransferFunction.Logic.weights.sources import WeightsFile

PATHS = 5
ROUNDS = 5
REPLAYED_ROUNDS = (1, 3, 5, 10)
"""At which other methods are given the default's clicks, and steps of size are tried: every round would take too long."""
FIRST_PATH = 1

Run = dict[str, Any]


def main() -> None:
    """Measure on every case, and write what was measured."""
    options = _parser().parse_args()
    weights = weights_of(options)
    methods = [method for method in METHODS if options.methods is None or method.name in options.methods]
    samples = TRUE_SAMPLES if options.true_samples else {}
    runs: list[Run] = []
    failures: list[Failure] = []
    cases, missing = without_missing([case for case in ALL_CASES if case.name in options.cases], options.volumes)
    kept = KeptResults(options.keep and options.keep / options.preset)
    if missing:
        print(f"Not in {options.volumes}, and left out: {', '.join(missing)}. docs/RESULTS.md says where to get them.")
    for case in cases:
        bench = CaseBench(case.name, case.read(options.volumes), weights, options.preset, options.rounds, kept)
        of_case = list(bench.measure(group_of(case.name), options.paths, methods, samples))
        runs += of_case
        failures += bench.failures(of_case)
    report = {"model": weights.model.name, "machine": machine(), "preset": options.preset, "paths": options.paths, "runs": runs}
    write_report(report, failures, options.results, read_earlier(options.earlier) if options.earlier else {})


def _parser() -> argparse.ArgumentParser:
    parser = scan_parser(__doc__, [case.name for case in ALL_CASES], cases=ALL_CASES)
    parser.add_argument("--paths", type=int, default=PATHS, help=f"paths of clicks on a volume (default {PATHS})")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help=f"clicks for each structure (default {ROUNDS})")
    parser.add_argument("--preset", default=DEFAULT_PRESET, help="of the features")
    parser.add_argument("--methods", nargs="*", choices=[method.name for method in METHODS], help="only these and the default")
    parser.add_argument("--true-samples", action="store_true", help="also classifiers trained on thousands of voxels")
    parser.add_argument("--earlier", type=Path, help="accuracy.json of an earlier version, to be put beside this one's figures")
    return parser


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


if __name__ == "__main__":
    main()
