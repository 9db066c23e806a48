"""What a close-up is worth that begins by itself: both ways of each small outline, as JSON and as tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from Benchmarks.accuracy.click_changes import LOSS
from Benchmarks.accuracy.figures import names_of
from Benchmarks.shared.machine import in_words
from Benchmarks.shared.report_files import write_results
from Benchmarks.shared.report_tables import number, paragraphs, table
from ViTTransferFunction.Logic.core.classes.small_outlines import LEAST_AGREEMENT

WHOLE, CLOSELY = "whole scan", "looked at closely"
WAYS = (WHOLE, CLOSELY)
MUCH, LITTLE = "much", "little"
SLICES = (MUCH, LITTLE)
"""What the outline's slice shows of the structure."""
GESTURES = ("1", "2", "3")
LAST = GESTURES[-1]

HOW_TO_READ = f"""\
Mean Dice after the outline (@1), and after one and two clicks more; each structure counts once on each path. *Begins*: in the
whole scan, the structure agrees with its outline to less than {LEAST_AGREEMENT} (Dice in the outline's slice), so that panel,
app and `vittf` look closer unasked. *Stays*: it agrees better, and they stay in the whole scan; the figures with a close-up are
what they would have there. *Lost*: the share whose Dice @{LAST} is more than {LOSS} lower with a close-up."""

Run = dict[str, Any]
Chosen = Callable[[Run], bool]
RULE: dict[str, Chosen] = {
    "begins": lambda run: run["agreement"] < LEAST_AGREEMENT,
    "stays": lambda run: run["agreement"] >= LEAST_AGREEMENT,
}


def write_report(report: dict[str, Any], folder: Path) -> None:
    """Write small_structures.json and small_structures.md."""
    write_results(folder, "small_structures", {**report, "summary": summary(report["runs"])}, text(report))


def summary(runs: Sequence[Run]) -> dict[str, Any]:
    """The figures that are tracked: by what the slice shows and what is done, of all cases and of each."""
    return {shows: {done: _by_case(runs, shows, done) for done in RULE} for shows in SLICES}


def text(report: dict[str, Any]) -> str:
    """For people."""
    runs = report["runs"]
    return paragraphs(
        "# Small structures, by themselves",
        f"Features of {report['model']}, default preset, {report['paths']} paths. {in_words(report['machine'])}. "
        "Command: `python dev.py bench small_structures --volumes DIR`. Each outline by itself is in `small_structures.json`.",
        HOW_TO_READ,
        "## Outlined in a slice that shows much of the structure",
        _means(runs, MUCH),
        "## Outlined in a slice that shows a third of its largest area, or less",
        _means(runs, LITTLE),
        "## Each structure, in a slice that shows much of it",
        _structures(runs),
    )


def _means(runs: Sequence[Run], shows: str) -> str:
    rows = []
    for done in RULE:
        for case, figures in _by_case(runs, shows, done).items():
            means = [number(figures[way][count]) for way in WAYS for count in GESTURES]
            rows.append([done, case, figures["outlines"], *means, f"{figures['lost']:.0%}"])
    return table(["", "volume", "outlines", *(f"{way} @{count}" for way in WAYS for count in GESTURES), "lost"], rows)


def _structures(runs: Sequence[Run]) -> str:
    rows = []
    for run in runs:
        if run["slice"] == MUCH:
            dice = [number(run[way][count]) for way in WAYS for count in GESTURES]
            rows.append([run["case"], run["structure"], run["path"], number(run["agreement"], 2), *dice])
    return table(["volume", "structure", "path", "agreement", *(f"{way} @{count}" for way in WAYS for count in GESTURES)], rows)


def _by_case(runs: Sequence[Run], shows: str, done: str) -> dict[str, Any]:
    """The figures of each case that has such outlines, and of all together."""
    chosen = [run for run in runs if run["slice"] == shows and RULE[done](run)]
    of_cases = {case: [run for run in chosen if run["case"] == case] for case in names_of(chosen, "case")}
    return {name: _figures(of_one) for name, of_one in {**of_cases, "all": chosen}.items() if of_one}


def _figures(runs: Sequence[Run]) -> dict[str, Any]:
    changes = [run[CLOSELY][LAST] - run[WHOLE][LAST] for run in runs]
    means = {way: {count: round(float(np.mean([run[way][count] for run in runs])), 4) for count in GESTURES} for way in WAYS}
    return {"outlines": len(runs), **means, "lost": round(float(np.mean(np.array(changes) < -LOSS)), 4)}
