"""What close-ups are worth: the figures of both ways side by side, as JSON and as tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from Benchmarks.accuracy.click_changes import LOSS
from Benchmarks.accuracy.figures import Spread, spread
from Benchmarks.accuracy.runs import DIGITS
from Benchmarks.accuracy.summary import single_runs
from Benchmarks.shared.machine import in_words
from Benchmarks.shared.report_files import write_results
from Benchmarks.shared.report_tables import number, paragraphs, table

WHOLE, CLOSE_UPS = "whole", "with close-ups"
WAYS = (WHOLE, CLOSE_UPS)
CLICKS = ("1", "3", "5")
LAST = CLICKS[-1]

HOW_TO_READ = f"""\
Mean Dice ± standard deviation between the paths of clicks, where there are several: a difference within it says nothing. In
each round every structure gets a click. *Whole*: by the whole scan alone, as in `accuracy.md`. *With close-ups*: once the first
clicks were answered, "Look closer" was pressed on every structure that a user would call small or thin
(`Benchmarks/close_up/who_presses.py`); @1 is after that. Where the box would have filled too much of the scan, it was refused,
and the structure stayed as it was. The first clicks of both ways are the same, later ones correct each way's own errors.
Nobody looks whether a press helped; a person would take back one that did not.
*Lost*: the share of structures whose Dice @{LAST} is more than {LOSS} below what it is by the whole scan on the same path.
Clicks are others by then, so that structures which nobody looked at closely lose and win as well."""
BANDS = ((0.0, 0.2), (0.2, 0.4), (0.4, 1.01))
"""Of Dice by the whole scan at the first click."""
WHO_GAINS = """\
The structures that were looked at closely, of all paths, by their Dice by the whole scan at the first click: how much more it
is with close-ups. A structure counts once on each path. Part of it is chance: a first click that the whole scan happens to do
badly with lifts the change in the first row, one that it does well with lowers it in the last."""
HOW_LARGE = "Median (least to most) of all paths; of each box, its longest edge."
HOW_LONG = """\
Median (least to most): from the press to the first map, the box's features and the maps of all structures included, one
close-up after the other, at the first clicks of path 1."""

Run = dict[str, Any]


@dataclass(frozen=True)
class Pair:
    """One path of clicks on a case, both ways.

    Attributes:
        whole: the run by the whole scan alone.
        close: the run with close-ups.
    """

    whole: Run
    close: Run

    @property
    def structures(self) -> list[str]:
        """Names, in order."""
        return list(self.whole["rounds"][LAST])

    @property
    def looked_at(self) -> list[str]:
        """The structures that were looked at closely on this path."""
        return [press["structure"] for press in _accepted(self.close["presses"])]

    @property
    def refused(self) -> list[str]:
        """The structures whose box would have been too large."""
        return [press["structure"] for press in self.close["presses"] if press["size_mm"] is None]

    @property
    def others(self) -> list[str]:
        """The structures that nobody looked at closely."""
        return [name for name in self.structures if name not in self.looked_at]

    def dice(self, way: str, name: str, clicks: str) -> float:
        """Of one structure."""
        run = self.whole if way == WHOLE else self.close
        return float(run["rounds"][clicks][name]["dice"])

    def mean(self, way: str, names: Sequence[str], clicks: str) -> float:
        """Mean Dice of some structures."""
        return float(np.mean([self.dice(way, name, clicks) for name in names]))

    def changes(self, names: Sequence[str], clicks: str = LAST) -> list[float]:
        """What close-ups changed, of some structures."""
        return [round(self.dice(CLOSE_UPS, name, clicks) - self.dice(WHOLE, name, clicks), DIGITS) for name in names]

    def looked_at_in(self, band: tuple[float, float]) -> list[str]:
        """Those looked at closely that the whole scan shows so well at the first click."""
        return [name for name in self.looked_at if band[0] <= self.dice(WHOLE, name, CLICKS[0]) < band[1]]


Chosen = Callable[[Pair], Sequence[str]]
"""Which structures of a path are meant."""
CHOICES: dict[str, Chosen] = {
    "looked at closely": lambda pair: pair.looked_at,
    "all others": lambda pair: pair.others,
    "all": lambda pair: pair.structures,
}


def write_report(report: dict[str, Any], folder: Path) -> None:
    """Write close_up.json and close_up.md."""
    runs = report["runs"]
    figures = {**report, "summary": summary(runs, report["cases"]), "runs": single_runs(runs)}
    write_results(folder, "close_up", figures, text(report))


def pairs_of(runs: Sequence[Run]) -> dict[str, list[Pair]]:
    """Case → its paths of clicks, as far as both ways were measured."""
    by_key = {(run["case"], run["path"], run["way"]): run for run in runs}
    pairs: dict[str, list[Pair]] = {}
    for case, path in dict.fromkeys((run["case"], run["path"]) for run in runs):
        if all((case, path, way) in by_key for way in WAYS):
            pairs.setdefault(case, []).append(Pair(by_key[case, path, WHOLE], by_key[case, path, CLOSE_UPS]))
    return pairs


def summary(runs: Sequence[Run], cases: dict[str, Any]) -> dict[str, Any]:
    """The figures that are tracked, by case."""
    return {
        case: {
            "paths": len(pairs),
            **{
                choice: {way: {clicks: _pair(mean_of(pairs, way, chosen, clicks)) for clicks in CLICKS} for way in WAYS}
                | {"lost": lost_share(pairs, chosen)}
                for choice, chosen in CHOICES.items()
            },
            "close_ups": sum(len(pair.looked_at) for pair in pairs),
            "refused": sum(len(pair.refused) for pair in pairs),
            "seconds": _median([press["seconds"] for press in _accepted(cases[case].get("timed", []))]),
            "voxels": _median([press["voxels"] for press in _close_ups(pairs)]),
        }
        for case, pairs in pairs_of(runs).items()
    }


def mean_of(pairs: Sequence[Pair], way: str, chosen: Chosen, clicks: str) -> Spread | None:
    """Mean Dice of the chosen structures over the paths that have any; None where none has."""
    means = [pair.mean(way, chosen(pair), clicks) for pair in pairs if chosen(pair)]
    return spread(means) if means else None


def lost_share(pairs: Sequence[Pair], chosen: Chosen) -> float | None:
    """Share of the chosen structures, over all paths, that lost more than `LOSS`; None where there are none."""
    changes = [change for pair in pairs for change in pair.changes(chosen(pair))]
    return round(float(np.mean(np.array(changes) < -LOSS)), DIGITS) if changes else None


def text(report: dict[str, Any]) -> str:
    """For people."""
    pairs = pairs_of(report["runs"])
    timed = {case: figures for case, figures in report["cases"].items() if "timed" in figures}
    return paragraphs(
        "# Close-ups",
        f"Features of {report['model']}, default preset. {in_words(report['machine'])}. "
        "Command: `python dev.py bench close_up --volumes DIR`. Each path by itself is in `close_up.json`.",
        *(part for choice in CHOICES for part in (f"## Structures: {choice}", _means(pairs, choice))),
        HOW_TO_READ,
        "## Whom it helps",
        _gains(pairs),
        WHO_GAINS,
        "## Boxes",
        _sizes(pairs),
        HOW_LARGE,
        *(("## Seconds", _seconds(timed), HOW_LONG) if timed else ()),
        *(part for case, of_case in pairs.items() for part in (f"## {case}", _structures(of_case, report["cases"][case]))),
    )


def _means(pairs: dict[str, list[Pair]], choice: str) -> str:
    chosen = CHOICES[choice]
    header = ["volume", "structures", "paths", *(f"{way} @{clicks}" for clicks in CLICKS for way in WAYS), f"lost @{LAST}"]
    rows = []
    for case, of_case in pairs.items():
        means = [mean_of(of_case, way, chosen, clicks) for clicks in CLICKS for way in WAYS]
        counts = [len(chosen(pair)) for pair in of_case]
        lost = lost_share(of_case, chosen)
        share = "–" if lost is None else f"{lost:.0%}"
        rows.append([case, _range(counts), len(of_case), *("–" if mean is None else str(mean) for mean in means), share])
    return table(header, rows)


def _gains(pairs: dict[str, list[Pair]]) -> str:
    rows = []
    for case, of_case in pairs.items():
        for band in BANDS:
            chosen = [(pair, pair.looked_at_in(band)) for pair in of_case]
            changes = [[change for pair, names in chosen for change in pair.changes(names, clicks)] for clicks in CLICKS]
            if changes[0]:
                means = (f"{np.mean(of_round):+.3f}" for of_round in changes)
                lost = np.mean(np.array(changes[-1]) < -LOSS)
                rows.append([case, f"{band[0]} to {min(band[1], 1.0)}", len(changes[0]), *means, f"{lost:.0%}"])
    header = ["volume", f"Dice by the whole @{CLICKS[0]}", "structures", *(f"change @{clicks}" for clicks in CLICKS)]
    return table([*header, f"lost @{LAST}"], rows)


def _sizes(pairs: dict[str, list[Pair]]) -> str:
    rows = []
    for case, of_case in pairs.items():
        presses, refused = _close_ups(of_case), sum(len(pair.refused) for pair in of_case)
        edges, voxels = [max(press["size_mm"]) for press in presses], [press["voxels"] / 1000.0 for press in presses]
        rows.append([case, len(presses), refused, _range_of(edges, 0), _range_of(voxels, 0)])
    return table(["volume", "close-ups", "refused", "longest edge, mm", "thousand voxels"], rows)


def _seconds(cases: dict[str, Any]) -> str:
    rows = []
    for case, figures in cases.items():
        seconds = [press["seconds"] for press in _accepted(figures["timed"])]
        rows.append([case, len(seconds), _range_of(seconds, 1), in_words(figures["timed_on"])])
    return table(["volume", "close-ups", "seconds", "on"], rows)


def _structures(pairs: Sequence[Pair], case: dict[str, Any]) -> str:
    """Those that were looked at closely on more paths first."""
    header = [
        "structure",
        "ml",
        "looked at on paths",
        *(f"{way} @{clicks}" for clicks in CLICKS for way in WAYS),
        f"change @{LAST}",
    ]
    times = {name: sum(name in pair.looked_at for pair in pairs) for name in pairs[0].structures}
    rows = []
    for name in sorted(times, key=lambda name: -times[name]):
        means = [np.mean([pair.dice(way, name, clicks) for pair in pairs]) for clicks in CLICKS for way in WAYS]
        change = f"{means[-1] - means[-2]:+.3f}"
        rows.append([name, number(case["millilitres"][name], 1), times[name], *(number(float(mean)) for mean in means), change])
    return table(header, rows)


def _close_ups(pairs: Sequence[Pair]) -> list[Run]:
    return [press for pair in pairs for press in _accepted(pair.close["presses"])]


def _accepted(presses: Sequence[Run]) -> list[Run]:
    return [press for press in presses if press["size_mm"] is not None]


def _median(values: Sequence[float]) -> float | None:
    return round(float(np.median(values)), DIGITS) if values else None


def _range_of(values: Sequence[float], digits: int) -> str:
    if not values:
        return "–"
    return f"{np.median(values):.{digits}f} ({min(values):.{digits}f} to {max(values):.{digits}f})"


def _range(counts: Sequence[int]) -> str:
    return f"{min(counts)}" if min(counts) == max(counts) else f"{min(counts)} to {max(counts)}"


def _pair(found: Spread | None) -> list[float | None] | None:
    return None if found is None else found.pair
