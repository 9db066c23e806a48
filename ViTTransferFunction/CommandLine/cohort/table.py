"""The table of a cohort: what became of each case, up to date while others are still computed."""

from __future__ import annotations

import csv
import logging
from collections.abc import Iterable
from pathlib import Path

from ViTTransferFunction.CommandLine.cohort.outcome import CaseOutcome
from ViTTransferFunction.Logic.core.system.atomic_file import replacing
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.measures import decimals_of

logger = logging.getLogger(__name__)


class CohortTable:
    """A CSV file with a line for each case, in the order of the cases: case, status, seconds, ml of each structure, message.

    Args:
        path: of the file; it is written by `save`.
        cases: names of all.
    """

    def __init__(self, path: Path, cases: Iterable[str]) -> None:
        self.path = path
        self.outcomes = {case: CaseOutcome(case, "waiting") for case in cases}
        self._warned = False

    def put(self, outcome: CaseOutcome) -> None:
        """Take in what became of a case, and write the file if that is possible now."""
        self.outcomes[outcome.case] = outcome
        try:
            self.save()
        except InputError as error:
            # Somebody looks at it in a spreadsheet, say: no reason to give up hours of work.
            if not self._warned:
                logger.warning("%s The table is written again as further cases end.", error)
            self._warned = True

    def save(self) -> None:
        """Write the file, whole or not at all. Raises InputError where that is not possible."""
        structures = list(dict.fromkeys(name for outcome in self.outcomes.values() for name in outcome.millilitres))
        # By the mark in front, Excel knows that it is UTF-8; else umlauts would be other letters.
        with replacing(self.path) as temporary, temporary.open("w", encoding="utf-8-sig", newline="") as file:
            writer = csv.writer(file)
            # The unit comes first: a spreadsheet would compute a heading that begins with "=".
            writer.writerow(["case", "status", "seconds", *(f"ml {name}" for name in structures), "message"])
            writer.writerows(_row(outcome, structures) for outcome in self.outcomes.values())


def _row(outcome: CaseOutcome, structures: list[str]) -> list[str]:
    millilitres = (outcome.millilitres.get(name) for name in structures)
    figures = (_number(outcome.seconds, 1), *(_number(value, decimals_of(value or 0.0, 4, 3)) for value in millilitres))
    return [outcome.case, outcome.status, *figures, " ".join(outcome.message.split())]


def _number(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"
