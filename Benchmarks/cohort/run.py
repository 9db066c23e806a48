"""Cases per hour of `vittf cohort` with 1 and 2 workers, and on paper with 64.

    python dev.py bench cohort --volumes DIR [--copies 6] [--preset balanced] [--workers 1 2]

Copies of one scan, each with other intensities by a constant, so that none finds another's features in the cache; the points
are taken from the scan's labels, three in each structure. For each number of workers the command is run as users do, in an
empty cache; all cores are shared out among the workers. A case's seconds are the median over the copies, since the first of
each worker also loads PyTorch and the weights. What the leader takes for a case is measured on cases without a file, which
workers refuse at once. `efficiency.py` has the model of 64 workers.

Left out: the network between computers, and a disk that many workers read from. Writes `cohort.json` and `cohort.md`.
"""

from __future__ import annotations

import csv
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from Benchmarks.cohort.efficiency import Scaling, start_seconds
from Benchmarks.shared.arguments import network_parser, weights_of
from Benchmarks.shared.labelled_cases import SCANS, LabelledVolume
from Benchmarks.shared.machine import in_words, machine
from Benchmarks.shared.report_files import write_results
from Benchmarks.shared.report_tables import number, paragraphs, table
from ViTTransferFunction.CommandLine.cohort.cases import Case
from ViTTransferFunction.CommandLine.cohort.dispatch import run_jobs
from ViTTransferFunction.CommandLine.cohort.job import CaseJob, CohortSettings
from ViTTransferFunction.CommandLine.cohort.local_cluster import local_cluster
from ViTTransferFunction.CommandLine.cohort.table import CohortTable
from ViTTransferFunction.Logic.core.classes.label_points import points_in_label
from ViTTransferFunction.Logic.core.volumes.stepped_work import finished
from ViTTransferFunction.Logic.core.volumes.voxel_digest import label_boxes
from ViTTransferFunction.Logic.files.annotation_files import ANNOTATIONS_ENDING
from ViTTransferFunction.Logic.files.segmentation_files import write_image
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Logic.weights.sources import WeightsFile

SCAN = next(case for case in SCANS if case.name == "torso_small")
POINTS = 3
EMPTY_CASES = 300
MANY_WORKERS = 64
COHORTS = (64, 640, 6400)


def main() -> None:
    """Measure, and write what was measured."""
    parser = network_parser(__doc__)
    parser.add_argument("--copies", type=int, default=6, help="cases of each cohort (default 6)")
    parser.add_argument("--preset", default=DEFAULT_PRESET, help="of the features (default %(default)s)")
    parser.add_argument("--workers", nargs="*", type=int, default=[1, 2], help="numbers of workers (default 1 2)")
    options = parser.parse_args()
    weights = weights_of(options)
    with tempfile.TemporaryDirectory() as folder:
        cases = Path(folder) / "cases"
        write_copies(SCAN.read(options.volumes), options.copies, cases)
        runs = [measure(cases, workers, options.preset, weights) for workers in options.workers]
        leader_s = leader_seconds(Path(folder) / "empty")
    # On as many workers as there are cores, each has one.
    fullest = max(runs, key=lambda run: run["workers"])
    scaling = Scaling(fullest["start_s"], fullest["case_s"], leader_s)
    report = {
        "model": weights.model.name, "machine": machine("cpu"), "scan": SCAN.name, "preset": options.preset,
        "leader_s": leader_s, "cohorts": runs, "on_paper": [on_paper(scaling, cases) for cases in COHORTS],
    }  # fmt: skip
    write_results(options.results, "cohort", {**report, "summary": summary(report)}, text(report, scaling))


def write_copies(labelled: LabelledVolume, count: int, folder: Path) -> None:
    """A folder of cases: the scan, 1, 2, … units brighter, with points in each of its structures."""
    folder.mkdir()
    geometry = labelled.volume.geometry
    boxes = finished(label_boxes(labelled.truth))
    classes = [
        {"name": name, "positive": finished(points_in_label(labelled.truth, label, boxes[label], geometry, POINTS)).tolist()}
        for label, name in enumerate(labelled.names, start=1)
    ]
    points = json.dumps({"coordinate_system": "RAS", "classes": classes})
    for index in range(count):
        write_image(folder / f"copy {index}.nii.gz", (labelled.volume.array + index).astype(np.int16), geometry)
        (folder / f"copy {index}{ANNOTATIONS_ENDING}").write_text(points, encoding="utf-8")


