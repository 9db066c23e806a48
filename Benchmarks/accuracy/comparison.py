"""The default method beside others, on the same paths of clicks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from Benchmarks.accuracy.figures import Figures, figures_of, names_of
from Benchmarks.accuracy.methods import BASELINES, DEFAULT

Run = dict[str, Any]


class Lead(NamedTuple):
    """How far the default method is ahead of a baseline on one structure; negative where it is behind.

    Attributes:
        difference: of the mean Dice, on the paths that the baseline was given.
        baseline: its name.
        dice: of the baseline.
        where: structure, clicks and baseline, in words.
    """

    difference: float
    baseline: str
    dice: float
    where: str


def methods_on(runs: Sequence[Run], case: str) -> dict[str, Figures]:
    """The default and the others that were given its clicks, by name."""
    found = {name: figures_of(runs, case, name, "own" if name == DEFAULT.name else "same") for name in names_of(runs, "method")}
    return {name: figures for name, figures in found.items() if figures.paths}


def lead_of(runs: Sequence[Run], case: str, structure: str, clicks: str) -> Lead | None:
    """Over the best baseline, which is the one that the default is least ahead of; None where there is no baseline."""
    methods = methods_on(runs, case)
    found = []
    for baseline in BASELINES:
        theirs = methods.get(baseline.name)
        of_theirs = theirs and theirs.structure(structure, clicks)
        ours = theirs and methods[DEFAULT.name].on(theirs.paths).structure(structure, clicks)
        if of_theirs and ours:
            where = f"{case}: {structure} @{clicks}, {baseline.name}"
            found.append(Lead(ours.mean - of_theirs.mean, baseline.name, of_theirs.mean, where))
    return min(found, default=None)


def leads(runs: Sequence[Run]) -> Iterator[Lead]:
    """Of all structures and numbers of clicks that a baseline was measured on."""
    for case in names_of(runs, "case"):
        figures = figures_of(runs, case)
        for structure in figures.structures:
            for clicks in figures.clicks:
                lead = lead_of(runs, case, structure, clicks)
                if lead:
                    yield lead
