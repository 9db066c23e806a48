"""How long the result of a large scan takes from the compute process into segments, and how long the window is blocked."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from trame_slicer.core import SlicerApp

from Benchmarks.interaction.made_up_volume import Shape, cache_features, centres, phantom
from Benchmarks.interaction.watched_session import open_session
from ViTTransferFunction.Logic.compute.client import ComputeClient
from ViTTransferFunction.Logic.compute.requests import Extract
from ViTTransferFunction.Logic.scene.segments.segment_output import WRITING
from ViTTransferFunction.Testing.support.event_loop import POLL_S, idle_with_the_lock
from ViTTransferFunction.Testing.support.scenes import segment_masks
from ViTTransferFunction.Testing.support.stub_process import one_reply_of_labels, stub_executable

SHAPE: Shape = (600, 512, 512)
TRIES = 5
START_S = 2.0


def measure_large_result() -> dict[str, Any]:
    """Seconds of the hand-over and of the writing, the longest standstill by either, and how much was written."""
    return {"shape": SHAPE, "hand_over": measure_hand_over(SHAPE), "writing": measure_writing(SHAPE)}


def measure_hand_over(shape: Shape) -> dict[str, float]:
    """Labels of a volume of that shape, from the request to the array; the process that answers has them ready."""
    seconds, blocked_ms = [], 0.0
    for _ in range(TRIES):
        with tempfile.TemporaryDirectory() as folder:
            client = ComputeClient(stub_executable(Path(folder), one_reply_of_labels(shape)))
            # Until the program has started, and has its labels.
            time.sleep(START_S)
            began = time.perf_counter()
            client.request(Extract())
            arrived = False
            while not arrived:
                polled = time.perf_counter()
                arrived = bool(client.replies())
                blocked_ms = max(blocked_ms, 1e3 * (time.perf_counter() - polled))
                if not arrived:
                    idle_with_the_lock(POLL_S)
            seconds.append(time.perf_counter() - began)
            client.close()
    return {"median_s": float(np.median(seconds)), "worst_s": max(seconds), "blocked_ms": blocked_ms}


def measure_writing(shape: Shape) -> dict[str, float]:
    """Five balls, from their labels to segments; their maps are not refined, since what they look like does not matter here."""
    volume = phantom(shape)
    cache_features(volume)
    watched = open_session(SlicerApp(), volume, refinement="none", rendering="off")
    session = watched.session
    watched.until(lambda: session.phase == "ready")
    for centre in centres(shape):
        id_ = session.annotations.add_class().id
        session.annotations.add_points(id_, volume.geometry.ijk_to_ras_points(centre[None, ::-1]), positive=True)
    watched.until(lambda: not session.busy)
    watched.call(session.segments.write)
    watched.until(lambda: not session.busy or (session.progress is not None and session.progress.what == WRITING))
    watched.longest_ms = 0.0
    seconds = watched.until(lambda: not session.busy)
    masks = segment_masks(session.parameters.segmentation, session.parameters.volume)
    voxels = float(np.sum([mask.sum() for mask in masks.values()]))
    session.close()
    return {"segments": len(masks), "voxels": voxels, "seconds": seconds, "blocked_ms": watched.longest_ms}
