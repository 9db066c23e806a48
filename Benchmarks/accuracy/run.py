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
and `accuracy_failures.webp`; of another model or preset only the first two, with its name, as in `accuracy_fine.json`.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from Benchmarks.accuracy.case_bench import PATHS, ROUNDS, CaseBench
from Benchmarks.accuracy.cases import ALL_CASES, group_of
from Benchmarks.accuracy.earlier import read_earlier
from Benchmarks.accuracy.failures import Failure
from Benchmarks.accuracy.methods import METHODS, TRUE_SAMPLES
from Benchmarks.accuracy.report import write_report
from Benchmarks.shared.arguments import scan_parser, weights_of
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.machine import machine
from Benchmarks.shared.other_cases import cases_there
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET

Run = dict[str, Any]


def main() -> None:
    """Measure on every case, and write what was measured."""
    options = _parser().parse_args()
    weights = weights_of(options)
    methods = [method for method in METHODS if options.methods is None or method.name in options.methods]
    samples = TRUE_SAMPLES if options.true_samples else {}
    runs: list[Run] = []
    failures: list[Failure] = []
    kept = KeptResults(options.keep and options.keep / options.preset)
    for case in cases_there([case for case in ALL_CASES if case.name in options.cases], options.volumes):
        bench = CaseBench(case.name, case.read(options.volumes), weights, options.preset, options.rounds, kept)
        of_case = list(bench.measure(group_of(case.name), options.paths, methods, samples))
        runs += of_case
        failures += bench.failures(of_case)
    report = {
        "model": weights.model.name,
        "weights_sha256": weights.sha256,
        "machine": machine(),
        "preset": options.preset,
        "paths": options.paths,
        "runs": runs,
    }
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


if __name__ == "__main__":
    main()
