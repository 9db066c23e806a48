"""What a user of the module waits for and what it takes, against what was said: `python -m Benchmarks.features.waiting SCAN …`.

From *Compute features* to "ready", in a compute process as the panel has it, with nothing in its cache: coarse features, which
clicks are answered from meanwhile, then the fine ones, and all that clicks on both need. Prints a line of JSON for each run.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil

from Benchmarks.shared.cache_of_its_own import cache_of_its_own
from ViTTransferFunction.Logic.compute.client import ComputeClient
from ViTTransferFunction.Logic.compute.proxy import SegmentationProxy
from ViTTransferFunction.Logic.compute.requests import TakeVolume
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.session.settings import SessionSettings

RUNS = 2
STARTING_S = 3.0
"""The process is started when the panel is opened, and has loaded its libraries by the time that a scan is chosen: when its
memory has not grown for so long."""
POLL_S = 0.005
MOST_S = 600.0


def main() -> None:
    """Measure what the command line names, and print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scans", type=Path, nargs="+", metavar="SCAN")
    parser.add_argument("--weights", type=Path, required=True)
    options = parser.parse_args()
    settings = SessionSettings(weights_path=str(options.weights), device="cpu")
    for scan in options.scans:
        for _ in range(RUNS):
            print(json.dumps({"scan": scan.name} | waited(read_volume(scan), settings)), flush=True)


def waited(volume: Volume, settings: SessionSettings, starting_s: float = STARTING_S) -> dict[str, Any]:
    """Seconds until the estimate, the first features and the last ones are there; bytes beyond the idle process; what was said.

    Raises:
        RuntimeError: what the compute process said went wrong.
    """
    proxy = SegmentationProxy(lambda: ComputeClient(sys.executable), lambda: True)
    with cache_of_its_own():
        try:
            proxy.start()
            assert proxy.pid is not None
            process = psutil.Process(proxy.pid)
            idle = _bytes_once_started(process, starting_s) + volume.array.nbytes
            proxy.open(TakeVolume(volume.array, volume.geometry, volume.name), settings)
            estimating_s, _ = _until(lambda: proxy.estimate is not None, proxy, process)
            estimate = proxy.estimate
            assert estimate is not None
            proxy.extract()
            first_s, peak_at_first = _until(lambda: proxy.usable, proxy, process)
            last_s, peak = _until(lambda: proxy.phase == "ready", proxy, process)
        finally:
            proxy.close()
    return {
        "estimating_s": estimating_s,
        "first_features_s": first_s,
        "ready_s": first_s + last_s,
        "said_s": estimate.seconds,
        "bytes": max(peak, peak_at_first) - idle,
        "said_bytes": estimate.memory_bytes,
    }


def _bytes_once_started(process: psutil.Process, starting_s: float) -> int:
    """What the idle process has resident when its libraries are loaded: what did not grow for `starting_s` seconds."""
    before, now = -1, 0
    while now > before:
        time.sleep(starting_s)
        before, now = now, process.memory_info().rss
    return now


def _until(condition: Callable[[], bool], proxy: SegmentationProxy, process: psutil.Process) -> tuple[float, int]:
    """Seconds until it holds, and the most bytes that the process had resident meanwhile."""
    started, peak = time.monotonic(), 0
    while not condition():
        if time.monotonic() > started + MOST_S:
            raise RuntimeError(f"still {proxy.phase} after {MOST_S:g} s")
        time.sleep(POLL_S)
        proxy.poll()
        peak = max(peak, process.memory_info().rss)
        if error := proxy.take_error():
            raise RuntimeError(error)
    return time.monotonic() - started, peak


if __name__ == "__main__":
    main()
