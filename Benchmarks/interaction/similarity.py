"""What a click costs: `python dev.py bench similarity`.

Times an update of all classes' maps and iso values after one more point, at 80³ cells of 384 channels, five classes, for
different numbers of points that are there already. The features are made up: only their number matters here. The floor is to
read the features that are compared once and to write the maps once, at the speed at which this machine copies memory. Writes
`similarity.json` and `similarity.md` to Benchmarks/results.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from Benchmarks.shared.machine import machine
from ViTTransferFunction.Logic.core.annotations import AnnotatedClass
from ViTTransferFunction.Logic.core.geometry import Geometry
from ViTTransferFunction.Logic.core.volume import Volume
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession

RESULTS = Path(__file__).parents[1] / "results"
CHANNELS = 384
CLASSES = 5
POINTS_BEFORE = (5, 10, 25, 50, 100)
UPDATES = 10


def main() -> None:
    """Measure, and write what was measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=80, help="along each edge (default 80)")
    options = parser.parse_args()
    session = session_of(options.cells)
    floor_ms = 1e3 * floor_seconds(session.features.array, CLASSES)
    rows = [{"points": points, "update_ms": update_ms(session, points)} for points in POINTS_BEFORE]
    worst = max(row["update_ms"] for row in rows)
    measured: dict[str, Any] = {
        "machine": machine(),
        "cells": options.cells,
        "floor_ms": floor_ms,
        "rows": rows,
        "summary": {"update_ms": worst, "floor_ratio": worst / floor_ms},
    }
    write(measured)


def session_of(cells: int) -> SegmentationSession:
    """A session on made-up features of a volume of noise, two voxels a cell."""
    rng = np.random.default_rng(0)
    shape = (2 * cells,) * 3
    volume = Volume(rng.normal(0.0, 100.0, shape).astype(np.float32), Geometry(shape, np.eye(4)))
    array = rng.standard_normal((cells, cells, cells, CHANNELS), dtype=np.float32).astype(np.float16)
    session = SegmentationSession(volume, PRESETS[DEFAULT_PRESET])
    session.use_features(FeatureVolume(array, volume.geometry.resized((cells,) * 3), "made up"))
    return session


def update_ms(session: SegmentationSession, points: int) -> float:
    """Median milliseconds of an update after one more point, `points` of all classes together being there already."""
    rng = np.random.default_rng(points)
    edge = session.volume.shape[0]
    positions = [rng.uniform(0.0, edge - 1.0, (points // CLASSES, 3)) for _ in range(CLASSES)]
    session.low_resolution_maps(classes_of(positions))
    milliseconds = []
    for _ in range(UPDATES):
        positions[0] = np.concatenate([positions[0], rng.uniform(0.0, edge - 1.0, (1, 3))])
        classes = classes_of(positions)
        milliseconds.append(1e3 * seconds_of(lambda classes=classes: session.low_resolution_maps(classes)))  # type: ignore[misc]
    return float(np.median(milliseconds))


def classes_of(positions: list[np.ndarray]) -> list[AnnotatedClass]:
    """A class for each array of positive points."""
    return [AnnotatedClass(f"class {n}", (0.0, 0.0, 0.0), points) for n, points in enumerate(positions)]


def floor_seconds(features: np.ndarray, classes: int) -> float:
    """Seconds to read the features and to write the maps, at the speed at which memory is copied."""
    target = np.empty_like(features)
    copy_s = min(seconds_of(lambda: np.copyto(target, features)) for _ in range(5))
    maps_bytes = classes * features.nbytes / features.shape[-1]
    # A copy reads and writes each byte.
    return copy_s * (features.nbytes + maps_bytes) / (2 * features.nbytes)


def seconds_of(work: Callable[[], Any]) -> float:
    """How long it takes."""
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def write(measured: dict[str, Any]) -> None:
    """Write and print the results."""
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / "similarity.json").write_text(json.dumps(measured, indent=1) + "\n", encoding="utf-8")
    machine, cells = measured["machine"], measured["cells"]
    lines = [
        "# A click",
        "",
        f"{machine['processor']}, {machine['cores']} cores; {cells}³ cells of {CHANNELS} channels, {CLASSES} classes.",
        f"Floor, to read the compared features and write the maps once: {measured['floor_ms']:.1f} ms.",
        "",
        "| points there already | update | times the floor |",
        "|---|---|---|",
        *(
            f"| {row['points']} | {row['update_ms']:.0f} ms | {row['update_ms'] / measured['floor_ms']:.1f} |"
            for row in measured["rows"]
        ),
    ]
    text = "\n".join(lines) + "\n"
    (RESULTS / "similarity.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
