"""The request for a class's map: its points and all settings that affect map and threshold, but not its look."""

from __future__ import annotations

import unicodedata
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..system.errors import InputError, shown
from ..system.given_numbers import FARTHEST, is_number
from ..volumes.geometry import LPS_TO_RAS, Geometry, transform_points
from .close_up import CloseUp
from .iso_proposals import LARGEST_SIZE, SMALLEST_SIZE

_NOT_IN_XML = "\ufffe\uffff"
"""Printable characters that are not allowed in XML: a scene that contains one could not be opened again."""


def no_points() -> np.ndarray:
    """An empty array of points, (0, 3)."""
    return np.empty((0, 3))


def different_places(points_ras: np.ndarray) -> np.ndarray:
    """Indices of the points (P, 3), in order, without those that are exactly at the place of an earlier one."""
    first_at: dict[bytes, int] = {}
    # Compared by their bytes, because NumPy's `unique` of rows takes ten times as long.
    for index, point in enumerate(points_ras):
        first_at.setdefault(point.tobytes(), index)
    return np.array(list(first_at.values()), dtype=int)


@dataclass(frozen=True, eq=False)
class ClassRequest:
    """One structure of interest, and everything that decides which voxels belong to it.

    Requests are equal if all fields but the name are: to rename a structure does not need a new map.

    Attributes:
        id: unique among the classes, and constant for as long as the class exists.
        positive: (N, 3) RAS millimetres, points on the structure, N ≥ 1.
        negative: (M, 3) RAS millimetres, points that are not of this structure.
        iso: threshold on the class's similarity map, in [0, 1]; None: chosen from the annotations.
        size: the size of the structure that is meant, from −3 to 3: −1 the smaller proposal, 0 the chosen, 1 the larger one
            (`IsoProposals`). Ignored if there is an `iso`.
        proximity: p̃ of the paper, in [0, 1]: how much similarity fades with distance from the positive points; 0: not at all.
        refine: whether the map is sharpened against the intensities.
        close_up: the box in which the structure is looked at, if it is small or thin; None: the whole volume.
        name: the user's name for it; by default its id.

    Raises:
        InputError: a field is out of range or there is no positive point.
    """

    id: str
    positive: np.ndarray
    negative: np.ndarray = field(default_factory=no_points)
    iso: float | None = None
    size: float = 0.0
    proximity: float = 0.0
    refine: bool = True
    close_up: CloseUp | None = None
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", self.name or self.id)
        check_name(self.name)
        for polarity in ("positive", "negative"):
            object.__setattr__(self, polarity, as_points(getattr(self, polarity), f"{polarity} points of class '{self.name}'"))
        if not len(self.positive):
            raise InputError(f"Class '{self.name}' has no positive points; place at least one on the structure.")
        check_share(self.iso, "iso", self.name)
        check_size(self.size, self.name)
        check_share(self.proximity, "proximity", self.name)
        if not isinstance(self.refine, bool):
            raise InputError(f"'refine' of class '{self.name}' is {shown(self.refine)}; expected true or false.")
        if self.close_up is not None and not isinstance(self.close_up, CloseUp):
            raise InputError(f"'close_up' of class '{self.name}' is {shown(self.close_up)}; expected its centre and size.")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ClassRequest) and self._values == other._values

    def __hash__(self) -> int:
        return hash(self._values)

    def claims(self, points_ras: np.ndarray) -> np.ndarray:
        """(N,) bool: which of the points (N, 3) are exactly at the place of one of the class's positive ones."""
        claimed: np.ndarray = (points_ras[:, None] == self.positive[None]).all(axis=2).any(axis=1)
        return claimed

    def asks_for_map_of(self, other: ClassRequest) -> bool:
        """Whether the answer to `other` has the same map, that is, they differ at most in iso value and size."""
        return self == replace(other, iso=self.iso, size=self.size)

    @property
    def _values(self) -> tuple[Any, ...]:
        points = (self.positive.tobytes(), self.negative.tobytes())
        return self.id, self.iso, self.size, self.proximity, self.refine, self.close_up, *points


def points_against(requests: Sequence[ClassRequest], index: int) -> np.ndarray:
    """Points (N, 3) RAS millimetres that speak against the index-th class: its negative ones, and others' positive ones.

    Positive points that the class has as well do not count.
    """
    request = requests[index]
    return np.concatenate([request.negative, *(other.positive[~request.claims(other.positive)] for other in requests)])


