"""What a first gesture is worth: the figures of all ways side by side, as JSON and as tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from Benchmarks.accuracy.figures import Spread, names_of, spread
from Benchmarks.accuracy.runs import DIGITS
from Benchmarks.accuracy.summary import single_runs
from Benchmarks.shared.machine import in_words
from Benchmarks.shared.report_files import write_results
from Benchmarks.shared.report_tables import number, paragraphs, table

CLICKS, DIAMETER, OUTLINE = "clicks", "diameter", "outline"
WAYS = (CLICKS, DIAMETER, OUTLINE)
GESTURES = ("1", "2", "3", "5")
"""After how many of them."""
COLUMNS = [(way, count) for count in GESTURES for way in WAYS]
HEADER = [f"{way} @{count}" for way, count in COLUMNS]

HOW_TO_READ = """\
Mean Dice over the structures ± standard deviation between the paths, after so many gestures on every structure. *Clicks*: each
gesture is a click. *Diameter*: the first one is the longest line that does not leave the structure, in a slice that shows
nearly as much of it as any, drawn with a hand that errs by 1.5 mm; the others are clicks on what is wrong then. *Outline*: the
first one goes around the structure in such a slice, with the same hand. Every structure gets one, also tubes and what is
branched, where a person would rather click; only what has a hole in that slice, as a ring has, is not outlined but clicked."""

Run = dict[str, Any]


def write_report(report: dict[str, Any], runs: Sequence[Run], folder: Path) -> None:
    """Write gestures.json and gestures.md."""
    write_results(folder, "gestures", {**report, "summary": summary(runs), "runs": single_runs(runs)}, text(report, runs))


def summary(runs: Sequence[Run]) -> dict[str, Any]:
    """The figures that are tracked, by way and number of gestures: the mean of all cases; of each case, mean and its spread."""
    cases = names_of(runs, "case")
    return {
        "mean": {way: {count: round(_of_all(runs, cases, way, count), DIGITS) for count in GESTURES} for way in WAYS},
        "cases": {
            case: {way: {count: _of_case(runs, case, way, count).pair for count in GESTURES} for way in WAYS} for case in cases
        },
    }


def text(report: dict[str, Any], runs: Sequence[Run]) -> str:
    """For people."""
    cases = names_of(runs, "case")
    return paragraphs(
        "# First gestures",
        f"Features of {report['model']}, default preset, {report['paths']} paths. {in_words(report['machine'])}. "
        "Command: `python dev.py bench gestures --volumes DIR`. Each path by itself is in `gestures.json`.",
        HOW_TO_READ,
        _means(runs, cases),
        "## Each structure",
        _structures(runs, cases),
    )


def _means(runs: Sequence[Run], cases: Sequence[str]) -> str:
    rows = [[case, *(str(_of_case(runs, case, *column)) for column in COLUMNS)] for case in cases]
    of_all = [f"mean of the {len(cases)}", *(number(_of_all(runs, cases, *column)) for column in COLUMNS)]
    return table(["volume", *HEADER], [*rows, of_all])


def _structures(runs: Sequence[Run], cases: Sequence[str]) -> str:
    rows = []
    for case in cases:
        rows.append([f"**{case}**", *[""] * len(HEADER)])
        rows += [
            [name, *(number(_of_structure(runs, case, name, *column)) for column in COLUMNS)]
            for name in _runs_of(runs, case, CLICKS)[0]["rounds"]["1"]
        ]
    return table(["structure", *HEADER], rows)


def _of_all(runs: Sequence[Run], cases: Sequence[str], way: str, count: str) -> float:
    return float(np.mean([_of_case(runs, case, way, count).mean for case in cases]))


def _of_case(runs: Sequence[Run], case: str, way: str, count: str) -> Spread:
    of_paths = [run["rounds"][count].values() for run in _runs_of(runs, case, way)]
    return spread([float(np.mean([metrics["dice"] for metrics in structures])) for structures in of_paths])


def _of_structure(runs: Sequence[Run], case: str, name: str, way: str, count: str) -> float:
    return float(np.mean([run["rounds"][count][name]["dice"] for run in _runs_of(runs, case, way)]))


def _runs_of(runs: Sequence[Run], case: str, way: str) -> list[Run]:
    return [run for run in runs if (run["case"], run["way"]) == (case, way)]
