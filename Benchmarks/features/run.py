"""Features' cost against what it loses: `python dev.py bench features --volumes DIR [--weights PATH]`.

Every setting is run on every labelled volume in a process of its own (`runs`); then the same simulated clicks tell what its
features are worth. The published method takes twenty minutes a volume, so it is run on the volumes named for it alone
(`--published-cases`), and only the presets' settings are, unless others are named (`--settings`). The paper's §V-C compares
renderings from grids of 64³, 80³ and 96³ features: the default setting is run at other grids where these are named, too
(`python dev.py bench features --volumes DIR --grids 80 96`).

What was measured is kept in a folder (`--keep`) and not measured again there, so that a run can be had in parts. Writes
`features.json`, `features.md` and `features.png`.
"""

from __future__ import annotations

import argparse
import json
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from Benchmarks.features.errors import cosine_errors, dice_by_clicks
from Benchmarks.features.report import dice_over_clicks, write_report
from Benchmarks.features.runs import PUBLISHED, REFERENCE, SETTINGS, at_grid
from Benchmarks.shared.arguments import scan_parser, scans_of, weights_of
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.labelled_cases import SCANS, Case
from Benchmarks.shared.machine import machine
from ViTTransferFunction.Logic.core.cache_folder import cache_folder
from ViTTransferFunction.Logic.core.geometry import Geometry
from ViTTransferFunction.Logic.features.device import DEVICE_NAMES
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS

SIZES = (128, 256, 512)
DEFAULT = next(name for name, settings in SETTINGS.items() if settings == PRESETS[DEFAULT_PRESET].features)
SHORT = [name for name in SETTINGS if name != PUBLISHED]
OF_PRESETS = [name for name in SHORT if SETTINGS[name] in [preset.features for preset in PRESETS.values()]]
CASES = [case.name for case in SCANS]
PUBLISHED_CASES = ["amos_0336"]


def main() -> None:
    """Measure what is missing, and write everything."""
    parser = scan_parser(__doc__, CASES, keep=cache_folder() / "bench_features")
    parser.add_argument("--device", default="auto", choices=DEVICE_NAMES)
    parser.add_argument("--settings", nargs="*", choices=SHORT, default=OF_PRESETS, help="only these settings")
    parser.add_argument(
        "--grids", nargs="*", type=int, default=[], help="also the default at so many cells along the longest edge"
    )
    parser.add_argument(
        "--published-cases",
        nargs="*",
        choices=CASES,
        default=PUBLISHED_CASES,
        help="volumes to run the published method on, too",
    )
    options = parser.parse_args()
    weights = weights_of(options)
    bench = Bench(options.volumes, weights.path, weights.model.name, options.device, options.keep)
    cases = scans_of(options)
    names = [*sorted({*options.settings, REFERENCE, DEFAULT}, key=list(SETTINGS).index), *map(at_grid, options.grids)]
    report: dict[str, Any] = {
        "model": weights.model.name,
        "machine": machine(options.device),
        "command": command(options),
        "default": DEFAULT,
        "published_cases": [case.name for case in cases if case.name in options.published_cases],
        "rows": [
            bench.row(case, name)
            for case in cases
            for name in ([PUBLISHED] if case.name in options.published_cases else []) + names
        ],
        "first_maps": [{"case": case.name, **bench.run("first map", "default", case)} for case in cases],
        "stages": {"case": cases[0].name, **bench.run("stages", "default", cases[0])},
        "scaling": [bench.run("scaling", str(size), cases[0]) for size in SIZES],
    }
    report["summary"] = summary(report)
    write_report(report, options.results)


def command(options: argparse.Namespace) -> str:
    """What was asked for, without the places where the data lie on this machine."""
    words = ["python dev.py bench features --volumes DIR --weights FILE"]
    defaults = {"cases": CASES, "settings": OF_PRESETS, "grids": [], "published_cases": PUBLISHED_CASES}
    for name, default in defaults.items():
        chosen = getattr(options, name)
        if chosen != default:
            words.append(f"--{name.replace('_', '-')} {shlex.join(map(str, chosen))}")
    return " ".join(words)


