"""Seconds on one volume: `python -m Benchmarks.features.times VOLUME …`, in a process of its own, limited to a capability.

Everything is measured in one run, so that ratios hold where others use the machine as well. Prints one line of JSON.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from Benchmarks.features.generated_volumes import GENERATED
from Benchmarks.features.settings import DEFAULT_SETTINGS, PUBLISHED, SETTINGS
from Benchmarks.shared.labelled_cases import SCANS, classes_of
from Benchmarks.shared.simulated_clicker import Click
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.cost import calibrate, feature_cost
from ViTTransferFunction.Logic.features.device import choose_device
from ViTTransferFunction.Logic.features.extraction import FeatureRun, extract_features
from ViTTransferFunction.Logic.features.networks import open_network
from ViTTransferFunction.Logic.features.progressive import progressive_cost, progressive_features
from ViTTransferFunction.Logic.features.settings import FeatureSettings
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer
from ViTTransferFunction.Logic.features.whitening import normalised_features
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.similarity.kernel_ridge import KernelRidge
from ViTTransferFunction.Logic.weights.sources import find_weights

REPEATS = 3
SAMPLED_SLICES = 8
"""Of each axis of the published way: its slices are all alike, and all of them would take twenty minutes and more."""


def main() -> None:
    """Measure what the command line names, and print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("volume", choices=[*(case.name for case in SCANS), *(volume.name for volume in GENERATED)])
    parser.add_argument("--volumes", type=Path, required=True)
    parser.add_argument("--weights", type=Path, required=True)
    parser.add_argument("--model", required=True)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--published", action="store_true", help="also the published way")
    options = parser.parse_args()
    network = open_network(find_weights(options.model, options.weights), choose_device(options.device))
    # Before anything is timed: a network is converted once in a session, and voxels are digested once.
    network = network.converted(network.device, DEFAULT_SETTINGS.dtype_on(network.device))
    volume = _volume(options.volume, options.volumes)
    _ = volume.digest
    print(json.dumps(measured(volume, network, options.published)))


def measured(volume: Volume, network: VisionTransformer, published: bool) -> dict[str, Any]:
    """Seconds for the estimate, the first map, the default's features alone and after coarse ones, and the published ones.

    They are measured in this order, and what the estimates said comes with them. The least of `REPEATS` counts for all but
    the published way.
    """
    started = time.perf_counter()
    speed = calibrate(network, DEFAULT_SETTINGS)
    calibration_s = time.perf_counter() - started
    cost = feature_cost(volume, DEFAULT_SETTINGS, network, speed)
    report = {
        "voxels": list(volume.shape[::-1]),
        "precision": str(network.dtype).removeprefix("torch."),
        "tokens": cost.tokens,
        "calibration_s": calibration_s,
        "estimated_seconds": cost.seconds,
        "estimated_with_coarse_s": progressive_cost(volume, DEFAULT_SETTINGS, network, speed).seconds,
        "first_map_s": _least(lambda: _first_map(volume, network)),
        "seconds": _least(lambda: extract_features(volume, network, DEFAULT_SETTINGS)),
        "with_coarse_s": _least(lambda: _coarse_and_fine(volume, network)),
    }
    if published:
        settings = SETTINGS[PUBLISHED]
        in_its_precision = network.converted(network.device, settings.dtype_on(network.device))
        report["published_seconds"] = sampled_seconds(volume, in_its_precision, settings, SAMPLED_SLICES)
    return report


def sampled_seconds(volume: Volume, network: VisionTransformer, settings: FeatureSettings, slices: int) -> float:
    """Seconds for an extraction, of which only some slices of each axis are run, after one that does not count."""
    run = FeatureRun(volume, network, settings)
    run.run(run.plan.slices[:1])
    seconds = 0.0
    for axis in range(3):
        of_axis = [of_slice for of_slice in run.plan.slices if of_slice.axis == axis]
        sample = of_axis[:: -(-len(of_axis) // slices)]
        started = time.perf_counter()
        run.run(sample)
        seconds += (time.perf_counter() - started) * len(of_axis) / len(sample)
    return seconds


def _coarse_and_fine(volume: Volume, network: VisionTransformer) -> None:
    """What the panel's user waits for: clicks are answered from the coarse features until the fine ones are there."""
    for features in progressive_features(volume, network, DEFAULT_SETTINGS):
        normalised_features(features, PRESETS[DEFAULT_PRESET].statistics)


def _first_map(volume: Volume, network: VisionTransformer) -> None:
    features = next(progressive_features(volume, network, DEFAULT_SETTINGS))
    similarity = KernelRidge(normalised_features(features, PRESETS[DEFAULT_PRESET].statistics), volume)
    k, j, i = (size // 2 for size in volume.shape)
    list(similarity.maps(classes_of(["first"], [[Click((k, j, i), positive=True)]], volume.geometry)))


def _least(work: Callable[[], object]) -> float:
    """Seconds for the fastest of some runs: others on the machine can only make a run slower."""
    seconds = []
    for _ in range(REPEATS):
        started = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - started)
    return min(seconds)


def _volume(name: str, folder: Path) -> Volume:
    for generated in GENERATED:
        if generated.name == name:
            return generated.volume()
    return read_volume(folder / next(case.volume for case in SCANS if case.name == name))


if __name__ == "__main__":
    main()
