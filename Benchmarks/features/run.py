"""Features' cost against what it buys: `python dev.py bench features --volumes DIR [--weights PATH]`.

*Times*: on scans and on generated volumes, the first map and the default's features, each in a process of its own that is
limited to one class of processors (`capabilities`), with the published way in the same run. *Worth*: each setting on each
labelled scan, with the Dice of the final segmentation over several paths of simulated clicks, everything but the features as
in the default. The published way takes twenty minutes a volume, so it is timed by some of its slices, and its features are
computed only on the volumes named for it (`--published-cases`). The paper's §IV-D compares renderings from grids of 64³, 80³
and 96³ features: the default is run at other grids where these are named (`--grids 80 96`).

What was measured is kept in a folder (`--keep`) and not measured again there, so that a run can be had in parts. Writes
`features.json`, `features.md` and `features.png`.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from Benchmarks.features.capabilities import Capability, capabilities_here
from Benchmarks.features.errors import cosine_errors, dice_by_clicks
from Benchmarks.features.generated_volumes import GENERATED
from Benchmarks.features.report import write_report
from Benchmarks.features.settings import DEFAULT, EVERY_SLICE, FINE, PUBLISHED, SETTINGS, at_grid, settings_called
from Benchmarks.features.summary import summary
from Benchmarks.shared.arguments import scan_parser, weights_of
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.labelled_cases import SCANS, Case
from Benchmarks.shared.machine import machine
from Benchmarks.shared.process_memory import require_linux
from ViTTransferFunction.Logic.core.system.cache_folder import cache_folder
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.features.device import DEVICE_NAMES
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.features.settings import grid_shape

CASES = [case.name for case in SCANS]
TIMED = [*CASES, *(volume.name for volume in GENERATED)]
PUBLISHED_TIMED = CASES[0]
SHORT = [name for name in SETTINGS if name not in (PUBLISHED, EVERY_SLICE)]
PATHS = 5


def main() -> None:
    """Measure what is missing, and write everything."""
    options = _parser().parse_args()
    require_linux()
    weights = weights_of(options)
    bench = Bench(options.volumes, weights.path, weights.model.name, options.device, options.paths, options.keep)
    rows = [
        bench.row(case, name)
        for case in SCANS
        if case.name in options.cases
        for name in [
            *([PUBLISHED] if case.name in options.published_cases else []),
            *(name for name in SETTINGS if name in {*options.settings, FINE, DEFAULT}),
            *map(at_grid, options.grids),
        ]
    ]
    report: dict[str, Any] = {
        "model": weights.model.name,
        "machine": machine(options.device),
        "command": command(options),
        "paths": options.paths,
        "times": [bench.times(name, capability) for capability in capabilities_here() for name in options.timed],
        "rows": rows,
    }
    report["summary"] = summary(report)
    write_report(report, options.results)


def _parser() -> argparse.ArgumentParser:
    parser = scan_parser(__doc__, CASES, keep=cache_folder() / "bench_features")
    parser.add_argument(
        "--device", default="auto", choices=DEVICE_NAMES, help="for what settings are worth; times: the processor"
    )
    parser.add_argument("--timed", nargs="*", choices=TIMED, default=TIMED, help="volumes to take times on")
    parser.add_argument(
        "--settings",
        nargs="*",
        choices=[name for name in SETTINGS if name != PUBLISHED],
        default=SHORT,
        help=f"only these settings, {FINE} and {DEFAULT}",
    )
    parser.add_argument("--grids", nargs="*", type=int, default=[], help="also the default at so many cells along an edge")
    parser.add_argument("--paths", type=int, default=PATHS, help=f"paths of clicks on a volume (default {PATHS})")
    parser.add_argument(
        "--published-cases", nargs="*", choices=CASES, default=[], help="scans to compute the published features on"
    )
    return parser


def command(options: argparse.Namespace) -> str:
    """What was asked for, without the places where the data lie on this machine."""
    words = ["python dev.py bench features --volumes DIR --weights FILE"]
    defaults = {"cases": CASES, "timed": TIMED, "settings": SHORT, "grids": [], "published_cases": []}
    for name, default in defaults.items():
        chosen = getattr(options, name)
        if chosen != default:
            words.append(f"--{name.replace('_', '-')} {shlex.join(map(str, chosen))}")
    if options.paths != PATHS:
        words.append(f"--paths {options.paths}")
    return " ".join(words)


class Bench:
    """Runs measurements, each once, and keeps them.

    Args:
        volumes: folder with the labelled volumes.
        weights: file.
        model: that the weights are of.
        device: to compute features on whose worth is measured.
        paths: of clicks on each volume.
        keep: folder for rows (JSON) and features; what is there is taken as it is.
    """

    def __init__(self, volumes: Path, weights: Path, model: str, device: str, paths: int, keep: Path) -> None:
        self._volumes, self._device, self._paths, self._folder = volumes, device, paths, keep
        self._network = ("--volumes", str(volumes), "--weights", str(weights), "--model", model)
        keep.mkdir(parents=True, exist_ok=True)
        self._kept = KeptResults(keep)

    def times(self, name: str, capability: Capability) -> dict[str, Any]:
        """Times on one volume, with what is allowed to a class of processors."""
        published = ["--published"] if name == PUBLISHED_TIMED else []
        command = [sys.executable, "-m", "Benchmarks.features.times", name, *self._network, *published]
        measured = self._kept.get(f"times {name} {capability.key}", lambda: _printed_by(command, capability.environment))
        return {"volume": name, "capability": capability.name, "capability_key": capability.key, **measured}

    def row(self, case: Case, name: str) -> dict[str, Any]:
        """Cost, errors and Dice of one setting on one volume."""
        cost = self._cost(case, name)
        errors = self._kept.get(f"errors {case.name} {name}", lambda: self._errors(case, name))
        paths = [
            self._kept.get(f"dice {case.name} {name} path {path}", lambda path=path: self._dice(case, name, path))  # type: ignore[misc]
            for path in range(1, self._paths + 1)
        ]
        return {"case": case.name, "setting": name, **cost, **errors, "dice": paths}

    def _cost(self, case: Case, name: str) -> dict[str, Any]:
        command = [
            *(sys.executable, "-m", "Benchmarks.features.extraction", case.name, name, *self._network),
            *("--device", self._device, "--features", str(self._features_path(case, name))),
        ]
        return self._kept.get(f"setting {case.name} {name}", lambda: _printed_by(command, {}))

    def _errors(self, case: Case, name: str) -> dict[str, float]:
        """Against the setting with one patch a cell."""
        labelled = case.read(self._volumes)
        self._cost(case, FINE)
        features, reference = (self._features(case, n, labelled.volume.geometry) for n in (name, FINE))
        return cosine_errors(features, reference, labelled.volume)

    def _dice(self, case: Case, name: str, path: int) -> dict[str, float]:
        labelled = case.read(self._volumes)
        return dice_by_clicks(self._features(case, name, labelled.volume.geometry), labelled, path)

    def _features(self, case: Case, name: str, geometry: Geometry) -> FeatureVolume:
        array = np.load(self._features_path(case, name))
        cells = geometry.resized(grid_shape(geometry, settings_called(name)))
        return FeatureVolume(array, geometry.resized(array.shape[:3]), name, cells)

    def _features_path(self, case: Case, name: str) -> Path:
        return self._folder / f"{case.name} {name}.npy"


def _printed_by(command: list[str], environment: dict[str, str]) -> dict[str, Any]:
    """What a measurement in a new process prints."""
    finished = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, env={**os.environ, **environment})
    printed: dict[str, Any] = json.loads(finished.stdout)
    return printed


if __name__ == "__main__":
    main()
