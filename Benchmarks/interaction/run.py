"""How long a click takes until the overlay shows it, and how long the window is ever blocked.

    python dev.py bench interaction [--weights PATH]

Drives the session of the Slicer module on a real scene, without views: what Slicer takes to draw is not counted. The features
are made up, at 64³ cells with 384 channels, since only their number matters here; with --weights, features are also extracted
for real, to see whether that blocks. Then what the session computes for a click is timed alone, at 80³ cells, and compared
with the least that it could take (`update_cost`). Writes `interaction.json` and `interaction.md`.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from trame_slicer.core import SlicerApp

from Benchmarks.interaction.update_cost import CHANNELS, measure_updates
from Benchmarks.shared.arguments import benchmark_parser
from Benchmarks.shared.machine import in_words, machine
from Benchmarks.shared.report_files import write_results
from Benchmarks.shared.report_tables import paragraphs, table
from ViTTransferFunction.Logic.core.geometry import Geometry
from ViTTransferFunction.Logic.core.volume import Volume
from ViTTransferFunction.Logic.features.cache import FeatureCache
from ViTTransferFunction.Logic.features.device import choose_device
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.features.settings import feature_key
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.weights.models import pretrained_model
from ViTTransferFunction.Testing.support.scenes import add_parameter_node, add_volume

CELLS = 64
CLASSES = 5
PAUSES_S = (0.1, 0.5, 1.0)
"""Between one click's answer and the next click. After a tenth of a second nothing else has begun yet; after half of one, the
3D rendering and the refinement have, and have to be given up."""
TICK_S = 0.005
"""How often the session is polled: a quarter of the panel's interval, so that little of what is measured is waiting for it."""


