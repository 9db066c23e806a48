"""Accuracy by number of clicks: `python dev.py bench accuracy --volumes DIR [--weights PATH]`.

A simulated clicker annotates all structures of a labelled volume together and corrects the largest error in each round
(`simulated_clicker`). Nothing is tuned by structure or volume, and no label is read but by the clicker and the metrics.
Writes `accuracy.json` and `accuracy.md` to Benchmarks/results.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import SimpleITK as sitk  # noqa: N813

from Benchmarks.segmentation_metrics import segmentation_metrics
from Benchmarks.simulated_clicker import MOST_CLICKS, Clicks, click_in_rounds
from ViTTransferFunction.CommandLine.progress_bar import ProgressBar
from ViTTransferFunction.Logic.annotations import AnnotatedClass, default_color
from ViTTransferFunction.Logic.atomic_file import replacing
from ViTTransferFunction.Logic.device import choose_device
from ViTTransferFunction.Logic.feature_cache import FeatureCache
from ViTTransferFunction.Logic.feature_statistics import Statistics
from ViTTransferFunction.Logic.geometry import Geometry
from ViTTransferFunction.Logic.presets import DEFAULT_PRESET, preset
from ViTTransferFunction.Logic.refinement import RefinementMethod
from ViTTransferFunction.Logic.segmentation_session import SegmentationSession
from ViTTransferFunction.Logic.similarity import SimilarityMethod
from ViTTransferFunction.Logic.volume_io import read_volume
from ViTTransferFunction.Logic.weights import WeightsFile, find_weights, identify_model

RESULTS = Path(__file__).parent / "results"
REPORTED_ROUNDS = (1, 3, 5, 10)


@dataclass(frozen=True)
class Case:
    """A labelled volume: its files, and which label numbers make up each structure."""

    name: str
    volume: str
    labels: str
    structures: dict[str, tuple[int, ...]]


@dataclass(frozen=True)
class Method:
    """One way from clicks to labels, on the same features."""

    name: str
    similarity: SimilarityMethod
    statistics: Statistics
    refinement: RefinementMethod


CASES = (
    Case(
        "amos_0336", "amos_0336_ct.nii.gz", "amos_0336_labels.nii.gz",
        {
            "liver": (6,), "spleen": (1,), "right kidney": (2,), "left kidney": (3,),
            "stomach": (7,), "bladder": (14,), "aorta": (8,),
        },
    ),
    Case(
        "torso_small", "torso_small_ct.nii.gz", "torso_small_labels.nii.gz",
        {
            "liver": (5,), "spleen": (1,), "right kidney": (2,), "left kidney": (3,),
            "stomach": (6,), "bladder": (21,), "aorta": (52,),
        },
    ),
    Case(
        "brain", "brain_t1.nii.gz", "brain_labels.nii.gz",
        {
            "lateral ventricles": (41, 92), "thalamus": (40, 91), "caudate": (49, 100), "putamen": (21, 72),
            "hippocampus": (48, 99), "brainstem": (11, 62), "cerebellar grey matter": (46, 97),
        },
    ),
)  # fmt: skip

METHODS = (
    Method("default", "kernel", "whitened", "bilateral"),
    Method("default, guided filter", "kernel", "whitened", "guided"),
    Method("default, not refined", "kernel", "whitened", "none"),
    Method("Eq. 1, whitened features", "cosine", "whitened", "bilateral"),
    Method("Eq. 1, raw features", "cosine", "none", "bilateral"),
)


def main() -> None:
    """Run every method on every case, and write what was measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--volumes", type=Path, required=True, help="folder with the labelled volumes")
    parser.add_argument("--weights", type=Path, help="weights file; else VITTF_WEIGHTS, the cache or a download")
    parser.add_argument("--model", default="dinov2_vits14_focus", help="where the weights file does not say it")
    parser.add_argument("--cases", nargs="*", choices=[case.name for case in CASES], help="only these")
    parser.add_argument("--rounds", type=int, default=MOST_CLICKS, help="clicks for each structure")
    options = parser.parse_args()
    with ProgressBar() as progress:
        weights = find_weights(identify_model(options.weights) or options.model, options.weights, progress=progress)
        measured = [
            measure(case, method, options.volumes, weights, options.rounds, progress)
            for case in CASES
            if not options.cases or case.name in options.cases
            for method in METHODS
        ]
    report = {"model": weights.model.name, "summary": summary(measured), "runs": measured}
    with replacing(RESULTS / "accuracy.json") as path:
        path.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    with replacing(RESULTS / "accuracy.md") as path:
        path.write_text(tables(report), encoding="utf-8")
    print(tables(report))


