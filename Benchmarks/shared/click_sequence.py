"""The clicks that a simulated user placed, so that other methods can be given the same ones."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from Benchmarks.shared.simulated_clicker import Click, ClickedRound, Clicks


@dataclass(frozen=True)
class ClickSequence:
    """Clicks, and when they were placed.

    Attributes:
        clicks: of each class, in the order placed.
        counts: for each round from 1, how many of each class there were.
    """

    clicks: tuple[tuple[Click, ...], ...]
    counts: tuple[tuple[int, ...], ...]

    def at(self, number: int) -> Clicks:
        """The clicks of each class in a round; after the last round they stay."""
        counts = self.counts[min(number, len(self.counts)) - 1]
        return [list(of_class[:count]) for of_class, count in zip(self.clicks, counts, strict=True)]

    def as_json(self) -> dict[str, Any]:
        """For a file; see `from_json`."""
        clicks = [[[*click.kji, int(click.positive)] for click in of_class] for of_class in self.clicks]
        return {"clicks": clicks, "counts": [list(counts) for counts in self.counts]}

    @classmethod
    def from_json(cls, content: dict[str, Any]) -> ClickSequence:
        """What `as_json` gave."""
        clicks = tuple(tuple(Click((k, j, i), bool(positive)) for k, j, i, positive in c) for c in content["clicks"])
        return cls(clicks, tuple(tuple(counts) for counts in content["counts"]))

    @classmethod
    def of_rounds(cls, rounds: Iterable[ClickedRound]) -> ClickSequence:
        """The clicks of rounds 1, 2, … as the clicker gave them."""
        placed = [state.clicks for state in rounds]
        return cls(placed[-1], tuple(tuple(len(of_class) for of_class in clicks) for clicks in placed))