class Watched:
    """A session whose every call is timed, as the window would feel it."""

    def __init__(self, session: SceneSession) -> None:
        self.session = session
        self.longest_ms = 0.0

    def call(self, function: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
        """Call the session, and note how long it took."""
        began = time.perf_counter()
        result = function(*arguments, **named)
        self.longest_ms = max(self.longest_ms, 1e3 * (time.perf_counter() - began))
        return result

    def until(self, finished: Callable[[], bool]) -> float:
        """Poll until `finished`; the seconds that took."""
        began = time.perf_counter()
        while not finished():
            self.call(self.session.poll)
            time.sleep(TICK_S)
        return time.perf_counter() - began


def main() -> None:
    """Measure, and write what was measured."""
    parser = benchmark_parser(__doc__)
    parser.add_argument("--weights", type=Path, help="file of dinov2_vits14_focus, to extract features for real")
    parser.add_argument("--size", type=int, default=256, help="voxels along each edge of the volume (default 256)")
    parser.add_argument("--clicks", type=int, default=30, help="clicks that are timed at each pace (default 30)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as cache:
        os.environ["VITTF_CACHE"] = cache
        volume = phantom(options.size)
        measured: dict[str, Any] = {
            "machine": machine(),
            "volume": options.size,
            "cells": CELLS,
            "classes": CLASSES,
            "clicks": measure_clicks(volume, options.clicks),
        }
        if options.weights:
            measured["extraction"] = measure_extraction(volume, options.weights)
    measured["updates"] = measure_updates()
    write_results(options.results, "interaction", {**measured, "summary": summary(measured)}, text(measured))


def summary(measured: dict[str, Any]) -> dict[str, float]:
    """The figures that are tracked."""
    paces, updates = measured["clicks"]["paces"], measured["updates"]
    update_ms = max(row["update_ms"] for row in updates["rows"])
    return {
        "click_ms": paces[0]["median_ms"],
        "click_worst_ms": max(pace["worst_ms"] for pace in paces),
        "blocked_ms": max(part["blocked_ms"] for part in (measured["clicks"], measured.get("extraction")) if part),
        "update_ms": update_ms,
        "update_floor_ratio": update_ms / updates["floor_ms"],
    }


def phantom(size: int) -> Volume:
    """Balls of different brightness in noise, (size, size, size) int16 at 1 mm."""
    rng = np.random.default_rng(0)
    array = rng.normal(0.0, 10.0, (size, size, size)).astype(np.float32)
    k, j, i = np.ogrid[:size, :size, :size]
    for value, centre in zip((100, 200, 300, 400, 500), centres(size), strict=True):
        array[(k - centre[0]) ** 2 + (j - centre[1]) ** 2 + (i - centre[2]) ** 2 < (size / 8) ** 2] += value
    return Volume(array.astype(np.int16), Geometry(array.shape, np.diag([1.0, 1.0, 1.0, 1.0])), "phantom")


def centres(size: int) -> np.ndarray:
    """Of the five balls, (k, j, i)."""
    return size * np.array([[0.3, 0.3, 0.3], [0.7, 0.3, 0.3], [0.3, 0.7, 0.3], [0.3, 0.3, 0.7], [0.7, 0.7, 0.7]])


def cache_features(volume: Volume) -> None:
    """Features in which each ball has a direction of its own, as if they had been extracted."""
    rng = np.random.default_rng(1)
    step = volume.shape[0] // CELLS
    brightness = volume.array[step // 2 :: step, step // 2 :: step, step // 2 :: step]
    directions = rng.normal(0.0, 1.0, (6, CHANNELS)).astype(np.float16)
    array = directions[np.clip(np.rint(brightness / 100), 0, 5).astype(int)]
    array += 0.5 * rng.standard_normal(array.shape, dtype=np.float32).astype(np.float16)
    preset = PRESETS[DEFAULT_PRESET]
    model = pretrained_model(preset.model)
    key = feature_key(volume, model.name, model.sha256 or "", preset.features, choose_device("auto"))
    FeatureCache().put(FeatureVolume(array, volume.geometry.resized((CELLS, CELLS, CELLS)), key))


def measure_clicks(volume: Volume, clicks: int) -> dict[str, Any]:
    """Milliseconds from a point placed to the overlay updated, on cached features, five classes."""
    cache_features(volume)
    app = SlicerApp()
    watched = open_session(app, volume)
    session = watched.session
    loaded_s = watched.until(lambda: session.phase == "ready")
    ids = [watched.call(session.annotations.add_class, f"ball {n}").id for n in range(CLASSES)]
    watched.call(session.select_class, ids[0])
    rng = np.random.default_rng(2)
    places = volume.geometry.ijk_to_ras_points(centres(volume.shape[0])[:, ::-1])
    for id_, place in zip(ids, places, strict=True):
        session.annotations.add_points(id_, place[None], positive=True)
    watched.until(lambda: not session.busy)
    milliseconds: dict[float, list[float]] = {}
    for pause_s in [pause for pause in PAUSES_S for _ in range(clicks)]:
        point = places[:1] + rng.normal(0.0, volume.shape[0] / 30, (1, 3))
        began = time.perf_counter()
        watched.call(session.annotations.add_points, ids[0], point, positive=True)
        watched.until(lambda: session.up_to_date)
        milliseconds.setdefault(pause_s, []).append(1e3 * (time.perf_counter() - began))
        pause_ends = time.perf_counter() + pause_s
        watched.until(lambda: time.perf_counter() > pause_ends)  # noqa: B023
    refined_s = watched.until(lambda: not session.busy)
    session.close()
    return {
        "paces": [
            {"pause_s": pause_s, "median_ms": float(np.median(values)), "worst_ms": max(values)}
            for pause_s, values in milliseconds.items()
        ],
        "blocked_ms": watched.longest_ms,
        "features_loaded_s": loaded_s,
        "refined_after_s": refined_s,
    }


def measure_extraction(volume: Volume, weights: Path) -> dict[str, Any]:
    """How long the window is blocked while features are extracted, at a coarse grid."""
    app = SlicerApp()
    watched = open_session(app, volume, model="dinov2_vits14_focus", weightsPath=str(weights), grid=32)
    session = watched.session
    watched.until(lambda: session.estimate is not None)
    watched.call(session.start_extraction)
    seconds = watched.until(lambda: session.phase == "ready")
    session.close()
    return {"grid": 32, "seconds": seconds, "blocked_ms": watched.longest_ms}


def open_session(app: Any, volume: Volume, **parameters: Any) -> Watched:
    """A session on `volume`."""
    node = add_volume(app.scene, volume)
    watched = Watched(SceneSession(app.scene, app.app_logic, add_parameter_node(app.scene)))
    for name, value in parameters.items():
        watched.session.parameters.set(name, value)
    watched.call(watched.session.set_volume, node)
    return watched


def text(measured: dict[str, Any]) -> str:
    """The report for people."""
    updates = measured["updates"]
    return paragraphs(
        "# Interaction",
        f"{in_words(measured['machine'])}.",
        "## From a click to the overlay",
        f"{measured['volume']}³ voxels, {measured['cells']}³ cells, {measured['classes']} classes.",
        table(["what", "time"], window_rows(measured)),
        "## The maps alone",
        f"Maps and iso values of {updates['classes']} classes after one more point, at {updates['cells']}³ cells of {CHANNELS} "
        f"channels. The floor, to read the compared features and write the maps once: {updates['floor_ms']:.1f} ms.",
        table(
            ["points there already", "update", "times the floor"],
            [
                [row["points"], f"{row['update_ms']:.0f} ms", f"{row['update_ms'] / updates['floor_ms']:.1f}"]
                for row in updates["rows"]
            ],
        ),
    )


def window_rows(measured: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """What the user waits for, and how long."""
    clicks = measured["clicks"]
    for pace in clicks["paces"]:
        what = f"point placed to overlay updated, {pace['pause_s']:g} s after the one before: median (slowest)"
        yield what, f"{pace['median_ms']:.0f} ms ({pace['worst_ms']:.0f} ms)"
    yield "cached features loaded, from choosing the volume", f"{clicks['features_loaded_s']:.1f} s"
    yield "all classes refined, from the last click", f"{clicks['refined_after_s']:.1f} s"
    yield "longest that the window was blocked", f"{clicks['blocked_ms']:.0f} ms"
    if "extraction" in measured:
        extraction = measured["extraction"]
        what = f"longest that it was blocked while features were extracted, {extraction['seconds']:.0f} s at grid "
        yield f"{what}{extraction['grid']}", f"{extraction['blocked_ms']:.0f} ms"


if __name__ == "__main__":
    main()
