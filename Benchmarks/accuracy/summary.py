"""The figures of a report for programs: means and spreads by case, column, number of clicks and structure; and single runs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

from Benchmarks.accuracy.click_changes import ClickChange, in_rounds, of_the_clicked, of_the_others, summarised
from Benchmarks.accuracy.comparison import methods_on
from Benchmarks.accuracy.figures import COLUMNS, Figures, Spread, column_of, figures_of, names_of
from Benchmarks.accuracy.goals import goals_reached

Run = dict[str, Any]
Pair = list[float | None]
"""Mean, and standard deviation between the paths; None for one path."""


def summary(runs: Sequence[Run]) -> dict[str, Any]:
    """All but single paths, and metrics that no table has."""
    cases = names_of(runs, "case")
    return {
        "cases": {case: _columns(runs, case) for case in cases},
        "methods": {case: {name: _dice(f) for name, f in methods_on(runs, case).items()} for case in cases},
        "own_clicks": {case: _own_clicks(runs, case) for case in cases},
        "one_by_one": {case: _dice(figures_of(runs, case, kind="one by one")) for case in cases},
        "click_changes": {
            "in_rounds": {case: _changes(in_rounds(run for run in runs if run["case"] == case)) for case in cases},
            "in_all_rounds": _changes(in_rounds(runs)),
            "clicked": _changes(of_the_clicked(runs)),
            "others": _changes(of_the_others(runs)),
        },
        "goals": [{**asdict(goal), "is_reached": goal.is_reached} for goal in goals_reached(runs)],
    }


def single_runs(runs: Sequence[Run]) -> list[Run]:
    """Each run by itself: the Dice of its structures, in order, by number of clicks; or its changes by single clicks."""
    short = []
    for run in runs:
        what = {key: value for key, value in run.items() if key not in ("rounds", "placed")}
        if "rounds" in run:
            by_clicks = run["rounds"]
            what["structures"] = list(next(iter(by_clicks.values())))
            what["dice"] = {clicks: [m["dice"] for m in metrics.values()] for clicks, metrics in by_clicks.items()}
        short.append(what)
    return short


def _columns(runs: Sequence[Run], case: str) -> dict[str, Any]:
    columns = {column: column_of(runs, case, column) for column in COLUMNS}
    return {
        column: {
            clicks: {
                "paths": len(figures.paths),
                "dice": _pair(figures.mean(clicks)),
                "surface_dice": _pair(figures.mean(clicks, "surface_dice")),
                "structures": {name: _pair(figures.structure(name, clicks)) for name in figures.structures},
            }
            for clicks in figures.clicks
        }
        for column, figures in columns.items()
    }


def _own_clicks(runs: Sequence[Run], case: str) -> dict[str, Any]:
    return {name: _dice(figures_of(runs, case, name)) for name in methods_on(runs, case)}


def _dice(figures: Figures) -> dict[str, Any]:
    return {clicks: _pair(figures.mean(clicks)) for clicks in figures.clicks}


def _pair(found: Spread | None) -> Pair:
    return [None, None] if found is None else found.pair


def _changes(changes: Iterable[ClickChange]) -> dict[str, Any] | None:
    found = summarised(changes)
    return asdict(found) if found else None
