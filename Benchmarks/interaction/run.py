"""How long a click takes until the overlay shows it, and how long the window is ever blocked.

    python dev.py bench interaction [--weights PATH]

Drives the session of the Slicer module on a real scene, without views: what Slicer takes to draw is not counted. The event loop
is one that holds Python's lock while it idles, as Slicer's does, and asks the session for news as often as the panel has it do.
The features are made up, at 64³ cells with 384 channels, since only their number matters here; with --weights, features are
also extracted for real, to see whether that blocks. Volumes whose features are in the cache are opened as they are while the
panel is open (`cached_opening`): the made-up one and, with --scan and --weights, a scan at the default's number of cells. A
result of 512×512×600 voxels is handed over and written as segments (`large_result`). Then what the session computes for a
click is timed alone, at 80³ cells, and compared with the least that it could take (`update_cost`).
Writes `interaction.json` and `interaction.md`.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from trame_slicer.core import SlicerApp

from Benchmarks.interaction.cached_opening import measure_cached_opening
from Benchmarks.interaction.large_result import measure_large_result
from Benchmarks.interaction.made_up_volume import CELLS, cache_features, centres, phantom
from Benchmarks.interaction.update_cost import CHANNELS, measure_updates
from Benchmarks.interaction.watched_session import open_session
from Benchmarks.shared.arguments import benchmark_parser
from Benchmarks.shared.cache_of_its_own import cache_of_its_own
from Benchmarks.shared.machine import in_words, machine
from Benchmarks.shared.report_files import write_results
from Benchmarks.shared.report_tables import paragraphs, table
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.session.opening import open_session as open_volume
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET
from ViTTransferFunction.Logic.session.settings import SessionSettings

CLASSES = 5
PAUSES_S = (0.1, 0.4, 0.5, 1.0)
"""Between one click's answer and the next click. After a tenth of a second nothing else has begun yet; at four and five tenths
the refinement runs, and has to be given up; after a second it is done, unless it is slow. They come in turns, since every click
leaves a point, and maps of more points take longer."""


def main() -> None:
    """Measure, and write what was measured."""
    parser = benchmark_parser(__doc__)
    parser.add_argument("--weights", type=Path, help="file of dinov2_vits14_focus, to extract features for real")
    parser.add_argument("--scan", type=Path, help="a scan whose features are to be opened out of the cache, for real")
    parser.add_argument("--size", type=int, default=256, help="voxels along each edge of the volume (default 256)")
    parser.add_argument("--clicks", type=int, default=20, help="clicks that are timed at each pace (default 20)")
    options = parser.parse_args()
    with cache_of_its_own():
        volume = phantom((options.size, options.size, options.size))
        measured: dict[str, Any] = {
            "machine": machine(),
            "volume": options.size,
            "cells": CELLS,
            "classes": CLASSES,
            "clicks": measure_clicks(volume, options.clicks),
            "cached_opening": {"made up": measure_cached_opening(SlicerApp(), volume)},
        }
        if options.weights and options.scan:
            measured["cached_opening"][options.scan.name] = measure_scan_opening(options.scan, options.weights)
        if options.weights:
            measured["extraction"] = measure_extraction(volume, options.weights)
        measured["large_result"] = measure_large_result()
    measured["updates"] = measure_updates()
    write_results(options.results, "interaction", {**measured, "summary": summary(measured)}, text(measured))


def summary(measured: dict[str, Any]) -> dict[str, float]:
    """The figures that are tracked."""
    paces, updates = measured["clicks"]["paces"], measured["updates"]
    update_ms = max(row["update_ms"] for row in updates["rows"])
    large = {name: measured["large_result"][name] for name in ("hand_over", "writing")}
    return {
        "click_ms": max(pace["median_ms"] for pace in paces),
        "click_worst_ms": max(pace["worst_ms"] for pace in paces),
        "blocked_ms": max(
            part["blocked_ms"] for part in (measured["clicks"], measured.get("extraction"), *large.values()) if part
        ),
        "cached_ready_s": max(opening["ready_s"] for opening in measured["cached_opening"].values()),
        "cached_first_map_s": max(opening["first_map_s"] for opening in measured["cached_opening"].values()),
        "large_labels_s": large["hand_over"]["median_s"],
        "update_ms": update_ms,
        "update_floor_ratio": update_ms / updates["floor_ms"],
    }


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
    places = volume.geometry.ijk_to_ras_points(centres(volume.shape)[:, ::-1])
    for id_, place in zip(ids, places, strict=True):
        session.annotations.add_points(id_, place[None], positive=True)
    watched.until(lambda: not session.busy)
    milliseconds: dict[float, list[float]] = {pause: [] for pause in PAUSES_S}
    of_all: list[float] = []
    for pause_s in PAUSES_S * clicks:
        pause_ends = time.perf_counter() + pause_s
        watched.until(lambda: time.perf_counter() > pause_ends)  # noqa: B023
        point = places[:1] + rng.normal(0.0, volume.shape[0] / 30, (1, 3))
        began = time.perf_counter()
        watched.call(session.annotations.add_points, ids[0], point, positive=True)
        watched.until(lambda: session.selected_up_to_date)
        milliseconds[pause_s].append(1e3 * (time.perf_counter() - began))
        watched.until(lambda: session.up_to_date)
        of_all.append(1e3 * (time.perf_counter() - began))
    refined_s = watched.until(lambda: not session.busy)
    session.close()
    return {
        "paces": [
            {"pause_s": pause_s, "median_ms": float(np.median(values)), "worst_ms": max(values)}
            for pause_s, values in milliseconds.items()
        ],
        "all_classes": {"median_ms": float(np.median(of_all)), "worst_ms": max(of_all)},
        "points": [CLASSES, CLASSES + clicks * len(PAUSES_S)],
        "blocked_ms": watched.longest_ms,
        "features_loaded_s": loaded_s,
        "refined_after_s": refined_s,
    }


def measure_scan_opening(scan: Path, weights: Path) -> dict[str, float]:
    """How long a scan takes to be opened whose features were computed before; as many cells as the default has."""
    volume = read_volume(scan)
    preset, model = DEFAULT_PRESET, "dinov2_vits14_focus"
    open_volume(volume, SessionSettings(preset=preset, model=model, weights_path=str(weights))).load_features()
    return measure_cached_opening(SlicerApp(), volume, preset=preset, model=model, weightsPath=str(weights))


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


def text(measured: dict[str, Any]) -> str:
    """The report for people."""
    updates = measured["updates"]
    return paragraphs(
        "# Interaction",
        f"{in_words(measured['machine'])}.",
        "## From a click to the overlay",
        f"{measured['volume']}³ voxels, {measured['cells']}³ cells, {measured['classes']} classes, "
        "{} points in the beginning and {} in the end.".format(*measured["clicks"]["points"]),
        table(["what", "time"], window_rows(measured)),
        "## The maps alone",
        f"Maps and iso values of {updates['classes']} classes after one more point, and of the class that got it, at "
        f"{updates['cells']}³ cells of {CHANNELS} channels. The floor, to read the compared features and write the maps once: "
        f"{updates['floor_ms']:.1f} ms.",
        table(
            ["points there already", "the class that got the point", "all classes", "times the floor"],
            [
                [
                    row["points"],
                    f"{row['first_ms']:.0f} ms",
                    f"{row['update_ms']:.0f} ms",
                    f"{row['update_ms'] / updates['floor_ms']:.1f}",
                ]
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
    of_all = clicks["all_classes"]
    what = "and the maps of all classes, at all paces: median (slowest)"
    yield what, f"{of_all['median_ms']:.0f} ms ({of_all['worst_ms']:.0f} ms)"
    yield "cached features loaded, from choosing the volume, compute process included", f"{clicks['features_loaded_s']:.1f} s"
    for name, opening in measured["cached_opening"].items():
        what = f"cached features ({name}), the panel being open, from choosing the volume to ready for clicks"
        yield f"{what}: median (slowest)", f"{opening['ready_s']:.2f} s ({opening['ready_worst_s']:.2f} s)"
        yield "and to the map of a click at once then", f"{opening['first_map_s']:.2f} s ({opening['first_map_worst_s']:.2f} s)"
    yield "all classes refined, from the answer to the last click", f"{clicks['refined_after_s']:.1f} s"
    yield "longest that the window was blocked", f"{clicks['blocked_ms']:.0f} ms"
    large = measured["large_result"]
    k, j, i = large["shape"]
    size, hand_over, writing = f"{i}×{j}×{k}", large["hand_over"], large["writing"]
    yield (
        f"labels of {size} voxels handed over: median (slowest)",
        f"{hand_over['median_s']:.2f} s ({hand_over['worst_s']:.2f} s)",
    )
    yield "longest that the window was blocked by that", f"{hand_over['blocked_ms']:.0f} ms"
    yield f"such labels written as {writing['segments']} segments, a little at a time", f"{writing['seconds']:.2f} s"
    yield "longest that the window was blocked by that", f"{writing['blocked_ms']:.0f} ms"
    if "extraction" in measured:
        extraction = measured["extraction"]
        what = f"longest that it was blocked while features were extracted, {extraction['seconds']:.0f} s at grid "
        yield f"{what}{extraction['grid']}", f"{extraction['blocked_ms']:.0f} ms"


if __name__ == "__main__":
    main()
