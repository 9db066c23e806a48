"""What a first gesture is worth: `python dev.py bench gestures --volumes DIR [--weights PATH] [--paths N] [--cases NAME …]`.

A simulated user annotates all structures of a scan together, on several paths, as in `bench accuracy`: by clicks alone, with
the longest diameter of each structure first, a line drawn across it, and with its outline in one slice first. Then come clicks
on what is wrong. Each way has clicks of its own, which correct its own errors. What lies in DIR as `NAME.seg.nrrd` with its
scan is measured as well, as in `bench own_scans`.

A person draws diameters and outlines where they see that a structure is compact; here, every structure gets them. With
`--keep`, what was measured is kept in a folder and not measured again. Writes `gestures.json` and `gestures.md`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from functools import cached_property, partial
from typing import Any

from Benchmarks.accuracy.cases import ALL_CASES, EVERY_PATH_CASES
from Benchmarks.accuracy.methods import DEFAULT
from Benchmarks.accuracy.runs import run_with_own_clicks
from Benchmarks.gestures.report import CLICKS, DIAMETER, WAYS, write_report
from Benchmarks.own_scans.own_scan import asked_and_own
from Benchmarks.shared.aim import Aim, persons_aims
from Benchmarks.shared.arguments import scan_parser, weights_of
from Benchmarks.shared.drawn_gestures import drawn_diameter, drawn_outline
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.labelled_cases import LabelledVolume
from Benchmarks.shared.machine import machine
from Benchmarks.shared.sessions import load_features
from Benchmarks.shared.simulated_clicker import Gesture, first_click
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET
from ViTTransferFunction.Logic.weights.sources import WeightsFile

PATHS = 3
FIRST_PATH = 1
ROUNDS = 5

Run = dict[str, Any]


def main() -> None:
    """Measure on every case, and write what was measured."""
    options = _parser().parse_args()
    cases = asked_and_own(ALL_CASES, options)
    weights = weights_of(options)
    runs: list[Run] = []
    for case in cases:
        bench = CaseBench(case.name, case.read(options.volumes), weights, KeptResults(options.keep))
        runs += bench.measure(options.paths)
    report = {"model": weights.model.name, "machine": machine(), "paths": options.paths}
    write_report(report, runs, options.results)


def _parser() -> argparse.ArgumentParser:
    parser = scan_parser(__doc__, EVERY_PATH_CASES, cases=ALL_CASES)
    parser.add_argument("--paths", type=int, default=PATHS, help=f"paths of clicks on a volume (default {PATHS})")
    return parser


class CaseBench:
    """All ways on one labelled volume.

    Args:
        name: of the case.
        labelled: the volume and its truth.
        weights: what its features are computed with.
        kept: what was measured already.
    """

    def __init__(self, name: str, labelled: LabelledVolume, weights: WeightsFile, kept: KeptResults) -> None:
        self._name, self._labelled, self._weights, self._kept = name, labelled, weights, kept

    def measure(self, paths: int) -> Iterator[Run]:
        """A run of each way on each path."""
        for path in range(FIRST_PATH, FIRST_PATH + paths):
            for way in WAYS:
                name = f"gestures, {self._name}, {way}, path {path}, {ROUNDS} rounds"
                yield {"case": self._name, "way": way, "path": path, **self._kept.get(name, partial(self._run, way, path))}

    def _run(self, way: str, path: int) -> dict[str, Any]:
        labelled = self._labelled
        segment, aims = DEFAULT.segmenter(labelled.volume, self._features), persons_aims(path, len(labelled.names))
        begun_by = None if way == CLICKS else [[self._drawn(way, path, label, aim)] for label, aim in enumerate(aims, start=1)]
        rounds, _ = run_with_own_clicks(labelled, segment, ROUNDS, True, aims, begun_by)
        return {"rounds": rounds}

    def _drawn(self, way: str, path: int, label: int, aim: Aim) -> Gesture:
        """The first gesture on a structure; a click where there is no such gesture."""
        structure, spacing_mm = self._labelled.truth == label, self._labelled.spacing_mm
        if way == DIAMETER:
            return drawn_diameter(structure, spacing_mm, path, label)
        return drawn_outline(structure, spacing_mm, path, label) or [first_click(structure, spacing_mm, aim)]

    @cached_property
    def _features(self) -> FeatureVolume:
        return load_features(self._labelled.volume, self._weights, DEFAULT_PRESET)


if __name__ == "__main__":
    main()
