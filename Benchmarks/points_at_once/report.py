"""What points are worth that are placed all at once: figures as JSON and as tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from Benchmarks.accuracy.figures import names_of
from Benchmarks.accuracy.runs import DIGITS
from Benchmarks.accuracy.summary import single_runs
from Benchmarks.shared.machine import in_words
from Benchmarks.shared.report_files import write_results
from Benchmarks.shared.report_tables import number, paragraphs, table

ALONE, STEPPED = "points alone", "with one size step"
WAYS = (ALONE, STEPPED)
COUNTS = (1, 3, 5)
"""How many points each structure gets."""
COLUMNS = [(way, str(count)) for way in WAYS for count in COUNTS]
HEADER = [f"{way}: {count}" for way, count in COLUMNS]

HOW_TO_READ = """\
Mean Dice over the structures of a scan, each of which gets so many points inside and none outside, at deep places that are not
near each other. *With one size step*: each structure may be made smaller or larger once, where that is better."""

Run = dict[str, Any]


def write_report(report: dict[str, Any], runs: Sequence[Run], folder: Path) -> None:
    """Write points_at_once.json and points_at_once.md."""
    figures = {**report, "summary": summary(runs), "runs": single_runs(runs)}
    write_results(folder, "points_at_once", figures, text(report, runs))


def summary(runs: Sequence[Run]) -> dict[str, Any]:
    """The figures that are tracked, by way and number of points: the mean of all cases, and of each case."""
    cases = names_of(runs, "case")
    return {
        "mean": {way: {str(n): round(_of_all(runs, cases, way, str(n)), DIGITS) for n in COUNTS} for way in WAYS},
        "cases": {
            case: {way: {str(n): round(_of_case(runs, case, way, str(n)), DIGITS) for n in COUNTS} for way in WAYS}
            for case in cases
        },
    }


def text(report: dict[str, Any], runs: Sequence[Run]) -> str:
    """For people."""
    cases = names_of(runs, "case")
    rows = [[case, *(number(_of_case(runs, case, *column)) for column in COLUMNS)] for case in cases]
    of_all = [f"mean of the {len(cases)}", *(number(_of_all(runs, cases, *column)) for column in COLUMNS)]
    return paragraphs(
        "# Points placed at once",
        f"Features of {report['model']}, default preset. {in_words(report['machine'])}. "
        "Command: `python dev.py bench points_at_once --volumes DIR`.",
        HOW_TO_READ,
        table(["volume", *HEADER], [*rows, of_all]),
        "## Each structure",
        _structures(runs, cases),
    )


def _structures(runs: Sequence[Run], cases: Sequence[str]) -> str:
    rows = []
    for case in cases:
        rows.append([f"**{case}**", *[""] * len(HEADER)])
        rows += [
            [name, *(number(_dice(runs, case, *column)[name]) for column in COLUMNS)] for name in _dice(runs, case, *COLUMNS[0])
        ]
    return table(["structure", *HEADER], rows)


def _of_all(runs: Sequence[Run], cases: Sequence[str], way: str, count: str) -> float:
    return float(np.mean([_of_case(runs, case, way, count) for case in cases]))


def _of_case(runs: Sequence[Run], case: str, way: str, count: str) -> float:
    return float(np.mean(list(_dice(runs, case, way, count).values())))


def _dice(runs: Sequence[Run], case: str, way: str, count: str) -> dict[str, float]:
    """Of each structure of a case."""
    (run,) = (run for run in runs if (run["case"], run["way"]) == (case, way))
    return {name: metrics["dice"] for name, metrics in run["rounds"][count].items()}