def check_requests(requests: Sequence[ClassRequest], geometry: Geometry) -> None:
    """Raise InputError unless there are classes, their ids differ, and every point lies inside the volume's box."""
    if not requests:
        raise InputError("There are no classes; annotate at least one structure.")
    id_, count = Counter(composed(request.id) for request in requests).most_common(1)[0]
    if count > 1:
        raise InputError(f"{count} classes are named '{id_}'; give each class a name of its own.")
    check_inside(requests, geometry)


def check_inside(requests: Sequence[ClassRequest], geometry: Geometry) -> None:
    """Raise InputError unless every point lies inside the volume's box."""
    for request in requests:
        points = np.concatenate([request.positive, request.negative])
        outside = points[~geometry.contains(points)]
        if len(outside):
            position = ", ".join(f"{x:.1f}" for x in outside[0])
            raise InputError(
                f"{len(outside)} of {len(points)} points of class '{request.name}' lie outside the volume, the first at "
                f"RAS ({position}) mm. {_outside_advice(requests, geometry)}"
            )


def _outside_advice(requests: Sequence[ClassRequest], geometry: Geometry) -> str:
    """What to do about points outside the volume: the coordinates in which all points of all classes lie inside are named."""
    points = np.concatenate([points for request in requests for points in (request.positive, request.negative)])
    readings = (
        ("LPS", LPS_TO_RAS, '"LPS" ("RAS", where it is "LPS" already); Slicer\'s point lists call it "coordinateSystem"'),
        ("voxels", geometry.ijk_to_ras, '"IJK"'),
    )
    for called, to_ras, to_set in readings:
        if geometry.contains(transform_points(to_ras, points)).all():
            return f'But all points lie inside when read as {called}; if they are that, set "coordinate_system": {to_set}.'
    return "Check the coordinate system of the points, and that they belong to this volume."


def composed(name: str) -> str:
    """A class's name with letters and their accents in one form of Unicode (NFC): names that look the same are equal then."""
    return unicodedata.normalize("NFC", name)


def check_name(name: str) -> None:
    """Raise InputError unless a class's name says something, and can be written into any file."""
    # Spaces of any kind, and what only changes how other characters are shown.
    if all(character.isspace() or unicodedata.category(character) == "Cf" for character in name):
        raise InputError("A class has an empty name; every class needs one.")
    if any(unicodedata.category(character) in ("Cc", "Cs") or character in _NOT_IN_XML for character in name):
        raise InputError(f"The name of class {shown(name)} holds characters that cannot be written; give it another name.")


def check_share(value: Any, field_name: str, class_name: str) -> None:
    """Raise InputError unless a field of a class is None or a number from 0 to 1."""
    if value is not None and not (is_number(value) and 0.0 <= value <= 1.0):
        raise InputError(f"'{field_name}' of class '{class_name}' is {shown(value)}; expected a number from 0 to 1.")


def check_size(value: Any, class_name: str) -> None:
    """Raise InputError unless a class's size is a number from -3 to 3."""
    if not (is_number(value) and SMALLEST_SIZE <= value <= LARGEST_SIZE):
        raise InputError(
            f"'size' of class '{class_name}' is {shown(value)}; expected a number from {SMALLEST_SIZE:g} to {LARGEST_SIZE:g}."
        )


def as_points(points: Any, what: str) -> np.ndarray:
    """(N, 3) float64 of whatever says positions. Raises InputError, which calls them `what`, where that is impossible."""
    if isinstance(points, (list, tuple)):
        if not all(_is_position(point) for point in points):
            raise _no_points(points, what)
        points = np.array([[float(coordinate) for coordinate in point] for point in points], dtype=np.float64).reshape(-1, 3)
    if not isinstance(points, np.ndarray) or points.dtype.kind not in "iuf":
        raise _no_points(points, what)
    # Of -0, which turning LPS into RAS makes of 0, nothing is left: places are the same where their bytes are.
    array = np.array(points, dtype=np.float64) + 0.0
    if array.size == 0 and array.ndim <= 2 and not len(array):
        return no_points()
    if array.ndim != 2 or array.shape[1] != 3 or not (np.abs(array) <= FARTHEST).all():
        raise _no_points(points, what)
    return array


def _is_position(point: Any) -> bool:
    """Whether a value out of a file, or a row of an array, is a position. Numbers that a float cannot hold are none."""
    if isinstance(point, np.ndarray):
        return point.shape == (3,) and point.dtype.kind in "iuf"
    return (
        isinstance(point, (list, tuple))
        and len(point) == 3
        and all(is_number(value) and abs(value) <= FARTHEST for value in point)
    )


def _no_points(points: Any, what: str) -> InputError:
    return InputError(
        f"The {what} are not a list of finite [x, y, z] positions: got {shown(points)}; expected three numbers each, none "
        f"beyond ±{FARTHEST:g}, such as [[10.5, -20, 300]]."
    )
