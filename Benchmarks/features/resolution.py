"""Feature resolution against accuracy: `python dev.py bench resolution --volumes DIR [--weights PATH]`.

The paper's §V-C with numbers: it compares renderings of the ribs from features of 64³, 80³ and 96³, before and after
refinement. Here the structures of labelled scans are annotated by the simulated clicker, with everything as in the default
preset but the feature grid; the network sees more patches in the same proportion. Writes `resolution.json`, `resolution.md` and
`resolution.png`.
"""

from __future__ import annotations

import json
import math
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from Benchmarks.accuracy.methods import SessionMethod
from Benchmarks.accuracy.runs import Rounds, run_on_clicks, run_with_own_clicks
from Benchmarks.shared.arguments import scan_parser, weights_of
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.labelled_cases import SCANS, LabelledVolume
from Benchmarks.shared.machine import machine
from Benchmarks.shared.report_tables import number, table
from Benchmarks.shared.simulated_clicker import MOST_CLICKS
from ViTTransferFunction.Logic.core.atomic_file import replacing
from ViTTransferFunction.Logic.features.device import choose_device
from ViTTransferFunction.Logic.features.extraction import extract_features
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.session.segmentation_session import open_network

GRIDS = (48, 64, 80, 96)
CASES = ("amos_0336", "torso_small")
REPORTED_CLICKS = ("1", "3", "5", "10")
REFINED = SessionMethod("refined")
UNREFINED = SessionMethod("not refined", refinement="none")


def main() -> None:
    """Measure every grid on every case, and write what was measured."""
    parser = scan_parser(__doc__, CASES)
    parser.add_argument("--grids", nargs="*", type=int, default=GRIDS, help="cells along the longest edge")
    parser.add_argument("--keep", type=Path, help="folder for what was measured; what is there is taken as it is")
    options = parser.parse_args()
    weights = weights_of(options)
    network = open_network(weights, choose_device("auto"))
    kept = KeptResults(options.keep)
    rows = []
    for case in SCANS:
        if case.name in options.cases:
            labelled = case.read(options.volumes)
            for grid in options.grids:
                measured = kept.get(f"resolution, {case.name}, {grid}", partial(measure, labelled, network, grid))
                rows.append({"case": case.name, "grid": grid, **measured})
    write_report({"model": weights.model.name, "machine": machine(), "rows": rows}, options.results)
    print((options.results / "resolution.md").read_text(encoding="utf-8"))


def measure(labelled: LabelledVolume, network: VisionTransformer, grid: int) -> dict[str, Any]:
    """Cost of features at this grid, and mean Dice by clicks, refined and, on the same clicks, not."""
    settings = replace(PRESETS[DEFAULT_PRESET].features, grid=grid)
    start = time.perf_counter()
    features = extract_features(labelled.volume, network, settings)
    seconds = time.perf_counter() - start
    refined, clicks = run_with_own_clicks(
        labelled, REFINED.segmenter(labelled.volume, features), "together", MOST_CLICKS, with_negatives=True
    )
    numbers = [int(clicks) for clicks in REPORTED_CLICKS]
    unrefined = run_on_clicks(labelled, UNREFINED.segmenter(labelled.volume, features), "together", clicks, numbers)
    return {
        "cells": math.prod(features.geometry.shape),
        "feature_seconds": seconds,
        "update_seconds": _mean(refined, "seconds")[REPORTED_CLICKS[-1]],
        "refined": _mean(refined, "dice"),
        "not refined": _mean(unrefined, "dice"),
    }


def write_report(report: dict[str, Any], folder: Path) -> None:
    """Write resolution.json, resolution.md and resolution.png."""
    summary: dict[str, Any] = {}
    for row in report["rows"]:
        summary.setdefault(row["case"], {})[str(row["grid"])] = row["refined"]
    with replacing(folder / "resolution.json") as path:
        path.write_text(json.dumps({**report, "summary": {"mean_dice": summary}}, indent=1) + "\n", encoding="utf-8")
    with replacing(folder / "resolution.md") as path:
        path.write_text(_text(report), encoding="utf-8")
    _plot(report["rows"], folder / "resolution.png")


def _mean(rounds: Rounds, metric: str) -> dict[str, float]:
    return {
        clicks: round(float(np.mean([metrics[metric] for metrics in structures.values()])), 4)
        for clicks, structures in rounds.items()
    }


def _text(report: dict[str, Any]) -> str:
    header = ["volume", "grid", "cells", "features, s", f"update at {REPORTED_CLICKS[-1]} clicks, s"]
    header += [f"Dice @{clicks}, {kind}" for kind in ("not refined", "refined") for clicks in REPORTED_CLICKS]
    rows = [
        [
            row["case"],
            str(row["grid"]),
            f"{row['cells']:,}",
            number(row["feature_seconds"], 1),
            number(row["update_seconds"], 2),
            *(number(row[kind][clicks]) for kind in ("not refined", "refined") for clicks in REPORTED_CLICKS),
        ]
        for row in report["rows"]
    ]
    machine = f"{report['machine']['processor']}, {report['machine']['cores']} cores"
    intro = (
        f"Features of {report['model']}, default preset but for the grid. {machine}. Command: `python dev.py bench resolution`."
    )
    return "\n\n".join(["# Feature resolution", intro, table(header, rows), "![Dice by grid](resolution.png)"]) + "\n"


def _plot(rows: list[dict[str, Any]], path: Path) -> None:
    """Mean Dice by grid at 5 and 10 clicks, one panel for each volume."""
    import matplotlib.pyplot as plt

    cases = list(dict.fromkeys(row["case"] for row in rows))
    figure, panels = plt.subplots(1, len(cases), figsize=(4.8 * len(cases), 3.8), sharey=True, squeeze=False)
    for axes, case in zip(panels[0], cases, strict=True):
        of_case = [row for row in rows if row["case"] == case]
        grids = [row["grid"] for row in of_case]
        for kind, style in (("refined", "-"), ("not refined", "--")):
            for clicks, color in (("5", "#1565c0"), ("10", "#c1272d")):
                dice = [row[kind][clicks] for row in of_case]
                axes.plot(grids, dice, style, color=color, marker="o", markersize=4, label=f"{clicks} clicks, {kind}")
        axes.set(title=case, xlabel="cells along the longest edge", ylabel="mean Dice", xticks=grids)
        axes.grid(color="0.9")
        axes.tick_params(labelleft=True)
    panels[0][0].legend(fontsize=8.5, frameon=False)
    figure.tight_layout()
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=120)
    plt.close(figure)


if __name__ == "__main__":
    main()
