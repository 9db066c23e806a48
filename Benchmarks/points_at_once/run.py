"""What points are worth that are placed all at once: `python dev.py bench points_at_once --volumes DIR [--cases NAME …]`.

Each structure of a scan gets 1, 3 or 5 points inside it, and none outside, without a look at the result in between: at its
deepest places (`deep_points`). On the same scans, `bench gestures` measures what as many clicks reach if each corrects what is
wrong. What lies in DIR as `NAME.seg.nrrd` with its scan is measured as well, as in `bench own_scans`. With `--keep`, what was
measured is kept in a folder and not measured again. Writes `points_at_once.json` and `points_at_once.md`.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from Benchmarks.accuracy.cases import ALL_CASES, EVERY_PATH_CASES
from Benchmarks.accuracy.methods import DEFAULT
from Benchmarks.accuracy.runs import Rounds, run_on_clicks
from Benchmarks.accuracy.size_steps import run_size_steps
from Benchmarks.own_scans.own_scan import asked_and_own
from Benchmarks.points_at_once.deep_points import deep_points
from Benchmarks.points_at_once.report import ALONE, COUNTS, STEPPED, write_report
from Benchmarks.shared.arguments import scan_parser, weights_of
from Benchmarks.shared.click_sequence import ClickSequence
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.labelled_cases import LabelledCase, LabelledVolume
from Benchmarks.shared.machine import machine
from Benchmarks.shared.sessions import load_features, session_on
from Benchmarks.shared.simulated_clicker import Click
from ViTTransferFunction.Logic.weights.sources import WeightsFile

Run = dict[str, Any]


def main() -> None:
    """Measure on every case, and write what was measured."""
    options = scan_parser(__doc__, EVERY_PATH_CASES, cases=ALL_CASES).parse_args()
    cases = asked_and_own(ALL_CASES, options)
    weights = weights_of(options)
    kept = KeptResults(options.keep)
    runs: list[Run] = []
    for case in cases:
        found = kept.get(f"points at once, {case.name}", partial(measured, case, options.volumes, weights))
        runs += [{"case": case.name, "way": way, "rounds": rounds} for way, rounds in found.items()]
    write_report({"model": weights.model.name, "machine": machine()}, runs, options.results)


def measured(case: LabelledCase, folder: Path, weights: WeightsFile) -> dict[str, Rounds]:
    """Metrics of every structure by the number of points, by these alone and with one step of size."""
    labelled = case.read(folder)
    features, points = load_features(labelled.volume, weights), points_of(labelled)
    return {
        ALONE: run_on_clicks(labelled, DEFAULT.segmenter(labelled.volume, features), points, COUNTS),
        STEPPED: run_size_steps(labelled, session_on(labelled.volume, features), points, COUNTS),
    }


def points_of(labelled: LabelledVolume) -> ClickSequence:
    """The points of all structures; "round" n has n of each."""
    most, labels = max(COUNTS), range(1, len(labelled.names) + 1)
    places = [deep_points(labelled.truth == label, labelled.spacing_mm, most) for label in labels]
    clicks = tuple(tuple(Click(place, True) for place in of_structure) for of_structure in places)
    return ClickSequence(clicks, tuple((count,) * len(labels) for count in range(1, most + 1)))


if __name__ == "__main__":
    main()
