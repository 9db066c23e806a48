"""A table of what an earlier version reached, beside what is reached now, on the same volumes and first clicks."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from Benchmarks.accuracy.figures import COLUMNS
from Benchmarks.shared.report_tables import table, with_spread

COMPARED_CLICKS = ("1", "3", "5")

Cases = dict[str, Any]
"""`cases` of a report's summary."""


def read_earlier(path: Path) -> Cases:
    """The cases of an earlier run, from its `accuracy.json`."""
    cases: Cases = json.loads(path.read_text(encoding="utf-8"))["summary"]["cases"]
    return cases


def before_and_now(before: Cases, now: Cases) -> str:
    """Dice by number of clicks, before and now, of every case that both have, and of its structures where they are the same."""
    header = ["volume", "structure", *(f"@{n}, {when}" for n in COMPARED_CLICKS for when in ("before", "now"))]
    return table(header, [row for case in now if case in before for row in _rows(case, before[case], now[case])])


def _rows(case: str, before: Cases, now: Cases) -> Iterator[list[str]]:
    for column in COLUMNS:
        if before[column] and now[column]:
            pairs = [_pair(cases[column].get(n, {}).get("dice")) for n in COMPARED_CLICKS for cases in (before, now)]
            yield [f"**{case}**", f"mean, {column}", *pairs]
    alone, _ = COLUMNS
    for name in now[alone][COMPARED_CLICKS[0]]["structures"]:
        of_name = [cases[alone].get(n, {}).get("structures", {}).get(name) for n in COMPARED_CLICKS for cases in (before, now)]
        yield ["", name, *map(_pair, of_name)]


def _pair(pair: list[float | None] | None) -> str:
    return with_spread(*(pair or (None, None)))
