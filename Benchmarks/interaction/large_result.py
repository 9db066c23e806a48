"""How long the result of a large scan takes from the compute process into segments, and how long the window is blocked."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from trame_slicer.core import SlicerApp

from Benchmarks.interaction.made_up_volume import Shape, cache_features, centres, phantom
from Benchmarks.interaction.watched_session import open_session
from ViTTransferFunction.Testing.support.scenes import segment_masks

SHAPE: Shape = (600, 512, 512)


def measure_large_result(shape: Shape = SHAPE) -> dict[str, Any]:
    """Five balls as segments; their maps are not refined, since what they look like does not matter here."""
    volume = phantom(shape)
    cache_features(volume)
    watched = open_session(SlicerApp(), volume, refinement="none", rendering="off")
    session = watched.session
    watched.until(lambda: session.phase == "ready")
    for centre in centres(shape):
        id_ = session.annotations.add_class().id
        session.annotations.add_points(id_, volume.geometry.ijk_to_ras_points(centre[None, ::-1]), positive=True)
    watched.until(lambda: not session.busy)
    watched.longest_ms = 0.0
    watched.call(session.write_segments)
    progressed_s = time.perf_counter()

    def written() -> bool:
        nonlocal progressed_s
        if session.progress is not None:
            progressed_s = time.perf_counter()
        return not session.busy

    watched.until(written)
    seconds = time.perf_counter() - progressed_s
    masks = segment_masks(session.parameters.segmentation, session.parameters.volume)
    voxels = int(np.sum([mask.sum() for mask in masks.values()]))
    session.close()
    return {"shape": shape, "segments": len(masks), "voxels": voxels, "seconds": seconds, "blocked_ms": watched.longest_ms}
