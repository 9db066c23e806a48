"""What the default method is to reach, and what it reaches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from Benchmarks.accuracy.click_changes import ChangeSummary, in_rounds, of_the_clicked, of_the_others, summarised
from Benchmarks.accuracy.comparison import leads
from Benchmarks.accuracy.figures import COLUMNS, column_of
from Benchmarks.shared.derived_cases import ORGAN_FILLING_CROPS
from Benchmarks.shared.labelled_cases import SCANS

Run = dict[str, Any]

ALONE, STEPPED = COLUMNS
CROPS = tuple(case.name for case in ORGAN_FILLING_CROPS)
FILLED, FILLING = zip(*((case.name, name) for case in ORGAN_FILLING_CROPS for name in case.filled_by), strict=True)
"""Crops, and what fills them, side by side."""
COMPARED = tuple(case.name for case in SCANS)


@dataclass(frozen=True)
class Reached:
    """A goal, and the figure that was measured for it.

    Attributes:
        goal: in words.
        least: what the figure is to reach.
        figure: mean over the paths.
        stepped: the same with one size step, where that was measured.
        note: on the figure.
    """

    goal: str
    least: float
    figure: float
    stepped: float | None = None
    note: str = ""

    @property
    def is_reached(self) -> bool:
        """By clicks alone."""
        return self.figure >= self.least


@dataclass(frozen=True)
class DiceGoal:
    """A mean Dice over cases.

    Attributes:
        words: what it is of.
        cases: names; all have to be measured.
        clicks: for each structure.
        least: to be reached.
        structures: the one that counts of each case, which may be there several times; empty: all of them.
        metric: instead of Dice.
    """

    words: str
    cases: tuple[str, ...]
    clicks: int
    least: float
    structures: tuple[str, ...] = ()
    metric: str = "dice"

    def figure(self, runs: Sequence[Run], column: str = ALONE) -> float | None:
        """Mean over the cases and paths; None where not all are measured."""
        figures = [column_of(runs, case, column) for case in self.cases]
        asked = str(self.clicks), self.metric
        if self.structures:
            found = [f.structure(name, *asked) for f, name in zip(figures, self.structures, strict=True)]
        else:
            found = [f.mean(*asked) for f in figures]
        measured = [mean.mean for mean in found if mean]
        return float(np.mean(measured)) if len(measured) == len(self.cases) else None


DICE_GOALS = (
    DiceGoal("amos_0336", ("amos_0336",), 1, 0.80),
    DiceGoal("amos_0336", ("amos_0336",), 5, 0.92),
    DiceGoal("torso_small", ("torso_small",), 1, 0.72),
    DiceGoal("torso_small", ("torso_small",), 5, 0.90),
    DiceGoal("brain", ("brain",), 5, 0.82),
    DiceGoal("organ-filling crops, all structures", CROPS, 3, 0.85),
    DiceGoal("organ-filling crops, the organs that fill them", FILLED, 3, 0.85, FILLING),
    DiceGoal("each lung of chest", ("chest", "chest"), 1, 0.85, ("right lung", "left lung")),
    DiceGoal("aorta of amos_0336", ("amos_0336",), 5, 0.85, ("aorta",)),
    DiceGoal("aorta of torso_small", ("torso_small",), 5, 0.85, ("aorta",)),
    DiceGoal("surface Dice at 2 mm of amos_0336", ("amos_0336",), 5, 0.75, metric="surface_dice"),
    DiceGoal("all structures of amos_0336", ("amos_0336 all",), 5, 0.75),
    DiceGoal("all structures of torso_small", ("torso_small all",), 5, 0.75),
)
STEP_GAIN = 0.04
UNHURT = 0.97
WORST_LOSS = 0.10


def goals_reached(runs: Sequence[Run]) -> list[Reached]:
    """All goals that there are figures for."""
    return [*_dice_goals(runs), *_step_gains(runs), *_leads(runs), *_harmless_clicks(runs)]


def _dice_goals(runs: Sequence[Run]) -> Iterator[Reached]:
    for goal in DICE_GOALS:
        figure = goal.figure(runs)
        if figure is not None:
            words = f"{goal.words} @{goal.clicks} ≥ {goal.least:.2f}"
            yield Reached(words, goal.least, figure, goal.figure(runs, STEPPED), _structures_below(goal, runs))


def _structures_below(goal: DiceGoal, runs: Sequence[Run]) -> str:
    """Which of many structures are below the least figure themselves."""
    if not goal.words.startswith("all structures"):
        return ""
    figures = column_of(runs, goal.cases[0], ALONE)
    dice = {name: figures.structure(name, str(goal.clicks)) for name in figures.structures}
    below = sorted((value.mean, name) for name, value in dice.items() if value and value.mean < goal.least)
    listed = ", ".join(f"{name} {mean:.2f}" for mean, name in below)
    return f"{len(below)} of {len(dice)} are below by themselves{': ' if below else ''}{listed}"


def _step_gains(runs: Sequence[Run]) -> Iterator[Reached]:
    for clicks in (1, 3):
        alone, stepped = (DiceGoal("", COMPARED, clicks, 0.0).figure(runs, column) for column in (ALONE, STEPPED))
        if alone is not None and stepped is not None:
            words = f"one size step gives ≥ {STEP_GAIN:.2f} more @{clicks}, mean of {', '.join(COMPARED)}"
            yield Reached(words, STEP_GAIN, stepped - alone)


def _leads(runs: Sequence[Run]) -> Iterator[Reached]:
    found = list(leads(runs))
    if found:
        smallest, behind = min(found), sum(lead.difference < 0.0 for lead in found)
        note = f"{smallest.where}; {behind} of {len(found)} structures and numbers of clicks behind"
        yield Reached("no structure behind its best baseline", 0.0, smallest.difference, note=note)


def _harmless_clicks(runs: Sequence[Run]) -> Iterator[Reached]:
    on_scans = [run for run in runs if run["case"] in COMPARED]
    changes = {
        "clicked structures, all clicked in a round": summarised(in_rounds(on_scans)),
        "the structure clicked alone": summarised(of_the_clicked(on_scans)),
        "all others, where one is clicked alone": summarised(of_the_others(on_scans)),
    }
    for words, summary in changes.items():
        if summary:
            yield Reached(f"≥ {UNHURT:.0%} of clicks cost no more than .02: {words}", UNHURT, summary.unhurt)
            yield Reached(f"worst drop ≤ {WORST_LOSS:.2f}: {words}", -WORST_LOSS, summary.worst.change, note=_where(summary))


def _where(summary: ChangeSummary) -> str:
    return f"{summary.worst.where}; {summary.count} clicks"