def measure(cases: Path, workers: int, preset: str, weights: WeightsFile) -> dict[str, Any]:
    """One cohort with so many workers, as a user runs it, with nothing in the cache."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        command = [sys.executable, "-m", "ViTTransferFunction.CommandLine.vittf", "cohort", str(cases), "-o", str(out)]
        options = ["--workers", str(workers), "--preset", preset, "--device", "cpu"]
        options += ["--model", weights.model.name, "--weights", str(weights.path)]
        start = time.perf_counter()
        subprocess.run([*command, *options], env={**os.environ, "VITTF_CACHE": folder}, check=True)
        total_s = time.perf_counter() - start
        with (out / "cohort.csv").open(encoding="utf-8", newline="") as file:
            seconds = [float(row["seconds"]) for row in csv.DictReader(file)]
    case_s = statistics.median(seconds)
    return {
        "workers": workers,
        "cases": len(seconds),
        "seconds": total_s,
        "case_s": case_s,
        "start_s": start_seconds(total_s, case_s, len(seconds), workers),
        "cases_per_hour": 3600.0 * len(seconds) / total_s,
        "cases_per_hour_once_started": 3600.0 * workers / case_s,
    }


def leader_seconds(folder: Path) -> float:
    """What is done for a case by who leads the cohort, table and all."""
    settings = CohortSettings(SessionSettings(), "")
    cases = [Case(f"{index}", folder / f"{index}.nii", folder / f"{index}.json") for index in range(EMPTY_CASES)]
    cohort = CohortTable(folder / "cohort.csv", [case.name for case in cases])
    with local_cluster(workers=1, threads=1) as client:
        # The first one loads what is needed.
        list(run_jobs(client, [CaseJob(cases[0], settings, folder)]))
        start = time.perf_counter()
        for outcome in run_jobs(client, [CaseJob(case, settings, folder) for case in cases]):
            cohort.put(outcome)
        return (time.perf_counter() - start) / len(cases)


def on_paper(scaling: Scaling, cases: int) -> dict[str, Any]:
    """What 64 workers would do."""
    return {
        "workers": MANY_WORKERS,
        "cases": cases,
        "seconds": scaling.seconds(cases, MANY_WORKERS),
        "cases_per_hour": scaling.cases_per_hour(cases, MANY_WORKERS),
        "efficiency": scaling.efficiency(cases, MANY_WORKERS),
    }


def summary(report: dict[str, Any]) -> dict[str, Any]:
    """The figures that are tracked."""
    per_hour = {f"cases_per_hour_{run['workers']}": round(run["cases_per_hour_once_started"], 1) for run in report["cohorts"]}
    return {**per_hour, "efficiency_64_on_paper": round(report["on_paper"][1]["efficiency"], 3)}


def text(report: dict[str, Any], scaling: Scaling) -> str:
    """For people."""
    measured = [
        [run["workers"], run["cases"], *(number(run[name], 1) for name in ("seconds", "case_s", "cases_per_hour")),
         number(run["cases_per_hour_once_started"], 0)]
        for run in report["cohorts"]
    ]  # fmt: skip
    imagined = [
        [row["cases"], number(row["seconds"], 0), number(row["cases_per_hour"], 0), number(row["efficiency"], 2)]
        for row in report["on_paper"]
    ]
    return paragraphs(
        "# Cohorts",
        f"Copies of {report['scan']}, features of {report['model']}, preset {report['preset']}. {in_words(report['machine'])}. "
        "All cores are shared out among the workers. Command: `python dev.py bench cohort --volumes DIR`.",
        table(["workers", "cases", "s in all", "s a case", "cases an hour", "cases an hour once started"], measured),
        f"## On paper: {MANY_WORKERS} workers",
        f"T = s + max(⌈N / w⌉ · t, N · d), with s = {scaling.start_s:.1f} s to start, t = {scaling.case_s:.1f} s for a case on "
        f"a worker, d = {1000 * scaling.leader_s:.1f} ms of the leader for a case; efficiency N · t / (w · T). The "
        f"leader would keep {scaling.most_workers:.0f} workers busy. Not measured: a disk that all of them read from.",
        table(["cases", "s in all", "cases an hour", "efficiency"], imagined),
    )


if __name__ == "__main__":
    main()
