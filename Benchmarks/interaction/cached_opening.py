"""How long a volume takes to be ready for clicks whose features are in the cache, the panel being open for a while."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from Benchmarks.interaction.watched_session import Watched
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.scenes import add_parameter_node, add_volume

STARTING_S = 8.0
"""For the compute process to start and to load PyTorch: as long as somebody takes who opens the panel and chooses a volume."""
OPENINGS = 5
"""Each with a compute process of its own."""


def measure_cached_opening(app: Any, volume: Volume, **parameters: Any) -> dict[str, float]:
    """Seconds from choosing the volume to the phase in which clicks are answered, and to the first map of a click at once then.

    Args:
        app: has the scene.
        volume: whose features are in the cache.
        parameters: of the panel, by name.

    Returns:
        Medians, and the slowest.
    """
    node = add_volume(app.scene, volume)
    ready_s, first_map_s = np.transpose([_opened(app, node, volume, parameters) for _ in range(OPENINGS)])
    return {
        "ready_s": float(np.median(ready_s)),
        "ready_worst_s": float(ready_s.max()),
        "first_map_s": float(np.median(first_map_s)),
        "first_map_worst_s": float(first_map_s.max()),
    }


def _opened(app: Any, node: Any, volume: Volume, parameters: dict[str, Any]) -> tuple[float, float]:
    watched = Watched(SceneSession(app.scene, app.app_logic, add_parameter_node(app.scene)))
    session = watched.session
    for name, value in parameters.items():
        session.parameters.set(name, value)
    session.start_computing()
    started = time.perf_counter()
    watched.until(lambda: time.perf_counter() > started + STARTING_S)
    chosen = time.perf_counter()
    watched.call(session.set_volume, node)
    watched.until(lambda: session.phase == "ready" or bool(session.errors))
    if session.errors:
        raise RuntimeError(session.errors)
    ready_s = time.perf_counter() - chosen
    structure = watched.call(session.annotations.add_class, "structure").id
    middle = volume.geometry.ijk_to_ras_points(np.array([volume.shape[::-1]]) / 2.0)
    watched.call(session.annotations.add_points, structure, middle, positive=True)
    watched.until(lambda: session.up_to_date)
    first_map_s = time.perf_counter() - chosen
    session.annotations.remove_class(structure)
    session.set_volume(None)
    session.close()
    return ready_s, first_map_s
