"""What a click costs the session alone, against the least that it could cost.

Times an update of all classes' maps and iso values after one more point, at 80³ cells of 384 channels, five classes, for
different numbers of points that are there already, and when the map of the class that got the point is there. The features are
made up: only their number matters here. The floor is to read the features that are compared once and to write the maps once, at
the speed at which this machine copies memory.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from Benchmarks.shared.labelled_cases import classes_of
from Benchmarks.shared.sessions import session_on
from Benchmarks.shared.simulated_clicker import Click, Clicks
from ViTTransferFunction.Logic.compute.server import LOCK_TURN_S
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession

CELLS = 80
"""Along each edge: the paper's middle resolution, finer than the default."""
CHANNELS = 384
CLASSES = tuple(f"class {number}" for number in range(1, 6))
POINTS_BEFORE = (5, 10, 25, 50, 100)
UPDATES = 10


def measure_updates(cells: int = CELLS) -> dict[str, Any]:
    """Milliseconds of an update by how many points there were, and of the floor."""
    session = made_up_session(cells)
    floor_ms = 1e3 * floor_seconds(session.features.array, len(CLASSES))
    with lock_turns_of_the_compute_process():
        rows = [{"points": points, **update_ms(session, points)} for points in POINTS_BEFORE]
    return {"cells": cells, "classes": len(CLASSES), "floor_ms": floor_ms, "rows": rows}


@contextmanager
def lock_turns_of_the_compute_process() -> Iterator[None]:
    """Python's lock changes hands as often as it does there."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(LOCK_TURN_S)
    try:
        yield
    finally:
        sys.setswitchinterval(before)


def made_up_session(cells: int) -> SegmentationSession:
    """A session on random features of a volume of noise, two voxels a cell."""
    rng = np.random.default_rng(0)
    shape = (2 * cells,) * 3
    volume = Volume(rng.normal(0.0, 100.0, shape).astype(np.float32), Geometry(shape, np.eye(4)))
    array = rng.standard_normal((cells, cells, cells, CHANNELS), dtype=np.float32).astype(np.float16)
    return session_on(volume, FeatureVolume(array, volume.geometry.resized((cells,) * 3), "made up"))


def update_ms(session: SegmentationSession, points: int) -> dict[str, float]:
    """Median milliseconds of an update after one more point, `points` of all classes together being there already."""
    rng = np.random.default_rng(points)

    def click() -> Click:
        k, j, i = rng.integers(session.volume.shape).tolist()
        return Click((k, j, i), positive=True)

    def update() -> None:
        requests = classes_of(CLASSES, clicks, session.volume.geometry)
        session.low_resolution_maps(requests, first=requests[0].id, on_first=lambda _: first_came.append(time.perf_counter()))

    clicks: Clicks = [[click() for _ in range(points // len(CLASSES))] for _ in CLASSES]
    first_came: list[float] = []
    update()
    of_all, of_first = [], []
    for _ in range(UPDATES):
        clicks[0].append(click())
        began = time.perf_counter()
        of_all.append(1e3 * seconds_of(update))
        of_first.append(1e3 * (first_came[-1] - began))
    return {"update_ms": float(np.median(of_all)), "first_ms": float(np.median(of_first))}


def floor_seconds(features: np.ndarray, classes: int) -> float:
    """Seconds to read the features and to write the maps, at the speed at which memory is copied."""
    target = np.empty_like(features)
    copy_s = min(seconds_of(partial(np.copyto, target, features)) for _ in range(5))
    maps_bytes = classes * features.nbytes / features.shape[-1]
    # A copy reads and writes each byte.
    return copy_s * (features.nbytes + maps_bytes) / (2 * features.nbytes)


def seconds_of(work: Callable[[], Any]) -> float:
    """How long it takes."""
    began = time.perf_counter()
    work()
    return time.perf_counter() - began