class Bench:
    """Runs measurements, each once, and keeps them.

    Args:
        volumes: folder with the labelled volumes.
        weights: file.
        model: that the weights are of.
        device: to run on.
        keep: folder for rows (JSON) and features; what is there is taken as it is.
    """

    def __init__(self, volumes: Path, weights: Path, model: str, device: str, keep: Path) -> None:
        self._volumes, self._weights, self._model, self._device, self._folder = volumes, weights, model, device, keep
        keep.mkdir(parents=True, exist_ok=True)
        self._kept = KeptResults(keep)

    def row(self, case: Case, name: str) -> dict[str, Any]:
        """Cost, errors and Dice of one setting on one volume."""
        cost = self.run("setting", name, case)
        return {
            "case": case.name,
            "setting": name,
            **cost,
            **self._kept.get(f"worth {case.name} {name}", lambda: self._worth(case, name)),
        }

    def run(self, kind: str, name: str, case: Case) -> dict[str, Any]:
        """One measurement of `runs`, in a new process."""
        command = [
            *(sys.executable, "-m", "Benchmarks.features.runs", kind, name, "--case", case.name),
            *("--volumes", str(self._volumes), "--weights", str(self._weights), "--model", self._model),
            *("--device", self._device, "--features", str(self._features_path(case, name))),
        ]

        def measure() -> dict[str, Any]:
            finished = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
            return json.loads(finished.stdout)

        return self._kept.get(f"{kind} {case.name} {name}", measure)

    def _worth(self, case: Case, name: str) -> dict[str, Any]:
        labelled = case.read(self._volumes)
        features, reference = (self._features(case, n, labelled.volume.geometry) for n in (name, REFERENCE))
        return {**cosine_errors(features, reference, labelled.volume), "dice": dice_by_clicks(features, labelled)}

    def _features(self, case: Case, name: str, geometry: Geometry) -> FeatureVolume:
        if not self._features_path(case, name).exists():
            self.run("setting", name, case)
        array = np.load(self._features_path(case, name))
        return FeatureVolume(array, geometry.resized(array.shape[:3]), name)

    def _features_path(self, case: Case, name: str) -> Path:
        return self._folder / f"{case.name} {name}.npy"


def summary(report: dict[str, Any]) -> dict[str, float]:
    """The figures that are tracked: the default's, in the worst case where there are several.

    Against another way of computing features they are over the volumes that it was run on, and not there where there is none.
    """
    figures = {
        "first_map_s": max(row["first_map_s"] for row in report["first_maps"]),
        "extra_memory_bytes": max(
            row["peak_bytes"] - row["feature_bytes"] for row in report["rows"] if row["setting"] == DEFAULT
        ),
    }
    for setting, name in ((PUBLISHED, "published"), (REFERENCE, "every_slice")):
        pairs = pairs_with_default(report["rows"], setting)
        if pairs:
            figures |= against(pairs, name)
    return figures


def pairs_with_default(rows: Sequence[dict[str, Any]], setting: str) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """The rows of a setting and of the default on the same volume, of all volumes that it was run on."""
    of_default = {row["case"]: row for row in rows if row["setting"] == DEFAULT}
    return [(row, of_default[row["case"]]) for row in rows if row["setting"] == setting and row["case"] in of_default]


def against(pairs: Sequence[tuple[dict[str, Any], dict[str, Any]]], name: str) -> dict[str, float]:
    """Least speed-up and loss of Dice of the second rows against the first ones."""
    losses = [dice_over_clicks(slow) - dice_over_clicks(fast) for slow, fast in pairs]
    suffix = "" if name == "published" else f"_vs_{name}"
    return {
        f"speedup_vs_{name}": min(slow["seconds"] / fast["seconds"] for slow, fast in pairs),
        f"dice_loss{suffix}": float(np.mean(losses)),
        f"dice_loss_worst_volume{suffix}": max(losses),
    }


if __name__ == "__main__":
    main()
