"""The figures of the features' benchmark that are tracked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from Benchmarks.features.errors import CLICKS
from Benchmarks.features.settings import DEFAULT, FINE

MAIN_VOLUME = "amos_0336"


def summary(report: dict[str, Any]) -> dict[str, float]:
    """Seconds by class of processors, speed-up over the published way, and what the default costs in Dice; what there is."""
    rows = {(row["case"], row["setting"]): row for row in report["rows"]}
    cases = list(dict.fromkeys(row["case"] for row in report["rows"]))
    figures: dict[str, float] = {}
    for key in dict.fromkeys(row["capability_key"] for row in report["times"]):
        figures |= _of_capability([row for row in report["times"] if row["capability_key"] == key], key)
    if cases:
        changes = [mean_dice(rows[case, DEFAULT]) - mean_dice(rows[case, FINE]) for case in cases]
        figures["dice_change_vs_previous_default"] = float(np.mean(changes))
        figures["dice_change_vs_previous_default_worst_volume"] = min(changes)
        of_default = [rows[case, DEFAULT] for case in cases]
        figures["extra_memory_bytes"] = max(row["peak_bytes"] - row["feature_bytes"] for row in of_default)
    return figures


def mean_dice(row: dict[str, Any], path: int | None = None) -> float:
    """Mean over `CLICKS` and over all paths of clicks, or on one."""
    paths = row["dice"] if path is None else [row["dice"][path]]
    return float(np.mean([of_path[str(clicks)] for of_path in paths for clicks in CLICKS]))


def _of_capability(times: Sequence[dict[str, Any]], key: str) -> dict[str, float]:
    figures = {
        f"first_map_s_{key}": max(row["first_map_s"] for row in times),
        f"seconds_worst_{key}": max(row["seconds"] for row in times),
        f"estimate_off_by_{key}": max(_ratio(row["estimated_seconds"], row["seconds"]) for row in times),
    }
    for row in times:
        if row["volume"] == MAIN_VOLUME:
            figures[f"seconds_amos_{key}"] = row["seconds"]
            figures[f"speedup_vs_published_{key}"] = row["published_seconds"] / row["seconds"]
    return figures


def _ratio(first: float, second: float) -> float:
    return max(first / second, second / first)
