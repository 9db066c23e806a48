"""Means of what was measured, and their spread over the paths of clicks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from Benchmarks.accuracy.methods import DEFAULT
from Benchmarks.accuracy.runs import DIGITS
from Benchmarks.shared.report_tables import with_spread

Run = dict[str, Any]

COLUMNS = {"clicks alone": "own", "with one size step": "size step"}
"""Of the default method, in reports, and the kind of run that each is of."""


class Spread(NamedTuple):
    """A figure of several paths.

    Attributes:
        mean: over the paths.
        sd: standard deviation between the paths, of a sample; None for one path.
        paths: how many.
    """

    mean: float
    sd: float | None
    paths: int

    @property
    def pair(self) -> list[float | None]:
        """Mean and standard deviation, rounded for a file."""
        return [round(self.mean, DIGITS), None if self.sd is None else round(self.sd, DIGITS)]

    def __str__(self) -> str:
        return with_spread(self.mean, self.sd)


def spread(values: Sequence[float]) -> Spread:
    """Of at least one value, one a path."""
    return Spread(float(np.mean(values)), float(np.std(values, ddof=1)) if len(values) > 1 else None, len(values))


class Figures:
    """One method on one case: its runs of one kind, one for each path.

    Args:
        runs: of that method, case and kind.
    """

    def __init__(self, runs: Sequence[Run]) -> None:
        self._runs = runs

    @property
    def paths(self) -> list[int]:
        """On which paths it was measured."""
        return [run["path"] for run in self._runs]

    @property
    def structures(self) -> list[str]:
        """Names, in order."""
        return list(next(iter(self._runs[0]["rounds"].values()))) if self._runs else []

    @property
    def clicks(self) -> list[str]:
        """At which numbers of clicks it was measured."""
        return list(self._runs[0]["rounds"]) if self._runs else []

    def on(self, paths: Iterable[int]) -> Figures:
        """The same on some of the paths."""
        wanted = set(paths)
        return Figures([run for run in self._runs if run["path"] in wanted])

    def mean(self, clicks: str, metric: str = "dice") -> Spread | None:
        """Of the mean over the structures; None where it was not measured."""
        means = [[metrics[metric] for metrics in run["rounds"][clicks].values()] for run in self._measured(clicks)]
        return spread([float(np.mean(of_path)) for of_path in means]) if means else None

    def structure(self, name: str, clicks: str, metric: str = "dice") -> Spread | None:
        """Of one structure; None where it was not measured."""
        values = [run["rounds"][clicks][name][metric] for run in self._measured(clicks)]
        return spread(values) if values else None

    def _measured(self, clicks: str) -> list[Run]:
        return [run for run in self._runs if clicks in run["rounds"]]


def figures_of(runs: Iterable[Run], case: str, method: str = DEFAULT.name, kind: str = "own") -> Figures:
    """Those of one method, case and kind of run."""
    wanted = (case, method, kind)
    return Figures([run for run in runs if (run["case"], run["method"], run["clicks"]) == wanted])


def column_of(runs: Iterable[Run], case: str, column: str) -> Figures:
    """A column of the default method's on a case."""
    return figures_of(runs, case, kind=COLUMNS[column])


def names_of(runs: Iterable[Run], what: str) -> list[str]:
    """The cases, or methods, that there are runs of, in order."""
    return list(dict.fromkeys(run[what] for run in runs))
