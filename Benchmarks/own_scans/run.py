"""Accuracy on labelled scans of your own: `python dev.py bench own_scans --volumes DIR [--weights PATH] [--paths N]`.

DIR holds scans, `NAME.nii.gz` or of another format that `vittf cohort` takes, and of each what is right, `NAME.seg.nrrd`, a
segmentation as Slicer saves it, whose segments do not overlap. A simulated user clicks on them as in `bench accuracy`. With
`--keep`, what was measured is kept in a folder and not measured again. Writes `own_scans.json` and `own_scans.md`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

from Benchmarks.accuracy.case_bench import PATHS, ROUNDS, CaseBench
from Benchmarks.accuracy.cases import CaseGroup
from Benchmarks.accuracy.report import CAPTION, CLICK_CAPTION, case_table, click_change_table, structure_table
from Benchmarks.accuracy.summary import single_runs, summary
from Benchmarks.own_scans.own_scan import own_scans
from Benchmarks.shared.arguments import network_parser, weights_of
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.machine import in_words, machine
from Benchmarks.shared.report_files import write_results
from Benchmarks.shared.report_tables import paragraphs
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET

Run = dict[str, Any]


def main() -> None:
    """Measure on every scan of the folder, and write what was measured."""
    options = _parser().parse_args()
    weights = weights_of(options)
    scans = own_scans(options.volumes)
    group = CaseGroup("Scans", tuple(scans), every_path=True)
    runs: list[Run] = []
    for scan in scans:
        bench = CaseBench(scan.name, scan.read(options.volumes), weights, DEFAULT_PRESET, ROUNDS, KeptResults(options.keep))
        runs += bench.measure(group, options.paths, (), {})
    report = {"model": weights.model.name, "machine": machine(), "paths": options.paths}
    figures = {**report, "summary": summary(runs), "runs": single_runs(runs)}
    write_results(options.results, "own_scans", figures, text(report, [scan.name for scan in scans], runs))


def text(report: dict[str, Any], scans: Sequence[str], runs: Sequence[Run]) -> str:
    """The report for people."""
    return paragraphs(
        "# Accuracy by clicks, on other scans",
        f"Features of {report['model']}, default preset, {report['paths']} paths of clicks. {in_words(report['machine'])}. "
        "Command: `python dev.py bench own_scans --volumes DIR`. Dice by structure, path and click is in `own_scans.json`.",
        CAPTION,
        *case_table("Scans", scans, runs),
        CLICK_CAPTION,
        click_change_table(runs),
        *(part for scan in scans for part in structure_table(runs, scan)),
    )


def _parser() -> argparse.ArgumentParser:
    parser = network_parser(__doc__)
    parser.add_argument("--paths", type=int, default=PATHS, help=f"paths of clicks on a volume (default {PATHS})")
    return parser


if __name__ == "__main__":
    main()
