"""Splits a DICOM series into volumes if it has several at the same positions: heart or contrast phases, echoes, b-values.

Volumes are distinguished by a header element whose value differs between slices at the same position. Either all slices of a
volume share its value, such as the echo time; or each slice has its own, such as the acquisition time, and the order of the
values at each position decides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter

import numpy as np

from .dicom_slice import DicomSlice, heights, number_of, turned

SAME_PLACE = 0.01
"""Slices whose heights differ by less are at the same position, as a share of the distance between positions."""
SAME_HEIGHT_MM = 0.001
"""Differences in height up to this are rounding errors."""

SAME_PLACE_MM = 0.1
"""Largest shift within the plane between slices at the same position."""

NOON, MIDNIGHT = 120000.0, 240000.0
"""Times of day as DICOM writes them, HHMMSS."""


@dataclass(frozen=True)
class Trait:
    """A header element in which the volumes of a series may differ.

    Attributes:
        tag: of the element, as ITK writes it.
        name: precedes the value in the name of a volume.
        unit: follows the value.
        order: what the order of its values is called; "" if their order has no meaning.
    """

    tag: str
    name: str
    unit: str = ""
    order: str = ""

    def value(self, one: DicomSlice) -> str:
        """The value in the header of a slice, written as users would, such as "4.6" for "4.60"; "" if it is missing."""
        text = one.traits.get(self.tag, "")
        if self.order == "time":
            return text.rstrip("0").rstrip(".") if "." in text else text
        return f"{number:g}" if (number := number_of(text)) is not None else text

    def told(self, value: str) -> str:
        """The name of the volume with this value."""
        if not value:
            return f"no {self.name}"
        if self.order == "time" and value[:6].isdigit():
            return f"at {value[:2]}:{value[2:4]}:{value[4:]}"
        return f"{self.name} {value} {self.unit}".rstrip()


IMAGE_TYPE = Trait("0008|0008", "image type")
TRAITS = (
    IMAGE_TYPE,
    Trait("0018|9087", "b-value"),
    Trait("0018|0081", "echo time", "ms"),
    Trait("0018|0086", "echo"),
    Trait("0018|0082", "inversion time", "ms"),
    Trait("0018|1314", "flip angle", "degrees"),
    Trait("0018|0060", "tube voltage", "kV"),
    Trait("0020|0100", "time point"),
    Trait("0018|1060", "trigger time", "ms", order="trigger time"),
    Trait("0020|0012", "acquisition", order="acquisition"),
    Trait("0008|0032", "acquisition time", order="time"),
    Trait("0008|0033", "content time", order="time"),
    Trait("0018|0024", "sequence"),
    Trait("0020|0013", "image number", order="image number"),
)
"""From the most to the least informative for users."""


def volumes_of_series(slices: Sequence[DicomSlice]) -> list[tuple[str, list[DicomSlice]]]:
    """The volumes of a series: the name of each within the series, and its slices.

    Args:
        slices: of one series, sorted by their heights.

    Returns:
        All slices as one volume with the name "" if no two slices are at the same position, or nothing distinguishes those that
        are.
    """
    places = _places(slices)
    found = None if places is None else _told_apart(list(zip(places, slices, strict=True)), TRAITS)
    if found is None:
        return [("", list(slices))]
    return [(", ".join(names), [one for _, one in placed]) for names, placed in found]


_Placed = list[tuple[int, DicomSlice]]
_Volume = tuple[tuple[str, ...], _Placed]


def _places(slices: Sequence[DicomSlice]) -> list[int] | None:
    """The index of each slice's position; None unless several slices of equal size share positions."""
    if len({one.size for one in slices}) > 1 or slices[0].size[2] > 1 or turned(slices).any():
        return None
    gaps = np.diff(heights(slices))
    between_places = gaps[gaps > SAME_HEIGHT_MM]
    if not between_places.size:
        return None
    places = np.concatenate([[0], np.cumsum(gaps > SAME_PLACE * np.median(between_places))])
    positions = np.array([one.position for one in slices])
    _, first = np.unique(places, return_index=True)
    away = np.linalg.norm(positions - positions[first[places]], axis=1)
    shift_mm = away - np.abs(heights(slices) - heights(slices)[first[places]])
    return None if len(first) == len(slices) or (shift_mm > SAME_PLACE_MM).any() else places.tolist()


def _told_apart(placed: _Placed, traits: Sequence[Trait]) -> list[_Volume] | None:
    """Split slices into volumes by traits; None if the traits cannot distinguish them."""
    if len({place for place, _ in placed}) == len(placed):
        return [((), placed)]
    for number, trait in enumerate(traits):
        if parts := _by_value(placed, trait):
            found = [(name, _told_apart(part, traits[number + 1 :])) for name, part in parts]
            if all(volumes is not None for _, volumes in found):
                return [((name, *names), part) for name, volumes in found for names, part in volumes or ()]
    ordered = (_by_order(placed, trait) for trait in traits if trait.order)
    return next(filter(None, ordered), None)


def _by_value(placed: _Placed, trait: Trait) -> list[tuple[str, _Placed]] | None:
    """Slices by value; None unless some position has all values: otherwise they belong to positions, not to volumes."""
    parts: dict[str, _Placed] = {}
    for place, one in placed:
        parts.setdefault(trait.value(one), []).append((place, one))
    if len(parts) < 2 or not set.intersection(*({place for place, _ in part} for part in parts.values())):
        return None
    values = sorted(parts, key=_order_of(trait, parts))
    names = _image_types(values) if trait is IMAGE_TYPE else values
    return [(trait.told(name), parts[value]) for name, value in zip(names, values, strict=True)]


def _by_order(placed: _Placed, trait: Trait) -> list[_Volume] | None:
    """Volumes by the rank of values at each position; None if values are equal there, or positions have different counts."""
    at_places = [[one for _, one in group] for _, group in groupby(placed, key=itemgetter(0))]
    count, order = len(at_places[0]), _order_of(trait, (trait.value(one) for _, one in placed))
    keys = [{order(trait.value(one)) for one in at_place} for at_place in at_places]
    if any(len(at_place) != count or len(distinct) != count for at_place, distinct in zip(at_places, keys, strict=True)):
        return None
    in_order = [sorted(at_place, key=lambda one: order(trait.value(one))) for at_place in at_places]
    return [
        ((f"{rank + 1} of {count} by {trait.order}",), [(place, ones[rank]) for place, ones in enumerate(in_order)])
        for rank in range(count)
    ]


def _image_types(values: Sequence[str]) -> list[str]:
    """Image types without their common parts, if they remain distinct."""
    parts = [value.split("\\") for value in values]
    common = set.intersection(*map(set, parts))
    short = ["\\".join(part for part in each if part not in common) for each in parts]
    return short if len(set(short)) == len(short) and all(short) else list(values)


def _order_of(trait: Trait, values: Iterable[str]) -> Callable[[str], tuple[float, str]]:
    """The sort key for values of a trait. Times that span more than half a day are taken to be around midnight."""
    numbers = [number for value in values if (number := number_of(value)) is not None]
    if trait.order != "time" or not numbers or max(numbers) - min(numbers) < NOON:
        return _in_order

    def around_midnight(value: str) -> tuple[float, str]:
        number, text = _in_order(value)
        return (number + MIDNIGHT if 0.0 <= number < NOON else number), text

    return around_midnight


def _in_order(value: str) -> tuple[float, str]:
    number = number_of(value)
    return (-np.inf if not value else np.inf, value) if number is None else (number, "")
