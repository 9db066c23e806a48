"""Annotated points of all classes together: what each says of each class, and how much it is believed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..core.classes.class_request import ClassRequest, different_places

POINT_RIDGE = 0.05
BACKGROUND_RIDGE = 2.0
"""Diagonal of Λ: what annotated points, and what random cells, may be missed by."""
FEW_POINTS = 15
"""Of a class, inside or outside it: up to so many points, each is believed."""
MANY_POINTS_EXPONENT = 1.5
"""Of more points, each may be missed by more: their number over `FEW_POINTS` to this power, but by no more than a random cell.
Were each of some hundred points believed, all over a structure, the map would take in all that is like any of them, at a rim
say: of a liver, the Dice at 400 points was 0.35, and is 0.85. Chosen on the torso, looked at on the brain; benchmarks have
hardly so many clicks."""


@dataclass(frozen=True, eq=False)
class AnnotatedPoints:
    """All classes' points.

    Attributes:
        points_ras: (P, 3) RAS millimetres, where they are looked at.
        targets: (P, classes), what each class should be there: 1, 0, or NaN where a point says nothing of a class.
        classes: (P,) the index of the class that each point belongs to.
        positive: (P,) bool, whether it is a positive point of that class.
    """

    points_ras: np.ndarray
    targets: np.ndarray
    classes: np.ndarray
    positive: np.ndarray


def annotated_points(
    requests: Sequence[ClassRequest], seen_at: Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> AnnotatedPoints:
    """The points of all classes, each class's positive ones before its negative ones.

    `seen_at` says where a class's negative points are looked at, given them and its positive ones (`PointPlaces.of_negatives`).

    A negative point says that its own class is not there, and leaves open what is. A point that two classes claim, such as a
    class and its duplicate, speaks against neither.
    """
    points, targets = [], []
    for index, request in enumerate(requests):
        positive = np.stack([np.where(other.claims(request.positive), np.nan, 0.0) for other in requests], axis=1)
        negative = np.full((len(request.negative), len(requests)), np.nan)
        positive[:, index], negative[:, index] = 1.0, 0.0
        points += [request.positive, seen_at(request.negative, request.positive)]
        targets += [positive, negative]
    part = np.repeat(np.arange(len(points)), [len(of_polarity) for of_polarity in points])
    return AnnotatedPoints(np.concatenate(points), np.concatenate(targets), classes=part // 2, positive=part % 2 == 0)


def point_ridge(annotated: AnnotatedPoints) -> np.ndarray:
    """What each annotated point may be missed by, (P,)."""
    ridge = np.empty(len(annotated.points_ras))
    parts = 2 * annotated.classes + annotated.positive
    for part in np.unique(parts):
        own = parts == part
        many = len(different_places(annotated.points_ras[own])) / FEW_POINTS
        ridge[own] = min(POINT_RIDGE * max(many, 1.0) ** MANY_POINTS_EXPONENT, BACKGROUND_RIDGE)
    return ridge
