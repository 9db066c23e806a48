"""Accuracy by number of clicks: `python dev.py bench accuracy --volumes DIR [--weights PATH]`.

A simulated clicker annotates the structures of a labelled volume, all together and one by one, and corrects the largest error
in each round (`simulated_clicker`). Nothing is tuned by structure or volume, and no label is read but by the clicker, by the
metrics, and in favour of the baselines (`seeds`).

Which error is corrected depends on the method. The figures to compare by are those on *the same clicks*: every method is given
the clicks that the default method's errors led to; one that takes no negative clicks leaves those out. What methods reach when
the clicker reacts to their own errors is measured as well, all structures together.

With `--keep`, what was measured is kept in a folder and not measured again, so that a run can be had in parts. Writes
`accuracy.json`, `accuracy.md` and `accuracy_iou.png`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from Benchmarks.accuracy.baseline_classifiers import ClassifierKind
from Benchmarks.accuracy.methods import DEFAULT, METHODS, TRUE_SAMPLES, Method
from Benchmarks.accuracy.report import write_report
from Benchmarks.accuracy.runs import Mode, run_on_clicks, run_on_true_samples, run_with_own_clicks
from Benchmarks.shared.arguments import cases_of, scan_parser, weights_of
from Benchmarks.shared.click_sequence import ClickSequence
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.labelled_cases import CASES, LabelledVolume
from Benchmarks.shared.machine import machine
from Benchmarks.shared.sessions import load_features
from Benchmarks.shared.simulated_clicker import MOST_CLICKS
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume

REPLAYED_ROUNDS: dict[Mode, tuple[int, ...]] = {"together": (1, 3, 5, 10), "one by one": (5,)}
"""The rounds at which methods are given the default method's clicks: some baselines take too long for every one."""


def main() -> None:
    """Run every method on every case, and write what was measured."""
    parser = scan_parser(__doc__, [case.name for case in CASES], cases=CASES)
    parser.add_argument("--methods", nargs="*", choices=[method.name for method in METHODS], help="only these and the default")
    parser.add_argument("--without-true-samples", action="store_true", help="no classifiers trained on thousands of voxels")
    parser.add_argument("--rounds", type=int, default=MOST_CLICKS, help=f"clicks for each structure (default {MOST_CLICKS})")
    options = parser.parse_args()
    weights = weights_of(options)
    methods = [method for method in METHODS if not options.methods or method.name in options.methods]
    samples = {} if options.without_true_samples else TRUE_SAMPLES
    runs: list[dict[str, Any]] = []
    for case in cases_of(options):
        labelled = case.read(options.volumes)
        bench = CaseBench(case.name, labelled, load_features(labelled.volume, weights), options.rounds, options.keep)
        runs += [*bench.on_clicks(methods), *bench.on_true_samples(samples)]
    write_report({"model": weights.model.name, "machine": machine(), "runs": runs}, options.results)


class CaseBench:
    """Everything that is measured on one labelled volume.

    Args:
        name: of the case.
        labelled: the volume and its truth.
        features: of the volume, which all methods share that use any.
        rounds: clicks for each structure.
        keep: folder for what was measured, if it is to be kept.
    """

    def __init__(self, name: str, labelled: LabelledVolume, features: FeatureVolume, rounds: int, keep: Path | None) -> None:
        self._name, self._labelled, self._features, self._rounds = name, labelled, features, rounds
        self._kept = KeptResults(keep)

    def on_clicks(self, methods: Sequence[Method]) -> Iterator[dict[str, Any]]:
        """The default method, all others on its clicks, and those on their own clicks that do not take too long."""
        others = [method for method in methods if method is not DEFAULT]
        for mode in REPLAYED_ROUNDS:
            reference = self._run(DEFAULT.name, mode, "own", partial(self._with_own_clicks, DEFAULT, mode))
            yield reference
            clicks = ClickSequence.from_json(reference["placed"])
            for method in others if mode == "together" else [method for method in others if method.one_by_one]:
                yield self._run(method.name, mode, "same", partial(self._on_same_clicks, method, mode, clicks))
        for method in others:
            if method.own_clicks:
                yield self._run(method.name, "together", "own", partial(self._with_own_clicks, method, "together"))

    def on_true_samples(self, samples: dict[ClassifierKind, tuple[int, ...]]) -> Iterator[dict[str, Any]]:
        """Classifiers trained on so many voxels of every structure."""
        for kind, counts in samples.items():
            measure = partial(self._on_true_samples, kind, counts)
            yield self._run(f"{kind} on 11 local features, true samples", "together", "true samples", measure)

    def _run(self, method: str, mode: Mode, clicks: str, measure: partial[dict[str, Any]]) -> dict[str, Any]:
        what = {"case": self._name, "method": method, "mode": mode, "clicks": clicks}
        return {**what, **self._kept.get(", ".join(("accuracy", *what.values())), measure)}

    def _with_own_clicks(self, method: Method, mode: Mode) -> dict[str, Any]:
        segment = method.segmenter(self._labelled.volume, self._features)
        rounds, sequence = run_with_own_clicks(self._labelled, segment, mode, self._rounds, method.negatives)
        return {"rounds": rounds, "placed": sequence.as_json()}

    def _on_same_clicks(self, method: Method, mode: Mode, clicks: ClickSequence) -> dict[str, Any]:
        segment = method.segmenter(self._labelled.volume, self._features)
        numbers = [number for number in REPLAYED_ROUNDS[mode] if number <= self._rounds]
        return {"rounds": run_on_clicks(self._labelled, segment, mode, clicks, numbers)}

    def _on_true_samples(self, kind: ClassifierKind, counts: Sequence[int]) -> dict[str, Any]:
        return {"rounds": run_on_true_samples(self._labelled, kind, counts)}


if __name__ == "__main__":
    main()
