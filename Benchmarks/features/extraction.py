"""One extraction on a labelled scan: `python -m Benchmarks.features.extraction CASE SETTING …`, in a process of its own.

Prints one line of JSON. A fresh process, so that peak memory is that of the measured thing alone.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch

from Benchmarks.features.settings import settings_called
from Benchmarks.shared.labelled_cases import SCANS
from Benchmarks.shared.process_memory import forget_peak, peak_resident_bytes, resident_bytes
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.cost import calibrate, feature_cost
from ViTTransferFunction.Logic.features.device import choose_device
from ViTTransferFunction.Logic.features.extraction import extract_features
from ViTTransferFunction.Logic.features.networks import open_network
from ViTTransferFunction.Logic.features.settings import FeatureSettings
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.weights.sources import find_weights


def main() -> None:
    """Measure what the command line names, keep its features, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", choices=[case.name for case in SCANS])
    parser.add_argument("setting")
    parser.add_argument("--volumes", type=Path, required=True)
    parser.add_argument("--weights", type=Path, required=True)
    parser.add_argument("--model", required=True)
    parser.add_argument("--device", default="auto")
    parser.add_argument("--features", type=Path, required=True, help="file to keep the features in")
    options = parser.parse_args()
    network = open_network(find_weights(options.model, options.weights), choose_device(options.device))
    volume = read_volume(options.volumes / next(case.volume for case in SCANS if case.name == options.case))
    row, features = _measured(volume, network, settings_called(options.setting))
    np.save(options.features, features)
    print(json.dumps(row))


def _measured(volume: Volume, network: VisionTransformer, settings: FeatureSettings) -> tuple[dict[str, Any], np.ndarray]:
    """Seconds and memory, and what the estimator had said."""
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


def _forget_peaks() -> None:
    forget_peak()
    if torch.cuda.is_available():
        torch.cuda.reset_peak_memory_stats()


if __name__ == "__main__":
    main()
