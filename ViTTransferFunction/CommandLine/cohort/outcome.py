"""What became of a case."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

Status = Literal["done", "unchanged", "refused", "failed", "waiting"]
"""Segmented now; segmented before from the same; cannot be used; ended by a defect or a killed process, or removed; not yet."""


@dataclass(frozen=True)
class CaseOutcome:
    """What became of a case.

    Attributes:
        case: its name.
        status: in a word.
        seconds: that it took, from reading to writing; None where there is no segmentation.
        millilitres: of each structure, by name.
        message: for users, where there is something to say.
    """

    case: str
    status: Status
    seconds: float | None = None
    millilitres: dict[str, float] = field(default_factory=dict)
    message: str = ""
