"""What close-ups are worth: `python dev.py bench close_up --volumes DIR [--weights PATH] [--paths N …] [--cases NAME …]`.

A simulated user annotates all labelled structures of a scan together, on several paths of clicks, as in `bench accuracy`. Once
by the whole scan alone; and once as a user who, as soon as the first clicks are answered, presses "Look closer" on every
structure that they would call small or thin (`who_presses`), where the box is not refused as too large. Boxes are not fitted
again. Round 1 is measured after the presses. Each way has clicks of its own, which correct its own errors; the first click is
the same. With `--times`, how long each close-up takes to be ready is measured as well, apart, at the first clicks of path 1:
only this needs the machine for itself.

Left out: users who press later, or again, or where it does not help. With `--keep`, all that was measured is kept in a folder
and not measured again. Writes `close_up.json` and `close_up.md`.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from Benchmarks.accuracy.runs import run_with_own_clicks
from Benchmarks.close_up.looking_user import LookingUser
from Benchmarks.close_up.report import CLOSE_UPS, WHOLE, write_report
from Benchmarks.close_up.who_presses import SMALL_ML, small_or_thin, volumes_ml
from Benchmarks.shared.aim import Aim, persons_aims
from Benchmarks.shared.arguments import scan_parser, weights_of
from Benchmarks.shared.every_structure import EVERY_STRUCTURE
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.labelled_cases import LabelledVolume
from Benchmarks.shared.machine import machine
from Benchmarks.shared.simulated_clicker import first_click
from ViTTransferFunction.Logic.features.cache import FeatureCache
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Logic.weights.sources import WeightsFile

PATHS = 3
FIRST_PATH = 1
ROUNDS = 5

Run = dict[str, Any]


def main() -> None:
    """Measure on every case, and write what was measured."""
    options = _options()
    weights = weights_of(options)
    paths = dict(zip(options.cases, options.paths, strict=True))
    cases = {case.name: case for case in EVERY_STRUCTURE}
    runs: list[Run] = []
    of_cases: dict[str, Any] = {}
    for name in SMALL_ML:
        if name in options.cases:
            labelled = cases[name].read(options.volumes)
            bench = CaseBench(name, labelled, weights, KeptResults(options.keep))
            of_cases[name] = {"millilitres": {structure: round(ml, 1) for structure, ml in volumes_ml(labelled)}}
            of_cases[name] |= bench.times() if options.times else {}
            runs += bench.measure(paths[name])
    write_report({"model": weights.model.name, "machine": machine(), "cases": of_cases, "runs": runs}, options.results)


def _options() -> argparse.Namespace:
    """What the command line says; `paths` has a number for each of `cases`."""
    parser = scan_parser(__doc__, list(SMALL_ML), cases=EVERY_STRUCTURE)
    parser.add_argument(
        "--paths", nargs="+", type=int, default=[PATHS], help=f"paths of clicks, or so many for each case (default {PATHS})"
    )
    parser.add_argument("--times", action="store_true", help="also how long close-ups take; with nothing beside")
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
        for path in range(FIRST_PATH, FIRST_PATH + paths):
            for way, presses in ((WHOLE, ()), (CLOSE_UPS, self._small_or_thin)):
                name = f"close-ups, {self._name}, {way}, path {path}, {ROUNDS} rounds"
                measured = self._kept.get(name, partial(self._run, path, presses))
                yield {"case": self._name, "way": way, "path": path, **measured}

    def times(self) -> dict[str, Any]:
        """What each close-up took, in `timed`, and on which machine, in `timed_on`."""
        return self._kept.get(f"close-ups, {self._name}, seconds", self._times)

    def _run(self, path: int, presses: tuple[str, ...]) -> dict[str, Any]:
        with self._user(presses) as user:
            rounds, sequence = run_with_own_clicks(self._labelled, user, ROUNDS, True, self._aims(path))
        # What else ran meanwhile is in their seconds.
        pressed = [asdict(replace(press, seconds=None)) for press in user.pressed]
        return {"rounds": rounds, "placed": sequence.as_json(), "presses": pressed}

    def _times(self) -> dict[str, Any]:
        labelled = self._labelled
        aims = enumerate(self._aims(FIRST_PATH), start=1)
        clicks = [[first_click(labelled.truth == label, labelled.spacing_mm, aim)] for label, aim in aims]
        with self._user(self._small_or_thin) as user:
            user(labelled, clicks)
        return {"timed": [asdict(press) for press in user.pressed], "timed_on": machine()}

    @contextmanager
    def _user(self, presses: tuple[str, ...]) -> Iterator[LookingUser]:
        """Somebody who opens the volume for the first time: features that are there already would be had at once."""
        settings = SessionSettings(model=self._weights.model.name, weights_path=str(self._weights.path))
        with tempfile.TemporaryDirectory() as cache:
            session = open_session(self._labelled.volume, settings, FeatureCache(Path(cache)))
            session.load_features()
            yield LookingUser(session, presses)

    def _aims(self, path: int) -> list[Aim]:
        return persons_aims(path, len(self._labelled.names))

    @cached_property
    def _small_or_thin(self) -> tuple[str, ...]:
        return small_or_thin(self._labelled, SMALL_ML[self._name])


if __name__ == "__main__":
    main()
