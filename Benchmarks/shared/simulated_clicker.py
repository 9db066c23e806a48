"""A user who knows the truth and corrects the largest error, so that methods can be compared by what a click is worth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from Benchmarks.shared.aim import DEEPEST, Aim
from Benchmarks.shared.regions import Voxel, largest_component

MOST_CLICKS = 10

Clicks = list[list["Click"]]
Gesture = Sequence["Click"]
"""What is placed at once: a click, or all that a line stands for; at least one point, the first one positive."""


@dataclass(frozen=True)
class Click:
    """One point placed by the user.

    Attributes:
        kji: voxel index along (K, J, I).
        positive: on the structure; otherwise it says that the structure is not there.
    """

    kji: Voxel
    positive: bool


@dataclass(frozen=True, eq=False)
class ClickedRound:
    """The state after one more gesture on every class, or none where nothing was left to correct.

    Attributes:
        number: of the round, from 1.
        clicks: of each class, in the order placed.
        labels: (K, J, I), what the method made of them.
    """

    number: int
    clicks: tuple[tuple[Click, ...], ...]
    labels: np.ndarray


def click_in_rounds(
    truth: np.ndarray,
    spacing_mm: Sequence[float],
    segment: Callable[[Clicks], np.ndarray],
    rounds: int = MOST_CLICKS,
    with_negatives: bool = True,
    aims: Sequence[Aim] | None = None,
    begun_by: Sequence[Sequence[Gesture]] | None = None,
) -> Iterator[ClickedRound]:
    """Annotate all classes of a label map together, one gesture a class and round: a click, unless it is said otherwise.

    Classes annotated one by one are calls with label maps of one class each.

    Args:
        truth: (K, J, I) integers, 0 for background and 1 … n for the classes.
        spacing_mm: of the voxels, along (K, J, I).
        segment: the method: from the clicks of each class, in the order of the labels, to labels like the truth's.
        rounds: how many gestures a class receives at most.
        with_negatives: see `next_click`.
        aims: how the clicks of each class are aimed; None: at the deepest place.
        begun_by: the first gestures of each class, at least one; then its errors are clicked on. None: one click.

    Raises:
        ValueError: a label between 1 and the largest does not occur.
    """
    classes = range(1, int(truth.max(initial=0)) + 1)
    aims = aims or [DEEPEST] * len(classes)
    if begun_by is None:
        begun_by = [[[first_click(truth == label, spacing_mm, aim)]] for label, aim in zip(classes, aims, strict=True)]
    clicks: Clicks = [list(gestures[0]) for gestures in begun_by]
    for number in range(1, rounds + 1):
        labels = segment([list(of_class) for of_class in clicks])
        yield ClickedRound(number, tuple(map(tuple, clicks)), labels)
        if number == rounds:
            return
        for label, of_class, aim, gestures in zip(classes, clicks, aims, begun_by, strict=True):
            if number < len(gestures):
                of_class.extend(gestures[number])
                continue
            correction = next_click(labels == label, truth == label, spacing_mm, with_negatives, aim)
            if correction:
                of_class.append(correction)


def first_click(truth: np.ndarray, spacing_mm: Sequence[float], aim: Aim = DEEPEST) -> Click:
    """A positive click on a structure.

    Raises:
        ValueError: the structure has no voxel.
    """
    if not truth.any():
        raise ValueError("cannot click on a structure that has no voxel")
    return Click(aim.at_structure(truth, spacing_mm), positive=True)


def next_click(
    predicted: np.ndarray,
    truth: np.ndarray,
    spacing_mm: Sequence[float],
    with_negatives: bool = True,
    aim: Aim = DEEPEST,
) -> Click | None:
    """A click on the largest error: positive where voxels were missed, negative where taken wrongly.

    Args:
        predicted: (K, J, I) bool.
        truth: (K, J, I) bool.
        spacing_mm: of the voxels, along (K, J, I).
        with_negatives: whether the method takes negative clicks; else only what was missed is looked at.
        aim: where in the error.

    Returns:
        The click, or None where there is no error.
    """
    missed = largest_component(truth & ~predicted)
    taken = largest_component(predicted & ~truth) if with_negatives else np.zeros_like(missed)
    if not missed.any() and not taken.any():
        return None
    positive = bool(np.count_nonzero(missed) >= np.count_nonzero(taken))
    return Click(aim.at_error(missed if positive else taken, spacing_mm), positive)
