"""One structure clicked at a time, beside which the others stay as they are: what a click does to its own and to them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from Benchmarks.accuracy.methods import Segment
from Benchmarks.accuracy.runs import DIGITS
from Benchmarks.shared.aim import Aim
from Benchmarks.shared.labelled_cases import LabelledVolume
from Benchmarks.shared.segmentation_metrics import dice
from Benchmarks.shared.simulated_clicker import Clicks, first_click, next_click


def run_single_clicks(labelled: LabelledVolume, segment: Segment, rounds: int, aims: Sequence[Aim]) -> list[dict[str, Any]]:
    """Every structure is clicked once, then one after the other corrected, up to so many clicks each.

    Returns:
        For each click after the first: the `round`, the `structure`, whether it was `positive`, the `change` of the structure's
        Dice, and the `others`' changes by name.
    """
    truth, spacing_mm = labelled.truth, labelled.spacing_mm
    clicks: Clicks = [[first_click(truth == label, spacing_mm, aim)] for label, aim in enumerate(aims, start=1)]
    labels = segment(labelled, clicks)
    before = _dice_of_all(labels, labelled)
    measured = []
    for number in range(2, rounds + 1):
        for index, (name, aim) in enumerate(zip(labelled.names, aims, strict=True)):
            click = next_click(labels == index + 1, truth == index + 1, spacing_mm, aim=aim)
            if click is None:
                continue
            clicks[index].append(click)
            labels = segment(labelled, clicks)
            after = _dice_of_all(labels, labelled)
            others = {other: round(after[other] - before[other], DIGITS) for other in labelled.names}
            change = others.pop(name)
            measured.append(
                {"round": number, "structure": name, "positive": click.positive, "change": change, "others": others}
            )
            before = after
    return measured


def _dice_of_all(labels: np.ndarray, labelled: LabelledVolume) -> dict[str, float]:
    return {name: dice(labels == label, labelled.truth == label) for label, name in enumerate(labelled.names, start=1)}