def measure(
    case: Case, method: Method, folder: Path, weights: WeightsFile, rounds: int, progress: ProgressBar
) -> dict[str, Any]:
    """Metrics of each structure after each reported round of clicks."""
    session = open_session(folder / case.volume, method, weights, progress)
    truth = merged_labels(folder / case.labels, case)
    names, geometry = list(case.structures), session.volume.geometry
    spacing_mm = geometry.spacing_mm[::-1].tolist()

    def segment(clicks: Clicks) -> np.ndarray:
        return session.segment(classes_of(names, clicks, geometry), method.refinement).labels

    start = time.perf_counter()
    by_round = {}
    for state in click_in_rounds(truth, spacing_mm, segment, rounds):
        progress(state.number, rounds, f"{case.name}: {method.name}")
        if state.number in REPORTED_ROUNDS:
            by_round[str(state.number)] = {
                name: asdict(segmentation_metrics(state.labels == label, truth == label, spacing_mm))
                for label, name in enumerate(names, start=1)
            }
    return {"case": case.name, "method": method.name, "seconds": time.perf_counter() - start, "rounds": by_round}


def open_session(path: Path, method: Method, weights: WeightsFile, progress: ProgressBar) -> SegmentationSession:
    """A session with the default features, which all methods share through the cache."""
    chosen = replace(preset(DEFAULT_PRESET), similarity=method.similarity, statistics=method.statistics)
    session = SegmentationSession(read_volume(path), chosen, cache=FeatureCache())
    session.load_features(weights, choose_device("auto"), progress)
    return session


def merged_labels(path: Path, case: Case) -> np.ndarray:
    """Truth (K, J, I) uint8, 1 + index for each structure."""
    labels = sitk.GetArrayFromImage(sitk.ReadImage(str(path)))
    truth = np.zeros(labels.shape, dtype=np.uint8)
    for index, values in enumerate(case.structures.values(), start=1):
        truth[np.isin(labels, values)] = index
    return truth


def classes_of(names: Sequence[str], clicks: Clicks, geometry: Geometry) -> list[AnnotatedClass]:
    """The clicker's clicks as a user's annotations."""

    def positions(of_class: list, positive: bool) -> np.ndarray:
        ijk = [click.kji[::-1] for click in of_class if click.positive == positive]
        return geometry.ijk_to_ras_points(np.array(ijk, dtype=float).reshape(-1, 3))

    return [
        AnnotatedClass(name, default_color(index), positions(of_class, True), negative=positions(of_class, False))
        for index, (name, of_class) in enumerate(zip(names, clicks, strict=True))
    ]


def summary(measured: list[dict[str, Any]]) -> dict[str, Any]:
    """Mean Dice over the structures, by case, method and number of clicks."""
    means: dict[str, Any] = {}
    for run in measured:
        by_clicks = {
            number: round(float(np.mean([metrics["dice"] for metrics in structures.values()])), 4)
            for number, structures in run["rounds"].items()
        }
        means.setdefault(run["case"], {})[run["method"]] = by_clicks
    return {"mean_dice": means}


def tables(report: dict[str, Any]) -> str:
    """The report for people."""
    lines = [
        "# Accuracy by clicks",
        "",
        f"Features of {report['model']}, default preset. Mean Dice after so many clicks a structure.",
        "",
    ]
    rounds = list(next(iter(report["runs"]))["rounds"])
    lines += [f"| volume | method | {' | '.join(rounds)} |", "|---" * (2 + len(rounds)) + "|"]
    for case, methods in report["summary"]["mean_dice"].items():
        for method, by_clicks in methods.items():
            lines.append(f"| {case} | {method} | {' | '.join(f'{by_clicks[number]:.3f}' for number in rounds)} |")
    for run in report["runs"]:
        if run["method"] == METHODS[0].name:
            lines += ["", f"## {run['case']}, {run['method']}", ""]
            lines += _structure_table(run["rounds"])
    return "\n".join(lines) + "\n"


def _structure_table(rounds: dict[str, Any]) -> list[str]:
    last = rounds[max(rounds, key=int)]
    dice = " | ".join(f"Dice @{number}" for number in rounds)
    rows = [f"| structure | {dice} | surface Dice 2 mm | precision | recall |", "|---" * (4 + len(rounds)) + "|"]
    for name, metrics in last.items():
        by_round = " | ".join(f"{structures[name]['dice']:.3f}" for structures in rounds.values())
        rows.append(
            f"| {name} | {by_round} | {metrics['surface_dice']:.3f} | {metrics['precision']:.3f} | {metrics['recall']:.3f} |"
        )
    return rows


if __name__ == "__main__":
    main()
