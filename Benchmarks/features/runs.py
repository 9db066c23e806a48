"""One measurement of feature extraction, for the benchmark: `python -m Benchmarks.features.runs KIND NAME …`.

Prints one line of JSON. A fresh process, so that peak memory is that of the measured thing alone.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from Benchmarks.features.errors import cosine_errors
from Benchmarks.shared.labelled_cases import SCANS, classes_of, merged_labels
from Benchmarks.shared.process_memory import forget_peak, peak_resident_bytes, resident_bytes
from Benchmarks.shared.refinement_phantoms import body_phantom
from Benchmarks.shared.simulated_clicker import first_click
from ViTTransferFunction.Logic.core.geometry import Geometry
from ViTTransferFunction.Logic.core.volume import Volume
from ViTTransferFunction.Logic.features.cost import calibrate, feature_cost
from ViTTransferFunction.Logic.features.device import choose_device
from ViTTransferFunction.Logic.features.extraction import extract_features
from ViTTransferFunction.Logic.features.progressive import progressive_features
from ViTTransferFunction.Logic.features.settings import FeatureSettings
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer
from ViTTransferFunction.Logic.features.whitening import normalised_features
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.similarity.kernel_ridge import KernelRidge
from ViTTransferFunction.Logic.weights.models import pretrained_model
from ViTTransferFunction.Logic.weights.state_dict import load_state_dict

PUBLISHED = "published"
REFERENCE = "every slice"
_AT_GRID = "grid "
_ONE_BY_ONE = FeatureSettings(merge_background=False, precision="float32")
SETTINGS = {
    PUBLISHED: PRESETS["paper"].features,
    REFERENCE: FeatureSettings(every_slice=True, merge_background=False),
    "one slice a layer, float32": _ONE_BY_ONE,
    "one slice a layer": replace(_ONE_BY_ONE, precision="bfloat16"),
    "background merged": FeatureSettings(),
    "background merged, every 2nd layer": FeatureSettings(layer_step=2),
    "background merged, float32": replace(_ONE_BY_ONE, merge_background=True),
    **{f"background merged, {patches} patches": FeatureSettings(patches_per_cell=patches / 64) for patches in (24, 32, 40, 48)},
    "background merged, 48 patches, every 2nd layer": FeatureSettings(patches_per_cell=48 / 64, layer_step=2),
    "background merged, 40 patches, float32": FeatureSettings(patches_per_cell=40 / 64, precision="float32"),
}
"""What is compared: the levers one after the other, then together. All at the default grid."""


def at_grid(grid: int) -> str:
    """Name of the default setting with so many cells along the longest edge; the network sees patches in proportion."""
    return f"{_AT_GRID}{grid}"


def settings_called(name: str) -> FeatureSettings:
    """One of `SETTINGS`, or what `at_grid` named."""
    if name in SETTINGS:
        return SETTINGS[name]
    return replace(PRESETS[DEFAULT_PRESET].features, grid=int(name.removeprefix(_AT_GRID)))


def main() -> None:
    """Measure what the command line names, and print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=["setting", "first map", "stages", "scaling"])
    parser.add_argument("name", help="of the setting, or edge length of the generated volume")
    parser.add_argument("--case", choices=[case.name for case in SCANS], default=SCANS[0].name)
    parser.add_argument("--volumes", type=Path, required=True)
    parser.add_argument("--weights", type=Path, required=True)
    parser.add_argument("--model", required=True)
    parser.add_argument("--device", default="auto")
    parser.add_argument("--features", type=Path, help="file to keep the features in")
    options = parser.parse_args()
    measure = {"setting": _setting, "first map": _first_map, "stages": _stages, "scaling": _scaling}[options.kind]
    print(json.dumps(measure(options)))


def _setting(options: argparse.Namespace) -> dict[str, Any]:
    """Seconds, memory, and what the estimator had said."""
    network, volume = _network(options), _volume(options)
    row, features = _measured(volume, network, settings_called(options.name))
    np.save(options.features, features)
    return row


def _measured(volume: Volume, network: VisionTransformer, settings: FeatureSettings) -> tuple[dict[str, Any], np.ndarray]:
    before = resident_bytes()
    _forget_peaks()
    # Counted as well: what calibration leaves in memory is what the run uses again.
    estimate = feature_cost(volume, settings, network, calibrate(network, settings))
    start = time.perf_counter()
    features = extract_features(volume, network, settings).array
    seconds = time.perf_counter() - start
    peak = torch.cuda.max_memory_allocated() if network.device.type == "cuda" else peak_resident_bytes() - before
    return {
        "seconds": seconds,
        "estimated_seconds": estimate.seconds,
        "tokens": estimate.tokens,
        "peak_bytes": peak,
        "estimated_peak_bytes": estimate.peak_bytes,
        "feature_bytes": features.nbytes,
    }, features


def _first_map(options: argparse.Namespace) -> dict[str, Any]:
    """Seconds from the file to the first map of a click, and to the last features."""
    case = next(case for case in SCANS if case.name == options.case)
    truth = merged_labels(options.volumes / case.labels, case)
    spacing_mm = _volume(options).geometry.spacing_mm
    click = first_click(truth == 1, spacing_mm[::-1].tolist())
    start = time.perf_counter()
    volume, network = _volume(options), _network(options)
    seconds = []
    for features in progressive_features(volume, network, PRESETS[DEFAULT_PRESET].features):
        similarity = KernelRidge(normalised_features(features, PRESETS[DEFAULT_PRESET].statistics), volume)
        similarity.maps(classes_of(["first"], [[click]], volume.geometry))
        seconds.append(time.perf_counter() - start)
    return {"voxels": list(volume.shape[::-1]), "first_map_s": seconds[0], "last_map_s": seconds[-1]}


def _stages(options: argparse.Namespace) -> dict[str, Any]:
    """The error of each stage of progressive features against the last."""
    volume = _volume(options)
    start = time.perf_counter()
    stages = [
        (features, time.perf_counter() - start)
        for features in progressive_features(volume, _network(options), FeatureSettings())
    ]
    final = stages[-1][0]
    errors = [cosine_errors(features, final, volume)["whitened"] for features, _ in stages]
    return {"stages": [{"seconds": s, "error": error} for (_, s), error in zip(stages, errors, strict=True)]}


def _scaling(options: argparse.Namespace) -> dict[str, Any]:
    """Cost of the default on a generated volume."""
    size = int(options.name)
    volume = Volume(body_phantom(size).luma.numpy(), Geometry((size,) * 3, np.eye(4)))
    return {"size": size, **_measured(volume, _network(options), PRESETS[DEFAULT_PRESET].features)[0]}


def _network(options: argparse.Namespace) -> VisionTransformer:
    model = pretrained_model(options.model)
    return VisionTransformer(model, load_state_dict(options.weights), "bench", choose_device(options.device))


def _volume(options: argparse.Namespace) -> Volume:
    return read_volume(options.volumes / next(case.volume for case in SCANS if case.name == options.case))


def _forget_peaks() -> None:
    forget_peak()
    if torch.cuda.is_available():
        torch.cuda.reset_peak_memory_stats()


if __name__ == "__main__":
    main()
