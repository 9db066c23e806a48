"""What a hint where to click next is worth: `python dev.py bench hints --volumes DIR [--weights PATH]`.

Three users annotate all structures together, from the same first clicks and with as many: one looks for the largest error
(`simulated_clicker`), one clicks where the session's hint says, on or off the structure as the truth is there, and one clicks
blindly somewhere on the structure (mean of several of these). Writes `hints.json` and `hints.md`.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np

from Benchmarks.accuracy.run import load_features
from Benchmarks.shared.arguments import scan_parser, weights_of
from Benchmarks.shared.labelled_cases import SCANS, LabelledVolume, classes_of
from Benchmarks.shared.report_tables import number, table
from Benchmarks.shared.segmentation_metrics import dice
from Benchmarks.shared.simulated_clicker import MOST_CLICKS, Click, Clicks, first_click, next_click
from ViTTransferFunction.Logic.core.atomic_file import replacing
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession

CASES = ("amos_0336", "torso_small")
BLIND_USERS = 3
REPORTED_CLICKS = (1, 2, 3, 5, 10)

Choose = Callable[[Clicks, int, np.ndarray], Click | None]
"""From all clicks, the index of a class, and the labels they led to: the next click for that class."""


def main() -> None:
    """Measure all users on every case, and write what was measured."""
    parser = scan_parser(__doc__, CASES)
    options = parser.parse_args()
    weights = weights_of(options)
    rows = []
    for case in SCANS:
        if case.name in options.cases:
            labelled = case.read(options.volumes)
            session = SegmentationSession(labelled.volume, PRESETS[DEFAULT_PRESET])
            session.use_features(load_features(labelled.volume, weights))
            rows += [{"case": case.name, **row} for row in HintBench(labelled, session).rows()]
    report = {"model": weights.model.name, "rows": rows}
    with replacing(options.results / "hints.json") as path:
        path.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    with replacing(options.results / "hints.md") as path:
        path.write_text(as_text(report), encoding="utf-8")
    print(as_text(report))


class HintBench:
    """All users on one labelled volume.

    Args:
        labelled: the volume and its truth.
        session: on that volume, with features.
    """

    def __init__(self, labelled: LabelledVolume, session: SegmentationSession) -> None:
        self._labelled, self._session = labelled, session

    def rows(self) -> list[dict[str, Any]]:
        """Mean Dice by number of clicks, for each kind of user."""
        blind = [self._dice_by_clicks(self._blindly(np.random.default_rng(seed))) for seed in range(BLIND_USERS)]
        return [
            {"user": "largest error", "dice": self._dice_by_clicks(self._at_largest_error)},
            {"user": "hint", "dice": self._dice_by_clicks(self._at_hint)},
            {"user": "blind", "dice": np.mean(blind, axis=0).tolist()},
        ]

    def _dice_by_clicks(self, choose: Choose) -> list[float]:
        truth, names = self._labelled.truth, self._labelled.names
        clicks: Clicks = [[first_click(truth == label, self._labelled.spacing_mm)] for label in range(1, len(names) + 1)]
        means = []
        for _ in range(MOST_CLICKS):
            labels = self._session.segment(classes_of(names, clicks, self._labelled.volume.geometry)).labels
            means.append(float(np.mean([dice(labels == label, truth == label) for label in range(1, len(names) + 1)])))
            for of_class, click in zip(clicks, [choose(clicks, index, labels) for index in range(len(names))], strict=True):
                of_class += [click] if click else []
        return means

    def _at_largest_error(self, clicks: Clicks, index: int, labels: np.ndarray) -> Click | None:
        return next_click(labels == index + 1, self._labelled.truth == index + 1, self._labelled.spacing_mm)

    def _at_hint(self, clicks: Clicks, index: int, labels: np.ndarray) -> Click:
        geometry = self._labelled.volume.geometry
        classes = classes_of(self._labelled.names, clicks, geometry)
        hint = self._session.click_hint(self._session.low_resolution_maps(classes)[index], classes)
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
    intro = f"Features of {report['model']}, default preset. Mean Dice over the structures after so many clicks each."
    return f"# Where to click next\n\n{intro}\n\n{table(header, rows)}\n"


if __name__ == "__main__":
    main()
