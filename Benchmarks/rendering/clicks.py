"""How long a click takes until the 3D view shows it: session of the panel, compute process and Slicer's renderer."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from trame_slicer.core import SlicerApp

from Benchmarks.interaction.made_up_volume import cache_features, centres
from Benchmarks.interaction.watched_session import Watched, open_session
from Benchmarks.rendering.stage import Stage, timed
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.scene.mrml.nodes import nodes_of_class

CLASSES = 5
REST_S = 0.3
"""Between what follows a click and the next one."""


def measure_clicks(volume: Volume, pixels: int, clicks: int) -> dict[str, Any]:
    """Milliseconds from a click, on features that are in the cache.

    Args:
        volume: what is clicked on, of which features are put into the cache.
        pixels: along each edge of the 3D view.
        clicks: how many are timed.

    Returns:
        by what is awaited, medians and the slowest: that the maps have come, that the volume of structures is in the scene,
        that it is drawn as while the view is turned; and that it is drawn from refined maps, without a hurry.
    """
    cache_features(volume)
    app = SlicerApp()
    watched = open_session(app, volume)
    stage = Stage(app, volume.geometry, pixels, clicks)
    session = watched.session
    watched.until(lambda: session.phase == "ready")
    ids = [watched.call(session.annotations.add_class, f"ball {n}").id for n in range(CLASSES)]
    places = volume.geometry.ijk_to_ras_points(centres(volume.shape)[:, ::-1])
    for id_, place in zip(ids, places, strict=True):
        session.annotations.add_points(id_, place[None], positive=True)
    watched.until(lambda: not session.busy)
    stage.picture()
    rng = np.random.default_rng(2)
    steps: dict[str, list[float]] = {}
    for _ in range(clicks):
        point = places[:1] + rng.normal(0.0, volume.shape[0] / 30, (1, 3))
        for name, ms in _one_click(watched, stage, ids[0], point).items():
            steps.setdefault(name, []).append(ms)
    session.close()
    return {name: {"median_ms": float(np.median(values)), "worst_ms": max(values)} for name, values in steps.items()}


def _one_click(watched: Watched, stage: Stage, id_: str, point: np.ndarray) -> dict[str, float]:
    session = watched.session
    before = _image(session.parameters.volume)
    stage.set_turning(turning=True)
    began = time.perf_counter()

    def passed_ms() -> float:
        return 1e3 * (time.perf_counter() - began)

    watched.call(session.annotations.add_points, id_, point, positive=True)
    watched.until(lambda: session.up_to_date)
    steps = {"maps": passed_ms()}
    watched.until(lambda: _image(session.parameters.volume) is not before)
    steps["volume of structures"] = passed_ms()
    stage.picture()
    steps["picture"] = passed_ms()
    watched.until(lambda: not session.busy)
    steps["refined volume of structures"] = passed_ms()
    stage.set_turning(turning=False)
    steps["refined picture"] = steps["refined volume of structures"] + timed(stage.picture)[0]
    rest_ends = time.perf_counter() + REST_S
    watched.until(lambda: time.perf_counter() > rest_ends)
    return steps


def _image(volume_node: Any) -> Any:
    """The voxels that 3D views show; None before there are any."""
    nodes = nodes_of_class(volume_node.GetScene(), "vtkMRMLVectorVolumeNode")
    return nodes[0].GetImageData() if nodes else None
