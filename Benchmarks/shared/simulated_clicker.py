"""A user who knows the truth and corrects the largest error, so that methods can be compared by what a click is worth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ViTTransferFunction.Logic.core.bounding_box import bounding_box

MOST_CLICKS = 10

Clicks = list[list["Click"]]


@dataclass(frozen=True)
class Click:
    """One point placed by the user.

    Attributes:
        kji: voxel index along (K, J, I).
        positive: on the structure; otherwise it says that the structure is not there.
    """

    kji: tuple[int, int, int]
    positive: bool


@dataclass(frozen=True, eq=False)
class ClickedRound:
    """The state after every class received one more click, or none where nothing was left to correct.

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
) -> Iterator[ClickedRound]:
    """Annotate all classes of a label map together, one click a class and round.

    Classes annotated one by one are calls with label maps of one class each.

    Args:
        truth: (K, J, I) integers, 0 for background and 1 … n for the classes.
        spacing_mm: of the voxels, along (K, J, I).
        segment: the method: from the clicks of each class, in the order of the labels, to labels like the truth's.
        rounds: how many clicks a class receives at most.
        with_negatives: see `next_click`.

    Raises:
        ValueError: a label between 1 and the largest does not occur.
    """
    classes = range(1, int(truth.max(initial=0)) + 1)
    clicks: Clicks = [[first_click(truth == label, spacing_mm)] for label in classes]
    for number in range(1, rounds + 1):
        labels = segment([list(of_class) for of_class in clicks])
        yield ClickedRound(number, tuple(map(tuple, clicks)), labels)
        if number == rounds:
            return
        for label, of_class in zip(classes, clicks, strict=True):
            correction = next_click(labels == label, truth == label, spacing_mm, with_negatives)
            if correction:
                of_class.append(correction)


def first_click(truth: np.ndarray, spacing_mm: Sequence[float]) -> Click:
    """A positive click at the deepest point of a structure's largest component.

    Raises:
        ValueError: the structure has no voxel.
    """
    component = largest_component(truth)
    if not component.any():
        raise ValueError("cannot click on a structure that has no voxel")
    return Click(deepest_voxel(component, spacing_mm), positive=True)


def next_click(
    predicted: np.ndarray, truth: np.ndarray, spacing_mm: Sequence[float], with_negatives: bool = True
) -> Click | None:
    """A click at the deepest point of the largest error: positive where voxels were missed, negative where taken wrongly.

    Args:
        predicted: (K, J, I) bool.
        truth: (K, J, I) bool.
        spacing_mm: of the voxels, along (K, J, I).
        with_negatives: whether the method takes negative clicks; else only what was missed is looked at.

    Returns:
        The click, or None where there is no error.
    """
    missed = largest_component(truth & ~predicted)
    taken = largest_component(predicted & ~truth) if with_negatives else np.zeros_like(missed)
    if not missed.any() and not taken.any():
        return None
    positive = bool(np.count_nonzero(missed) >= np.count_nonzero(taken))
    return Click(deepest_voxel(missed if positive else taken, spacing_mm), positive)


def largest_component(mask: np.ndarray) -> np.ndarray:
    """The connected component (faces touching) with the most voxels, (K, J, I) bool; the first one of equals."""
    largest = np.zeros(mask.shape, dtype=bool)
    box = bounding_box(mask)
    if box:
        components, _ = ndimage.label(mask[box])
        sizes = np.bincount(components.ravel())
        sizes[0] = 0
        largest[box] = components == sizes.argmax()
    return largest


def deepest_voxel(mask: np.ndarray, spacing_mm: Sequence[float]) -> tuple[int, int, int]:
    """The voxel of a mask that is farthest from its outside, in millimetres; beyond the volume is outside.

    Raises:
        ValueError: the mask is empty.
    """
    box = bounding_box(mask)
    if box is None:
        raise ValueError("an empty mask has no deepest voxel")
    depth_mm = ndimage.distance_transform_edt(np.pad(mask[box], 1), sampling=tuple(spacing_mm))[1:-1, 1:-1, 1:-1]
    k, j, i = np.unravel_index(depth_mm.argmax(), depth_mm.shape)
    return int(k) + box[0].start, int(j) + box[1].start, int(i) + box[2].start
