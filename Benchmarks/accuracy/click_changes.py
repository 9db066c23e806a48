"""What one more click changed: whether a click never hurts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from Benchmarks.accuracy.methods import DEFAULT
from Benchmarks.accuracy.runs import DIGITS

LOSS = 0.02
"""Dice that may be lost before a user would say so."""

Run = dict[str, Any]


@dataclass(frozen=True)
class ClickChange:
    """One click and what became of a structure.

    Attributes:
        where: the case, the structure and its number of clicks, in words.
        change: of the structure's Dice.
    """

    where: str
    change: float


@dataclass(frozen=True)
class ChangeSummary:
    """Many clicks.

    Attributes:
        count: how many.
        unhurt: share of them that lost no more than `LOSS`.
        worst: the one that lost most.
    """

    count: int
    unhurt: float
    worst: ClickChange


def summarised(changes: Iterable[ClickChange]) -> ChangeSummary | None:
    """None where there are no changes."""
    all_of_them = list(changes)
    if not all_of_them:
        return None
    unhurt = float(np.mean([change.change >= -LOSS for change in all_of_them]))
    return ChangeSummary(len(all_of_them), unhurt, min(all_of_them, key=lambda change: change.change))


def in_rounds(runs: Iterable[Run]) -> Iterator[ClickChange]:
    """Of every clicked structure from one round to the next, in which all structures are clicked."""
    for run in runs:
        if run["clicks"] == "own" and run["method"] == DEFAULT.name:
            rounds, counts = run["rounds"], run["placed"]["counts"]
            for number in range(1, len(rounds)):
                before, after = rounds[str(number)], rounds[str(number + 1)]
                for index, name in enumerate(before):
                    if counts[number][index] > counts[number - 1][index]:
                        where = f"{run['case']}, path {run['path']}: {name}, click {counts[number][index]}"
                        yield ClickChange(where, round(after[name]["dice"] - before[name]["dice"], DIGITS))


def of_the_clicked(runs: Iterable[Run]) -> Iterator[ClickChange]:
    """Of the structure that was clicked alone."""
    for run, click in _single_clicks(runs):
        yield ClickChange(f"{run['case']}: {click['structure']}, click {click['round']}", click["change"])


def of_the_others(runs: Iterable[Run]) -> Iterator[ClickChange]:
    """Of the structure that lost most when another was clicked alone: one for each click."""
    for run, click in _single_clicks(runs):
        if click["others"]:
            name, change = min(click["others"].items(), key=lambda item: item[1])
            yield ClickChange(f"{run['case']}: {name}, at click {click['round']} on {click['structure']}", change)


def _single_clicks(runs: Iterable[Run]) -> Iterator[tuple[Run, dict[str, Any]]]:
    for run in runs:
        if run["clicks"] == "single clicks":
            yield from ((run, click) for click in run["changes"])
