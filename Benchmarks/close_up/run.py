"""What close-ups are worth: `python dev.py bench close_up --volumes DIR [--weights PATH] [--paths N …] [--cases NAME …]`.

A simulated user annotates all labelled structures of a scan together, on several paths of clicks, as in `bench accuracy`. Once
by the whole scan alone; and once as a user who, as soon as the first clicks are answered, presses "Look closer" on every
structure that they would call small or thin (`who_presses`), where the box is not refused as too large. Boxes are not fitted
again. Round 1 is measured after the presses. Each way has clicks of its own, which correct its own errors; the first click is
the same.

Left out: users who press later, or again, or where it does not help. With `--keep`, all that was measured is kept in a folder
and not measured again. Writes `close_up.json` and `close_up.md`.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from Benchmarks.accuracy.runs import run_with_own_clicks
from Benchmarks.close_up.looking_user import LookingUser
from Benchmarks.close_up.report import CLOSE_UPS, WHOLE, write_report
from Benchmarks.close_up.who_presses import SMALL_ML, small_or_thin, volumes_ml
from Benchmarks.shared.aim import persons_aims
from Benchmarks.shared.arguments import scan_parser, weights_of
from Benchmarks.shared.every_structure import EVERY_STRUCTURE
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.labelled_cases import LabelledVolume
from Benchmarks.shared.machine import machine
from ViTTransferFunction.Logic.features.cache import FeatureCache
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Logic.weights.sources import WeightsFile

PATHS = 3
ROUNDS = 5

Run = dict[str, Any]


def main() -> None:
    """Measure on every case, and write what was measured."""
    options = _options()
    weights = weights_of(options)
    paths = dict(zip(options.cases, options.paths, strict=True))
    cases = {case.name: case for case in EVERY_STRUCTURE}
    runs: list[Run] = []
    structures: dict[str, dict[str, float]] = {}
    for name in SMALL_ML:
        if name in options.cases:
            labelled = cases[name].read(options.volumes)
            runs += CaseBench(name, labelled, weights, KeptResults(options.keep)).measure(paths[name])
            structures[name] = {structure: round(ml, 1) for structure, ml in volumes_ml(labelled)}
    write_report({"model": weights.model.name, "machine": machine(), "millilitres": structures, "runs": runs}, options.results)


def _options() -> argparse.Namespace:
    """What the command line says; `paths` has a number for each of `cases`."""
    parser = scan_parser(__doc__, list(SMALL_ML), cases=EVERY_STRUCTURE)
    parser.add_argument(
        "--paths", nargs="+", type=int, default=[PATHS], help=f"paths of clicks, or so many for each case (default {PATHS})"
    )
    options = parser.parse_args()
    if len(options.paths) == 1:
        options.paths *= len(options.cases)
    if len(options.paths) != len(options.cases):
        parser.error(f"--paths has {len(options.paths)} numbers for {len(options.cases)} cases; give one, or one for each")
    return options


class CaseBench:
    """Both ways on one labelled volume.

    Args:
        name: of the case.
        labelled: the volume and its truth.
        weights: what features are computed with.
        kept: what was measured already.
    """

    def __init__(self, name: str, labelled: LabelledVolume, weights: WeightsFile, kept: KeptResults) -> None:
        self._name, self._labelled, self._weights, self._kept = name, labelled, weights, kept

    def measure(self, paths: int) -> Iterator[Run]:
        """A run of each way on each path."""
        for path in range(1, paths + 1):
            for way, presses in ((WHOLE, ()), (CLOSE_UPS, self._small_or_thin)):
                name = f"close-ups, {self._name}, {way}, path {path}, {ROUNDS} rounds"
                measured = self._kept.get(name, partial(self._run, path, presses))
                yield {"case": self._name, "way": way, "path": path, **measured}

    def _run(self, path: int, presses: tuple[str, ...]) -> dict[str, Any]:
        settings = SessionSettings(model=self._weights.model.name, weights_path=str(self._weights.path))
        # Features that are there already would be had at once, and seconds would say nothing.
        with tempfile.TemporaryDirectory() as cache:
            session = open_session(self._labelled.volume, settings, FeatureCache(Path(cache)))
            session.load_features()
            user = LookingUser(session, presses)
            aims = persons_aims(path, len(self._labelled.names))
            rounds, sequence = run_with_own_clicks(self._labelled, user, ROUNDS, True, aims)
        return {"rounds": rounds, "placed": sequence.as_json(), "presses": [asdict(press) for press in user.pressed]}

    @cached_property
    def _small_or_thin(self) -> tuple[str, ...]:
        return small_or_thin(self._labelled, SMALL_ML[self._name])


if __name__ == "__main__":
    main()
