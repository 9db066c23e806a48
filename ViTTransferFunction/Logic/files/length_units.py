"""Units of length that headers name beside their sizes, which ITK, as Slicer, takes for millimetres whatever they are."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from ..core.system.errors import InputError

_OTHER_LENGTH = re.compile(
    "(|[kdcunp\u00b5\u03bc\udcb5])m|(|kilo|deci|centi|micro|nano|pico)met(er|re)s?|microns?|in|inch|inches|ft|feet",
    re.IGNORECASE,
)
"""A length that is no millimetre. µ is written by one of two characters, or by a byte that is not UTF-8."""


def check_units(path: Path, units: Iterable[str]) -> None:
    """Raise InputError where a header has sizes in other units than millimetres.

    They are not converted: Slicer would show the segmentation of such a file in another size than the file itself.

    Args:
        path: of the file, for messages.
        units: as it is written for each axis; what is no length, or says nothing, is passed over.
    """
    other = next((unit for unit in units if _OTHER_LENGTH.fullmatch(unit.strip())), None)
    if other is not None:
        unit = other.strip().replace("\udcb5", "µ")
        raise InputError(
            f"{path} gives its sizes in the unit '{unit}'; expected millimetres ('mm'). Save it in millimetres, or correct its "
            "header where they are that already."
        )
