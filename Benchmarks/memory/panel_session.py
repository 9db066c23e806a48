"""What the module takes beside Slicer, as `python -m Benchmarks.memory.panel_session SCAN POINTS WEIGHTS MODEL PRESET`.

Drives the session of the module on a real scene whose scan is loaded: features, structures, segments, and both ways to show
structures in 3D. Counted is what the session's process takes beyond what it had with the scan loaded, and the compute process;
memory that both share, once. Views are not drawn. In a process of its own; prints one line of JSON.
"""

from __future__ import annotations

import json
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
from trame_slicer.core import SlicerApp

from Benchmarks.interaction.watched_session import Watched, open_session
from ViTTransferFunction.Logic.files.annotation_files import read_annotations
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import geometry_from_node

SAMPLED_EVERY_S = 0.05


def main(scan: Path, points: Path, weights: Path, model: str, preset: str) -> None:
    """Measure, and print it."""
    volume = read_volume(scan)
    app = SlicerApp()
    # The scene gets a copy of the voxels, as Slicer has one.
    before = _proportional_bytes(psutil.Process()) + volume.array.nbytes
    watched = open_session(app, volume, model=model, weightsPath=str(weights), preset=preset, device="cpu")
    with _peak_of(watched) as peak:
        _work_through(watched, points)
    watched.session.close()
    print(json.dumps({"panel_peak_bytes": peak[0] - before}))


def _work_through(watched: Watched, points: Path) -> None:
    """Everything that a user has computed."""
    session = watched.session
    watched.until(lambda: session.estimate is not None)
    session.start_extraction()
    watched.until(lambda: session.phase == "ready" and not session.busy)
    volume_node = session.parameters.volume
    assert volume_node is not None
    for given in read_annotations(points, geometry_from_node(volume_node)):
        id_ = session.annotations.add_class(given.name).id
        session.annotations.add_points(id_, given.request.positive, positive=True)
    watched.until(lambda: not session.busy)
    session.segments.write()
    watched.until(lambda: not session.busy)
    session.parameters.set("rendering", "transfer function")
    watched.until(lambda: not session.busy)


@contextmanager
def _peak_of(watched: Watched) -> Iterator[list[int]]:
    """The most bytes that both processes hold together, in the list's only place, while the context lasts."""
    peak, over = [0], threading.Event()

    def sample() -> None:
        while not over.wait(SAMPLED_EVERY_S):
            compute = watched.session.compute_pid
            processes = [psutil.Process()] if compute is None else [psutil.Process(), psutil.Process(compute)]
            peak[0] = max(peak[0], sum(map(_proportional_bytes, processes)))

    sampling = threading.Thread(target=sample)
    sampling.start()
    try:
        yield peak
    finally:
        over.set()
        sampling.join()


def _proportional_bytes(process: psutil.Process) -> int:
    """Held by a process; of memory that it shares, its part. Linux counts that."""
    held: int = process.memory_full_info().pss
    return held


if __name__ == "__main__":
    scan, points, weights, model, preset = sys.argv[1:]
    main(Path(scan), Path(points), Path(weights), model, preset)
