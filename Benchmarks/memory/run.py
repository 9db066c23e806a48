"""How much memory `vittf segment` takes, and the module beside Slicer, by the size of the volume.

    python dev.py bench memory --volumes DIR [--sizes 512x512x1200] [--preset balanced]

The torso scan is resampled to each size (16 bits a voxel, with noise) and segmented from three points each in liver, spleen and
aorta, in a process of its own, from reading the file to writing the segmentation. What counts is the largest resident memory of
that process, which includes Python's and PyTorch's own libraries, some 0.3 GB. Features are computed anew for each size.
Structures that fill the whole volume take more: six bytes of each voxel of the box that holds them. The same is done in the
module's session on a real scene (`panel_session`). Writes `memory.json` and `memory.md`.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from Benchmarks.memory.stretched_scan import write_points, write_stretched_scan
from Benchmarks.shared.arguments import network_parser, weights_of
from Benchmarks.shared.cache_of_its_own import cache_of_its_own
from Benchmarks.shared.machine import in_words, machine
from Benchmarks.shared.process_memory import require_linux
from Benchmarks.shared.report_files import write_results
from Benchmarks.shared.report_tables import paragraphs, table
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET

SCAN, LABELS = "torso_small_ct.nii.gz", "torso_small_labels.nii.gz"
STRUCTURES = {"liver": [5], "spleen": [1], "aorta": [52]}
SIZES = ("256x256x256", "512x512x300", "512x512x512", "512x512x1200")
LIMIT_GB = 2.5
"""Of `vittf segment`, for 512×512×1200 voxels."""
PEAKS = ("peak_gb", "panel_peak_gb")


def main() -> None:
    """Measure, and write what was measured."""
    parser = network_parser(__doc__)
    parser.add_argument("--sizes", nargs="*", default=list(SIZES), metavar="IxJxK", help=f"default: {', '.join(SIZES)}")
    parser.add_argument("--preset", default=DEFAULT_PRESET, help="of the features (default %(default)s)")
    options = parser.parse_args()
    require_linux()
    weights = weights_of(options)
    with tempfile.TemporaryDirectory() as folder:
        points = Path(folder) / "points.json"
        write_points(options.volumes / LABELS, STRUCTURES, points)
        rows = []
        for size in options.sizes:
            scan = Path(folder) / "scan.nrrd"
            write_stretched_scan(options.volumes / SCAN, [int(count) for count in size.split("x")], scan)
            options_of_run = ["--preset", options.preset, "--model", weights.model.name, "--weights", str(weights.path)]
            row = measure(scan, points, options_of_run)
            rows.append({**row, "panel_peak_gb": panel_gb(scan, points, weights.path, weights.model.name, options.preset)})
    measured = {"machine": machine(), "preset": options.preset, "limit_gb": LIMIT_GB, "rows": rows}
    write_results(options.results, "memory", {**measured, "summary": summary(rows)}, text(measured))


def measure(scan: Path, points: Path, options: list[str]) -> dict[str, Any]:
    """What segmenting a scan takes."""
    report = scan.with_name("report.json")
    arguments = ["segment", str(scan), "--annotations", str(points), "-o", str(scan.with_name("out.seg.nrrd"))]
    with cache_of_its_own():
        subprocess.run(
            [sys.executable, "-m", "ViTTransferFunction.CommandLine.vittf", *arguments, "--report", str(report), *options],
            check=True,
        )
    content = json.loads(report.read_text(encoding="utf-8"))
    i, j, k = content["volume"]["size"]
    return {
        "size": f"{i}×{j}×{k}",
        "volume_gb": 2 * i * j * k / 1e9,
        "peak_gb": content["peak_memory_bytes"] / 1e9,
        "seconds": sum(content["seconds"].values()),
    }


def panel_gb(scan: Path, points: Path, weights: Path, model: str, preset: str) -> float:
    """What the module takes beside a Slicer with the scan loaded; see `panel_session`."""
    with cache_of_its_own():
        printed = subprocess.run(
            [sys.executable, "-m", "Benchmarks.memory.panel_session", *map(str, (scan, points, weights, model, preset))],
            check=True,
            stdout=subprocess.PIPE,
            text=True,
        ).stdout
    peak_gb: float = json.loads(printed.splitlines()[-1])["panel_peak_bytes"] / 1e9
    return peak_gb


def summary(rows: list[dict[str, Any]]) -> dict[str, float]:
    """The figures that are tracked: of the largest volume."""
    largest = max(rows, key=lambda row: row["volume_gb"])
    return {"largest_volume_gb": largest["volume_gb"], **{name: largest[name] for name in PEAKS}}


def text(measured: dict[str, Any]) -> str:
    """The report for people."""
    return paragraphs(
        "# Memory",
        f"{in_words(measured['machine'])}. Preset {measured['preset']}.",
        "The largest resident memory of `vittf segment`, libraries included; three structures, features computed. *Beside "
        "Slicer*: what the module and its compute process take together at most, on a scene that has the volume loaded.",
        table(
            ["voxels", "volume, 16 bits", "memory at most", "seconds in all", "beside Slicer"],
            [
                [
                    row["size"],
                    f"{row['volume_gb']:.2f} GB",
                    f"{row['peak_gb']:.2f} GB",
                    f"{row['seconds']:.0f}",
                    f"{row['panel_peak_gb']:.2f} GB",
                ]
                for row in measured["rows"]
            ],
        ),
        f"The aim is at most {measured['limit_gb']} GB for 512×512×1200 voxels, of `vittf segment`.",
    )


if __name__ == "__main__":
    main()
