"""What a hint where to click next is worth: `python dev.py bench hints --volumes DIR [--weights PATH]`.

Three users annotate all structures together, from the same first clicks and with as many: one looks for the largest error
(`simulated_clicker`), one clicks where the hint says (`click_hint`), on or off the structure as the truth is there, and one
clicks blindly somewhere on the structure (mean of several of these). Writes `hints.json` and `hints.md`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from Benchmarks.hints.click_hint import click_hint
from Benchmarks.shared.arguments import scan_parser, scans_of, weights_of
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.labelled_cases import LabelledVolume, classes_of
from Benchmarks.shared.machine import in_words, machine
from Benchmarks.shared.report_files import write_results
from Benchmarks.shared.report_tables import number, paragraphs, table
from Benchmarks.shared.segmentation_metrics import mean_dice
from Benchmarks.shared.sessions import labels_of, load_features, session_on
from Benchmarks.shared.simulated_clicker import MOST_CLICKS, Click, Clicks, first_click, next_click
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession

CASES = ("amos_0336", "torso_small")
BLIND_USERS = 3
REPORTED_CLICKS = (1, 2, 3, 5, 10)

Choose = Callable[[Clicks, int, np.ndarray], Click | None]
"""From all clicks, the index of a class, and the labels they led to: the next click for that class."""


def main() -> None:
    """Measure all users on every case, and write what was measured."""
    options = scan_parser(__doc__, CASES).parse_args()
    weights, kept = weights_of(options), KeptResults(options.keep)
    rows: list[dict[str, Any]] = []
    for case in scans_of(options):
        labelled = case.read(options.volumes)
        bench = HintBench(labelled, session_on(labelled.volume, load_features(labelled.volume, weights)))
        rows += [{"case": case.name, **row} for row in kept.get(f"hints, {case.name}", bench.measure)["users"]]
    report = {"model": weights.model.name, "machine": machine(), "rows": rows}
    write_results(options.results, "hints", report, as_text(report))


class HintBench:
    """All users on one labelled volume.

    Args:
        labelled: the volume and its truth.
        session: on that volume, with features.
    """

    def __init__(self, labelled: LabelledVolume, session: SegmentationSession) -> None:
        self._labelled, self._session = labelled, session

    def measure(self) -> dict[str, Any]:
        """Mean Dice by number of clicks, for each kind of user, in `users`."""
        blind = [self._dice_by_clicks(self._blindly(np.random.default_rng(seed))) for seed in range(BLIND_USERS)]
        return {
            "users": [
                {"user": "largest error", "dice": self._dice_by_clicks(self._at_largest_error)},
                {"user": "hint", "dice": self._dice_by_clicks(self._at_hint)},
                {"user": "blind", "dice": np.mean(blind, axis=0).tolist()},
            ]
        }

    def _dice_by_clicks(self, choose: Choose) -> list[float]:
        truth, count = self._labelled.truth, len(self._labelled.names)
        clicks: Clicks = [[first_click(truth == label, self._labelled.spacing_mm)] for label in range(1, count + 1)]
        means = []
        for _ in range(MOST_CLICKS):
            labels = labels_of(self._session, self._labelled, clicks)
            means.append(mean_dice(labels, truth, count))
            for of_class, click in zip(clicks, [choose(clicks, index, labels) for index in range(count)], strict=True):
                of_class += [click] if click else []
        return means

    def _at_largest_error(self, clicks: Clicks, index: int, labels: np.ndarray) -> Click | None:
        return next_click(labels == index + 1, self._labelled.truth == index + 1, self._labelled.spacing_mm)

    def _at_hint(self, clicks: Clicks, index: int, labels: np.ndarray) -> Click:
        geometry = self._labelled.volume.geometry
        classes = classes_of(self._labelled.names, clicks, geometry)
        coarse = self._session.low_resolution_maps(classes)[index]
        hint = click_hint(coarse.array, coarse.iso, self._session.features.geometry, classes)
        kji = np.clip(np.round(geometry.ras_to_ijk(hint)[0, ::-1]).astype(int), 0, np.array(geometry.shape) - 1)
        return self._click_at(kji, index)

    def _blindly(self, generator: np.random.Generator) -> Choose:
        def choose(clicks: Clicks, index: int, labels: np.ndarray) -> Click:
            inside = np.flatnonzero(self._labelled.truth == index + 1)
            return self._click_at(np.array(np.unravel_index(generator.choice(inside), labels.shape)), index)

        return choose

    def _click_at(self, kji: np.ndarray, index: int) -> Click:
        k, j, i = (int(value) for value in kji)
        return Click((k, j, i), positive=bool(self._labelled.truth[k, j, i] == index + 1))


def as_text(report: dict[str, Any]) -> str:
    """The report for people."""
    rows = [
        [
            row["case"],
            row["user"],
            *(number(row["dice"][clicks - 1]) for clicks in REPORTED_CLICKS),
            number(np.mean(row["dice"])),
        ]
        for row in report["rows"]
    ]
    header = ["volume", "user clicks at", *(f"@{clicks}" for clicks in REPORTED_CLICKS), f"mean of 1 to {MOST_CLICKS}"]
    intro = (
        f"Features of {report['model']}, default preset. {in_words(report['machine'])}. Command: `python dev.py bench hints`. "
        "Mean Dice over the structures after so many clicks each."
    )
    return paragraphs("# Where to click next", intro, table(header, rows))


if __name__ == "__main__":
    main()
