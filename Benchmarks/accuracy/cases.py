"""Which labelled volumes accuracy is measured on, and how thoroughly each."""

from __future__ import annotations

from dataclasses import dataclass

from Benchmarks.shared.derived_cases import ORGAN_FILLING_CROPS, WORSE_SCANS
from Benchmarks.shared.every_structure import EVERY_STRUCTURE
from Benchmarks.shared.labelled_cases import CHEST, SCANS, LabelledCase, PhantomCase
from Benchmarks.shared.other_cases import OTHERS


@dataclass(frozen=True)
class CaseGroup:
    """Cases that are measured in the same way.

    Attributes:
        title: in the report.
        cases: of the group.
        every_path: all paths of clicks, and one step of size after them; else one path.
        compared: with other methods, and with structures annotated one by one, in whatever order.
    """

    title: str
    cases: tuple[LabelledCase, ...]
    every_path: bool = False
    compared: bool = False


GROUPS = (
    CaseGroup("Scans", SCANS, every_path=True, compared=True),
    CaseGroup("Lungs, and crops that an organ fills", (CHEST, *ORGAN_FILLING_CROPS), every_path=True),
    CaseGroup("Other scans", OTHERS, every_path=True, compared=True),
    CaseGroup("Worse scans, and generated shapes", (*WORSE_SCANS, PhantomCase())),
    CaseGroup("Every structure", EVERY_STRUCTURE),
)

ALL_CASES = tuple(case for group in GROUPS for case in group.cases)
EVERY_PATH_CASES = tuple(case.name for group in GROUPS if group.every_path for case in group.cases)
"""Names of those that are measured on every path of clicks."""


def group_of(case: str) -> CaseGroup:
    """The group of the case of this name."""
    return next(group for group in GROUPS if case in [other.name for other in group.cases])
