"""What refinement is worth on real data: `python dev.py bench refinement --volumes DIR [--weights PATH]`.

The simulated clicker annotates the structures of labelled scans with the default method. On these very clicks every structure's
coarse map S_L is then refined in each of several ways (`candidates`); the rest is as in the session: iso values,
competition between classes, parts that hold a positive point. What the product takes for all structures of a scan is timed as
well (`together`). Writes `refinement.json` and `refinement.md`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from Benchmarks.refinement.candidates import (
    ALL_ROUNDS,
    CANDIDATES,
    DEFAULT,
    LATE_ROUNDS,
    WALKER_INSIDE,
    WALKER_ISO,
    WALKER_OUTSIDE,
    WALKER_VOXELS,
    Candidate,
    CoarseMap,
)
from Benchmarks.refinement.together import REPEATS, refine_together
from Benchmarks.shared.arguments import scan_parser, scans_of, weights_of
from Benchmarks.shared.click_sequence import ClickSequence
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.labelled_cases import SCANS, LabelledVolume
from Benchmarks.shared.machine import in_words, machine
from Benchmarks.shared.report_files import write_results
from Benchmarks.shared.report_tables import number, paragraphs, table
from Benchmarks.shared.segmentation_metrics import dice, surface_distances_mm
from Benchmarks.shared.sessions import labels_of, load_features
from Benchmarks.shared.simulated_clicker import ClickedRound, Clicks, click_in_rounds
from ViTTransferFunction.Logic.core.classes.class_map import ClassMap
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest, points_against
from ViTTransferFunction.Logic.core.system.progress import Between, nothing_between
from ViTTransferFunction.Logic.core.volumes.bounding_box import bounding_box
from ViTTransferFunction.Logic.core.volumes.resampling import sample_at
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.core.volumes.voxel_map import VoxelMap
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.refinement.refinement import RefinementMethod
from ViTTransferFunction.Logic.refinement.settling import settle
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.session.refined_map import RefinedMap
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession
from ViTTransferFunction.Logic.similarity.similarity_map import SimilarityMap

NOISE = 0.01
"""Differences of Dice that say nothing: so much it changes with small changes of anything."""

Summary = dict[str, dict[str, dict[str, float]]]
"""Candidate → case → `dice` and `surface_distance_mm`, mean over structures and `LATE_ROUNDS`."""

HOW_TO_READ = f"""\
Dice and symmetric mean surface distance are means over the structures after {" and ".join(map(str, LATE_ROUNDS))} rounds of
clicks; `refinement.json` has each structure, and round {ALL_ROUNDS[0]} of the candidates that differ in kind. All are given the
clicks that corrected the default's errors, which favours it, if any of them: another candidate's errors would be elsewhere.
Seconds are those of refining one class, interpolation included, without the choice of the iso value.

- *bilateral (default)*: intensity likelihood with β 0.5, then the bilateral solver with λ 32, σ_luma 10 of 255 and σ_spatial of
  0.6 feature cells, at least 2 voxels. Rows named by a parameter change that one alone. The solver rounds σ_spatial to whole
  voxels, so that several of its values may come to the same.
  Its surface settles then, as that of all others that are not published ones, interpolation alone, or *not settled*.
- *trilinear* keeps the iso value of the coarse map, as the session does for a class that is not refined; *refined iso* chooses
  it anew, as for all others. *Likelihood alone* interpolates and weighs by intensity, and smooths nothing.
- *bilateral as published*: σ_spatial 7 voxels, σ_luma 5 of 255, λ 256, each voxel its cell's value, no likelihood; solved as in
  the product, and in its intensity window.
- *random walker*: scikit-image's, on the box that is refined, made coarser where it has more than {WALKER_VOXELS:,} voxels.
  Seeds inside are where the map exceeds {WALKER_INSIDE} of its value at the positive points, seeds outside where it is below
  {WALKER_OUTSIDE} of the iso value. Its probability takes the map's place, with a threshold of {WALKER_ISO}, or with the one
  that is chosen for the other candidates' maps (*refined iso*). Its β 130 is scikit-image's default.
- The bound of the likelihood grows with its β: a map changes by a factor of e^(1.5 β) at most."""


def main() -> None:
    """Measure every candidate on every case, and write what was measured."""
    options = scan_parser(__doc__, [case.name for case in SCANS]).parse_args()
    weights, kept = weights_of(options), KeptResults(options.keep)
    rows: list[dict[str, Any]] = []
    together: list[dict[str, Any]] = []
    for case in scans_of(options):
        labelled = case.read(options.volumes)
        bench = CaseBench(case.name, labelled, load_features(labelled.volume, weights), kept)
        rows += [bench.row(candidate) for candidate in CANDIDATES]
        together.append(bench.together())
    report = {"model": weights.model.name, "machine": machine(), "rows": rows, "together": together}
    write_report(report, options.results)


class CandidateSession(SegmentationSession):
    """The default session, whose maps a candidate refines.

    Args:
        volume: what is segmented.
        features: of the volume.

    Attributes:
        candidate: None: the session's own refinement.
        seconds: what each refinement took since this list was emptied, without the choice of the iso value.
    """

    def __init__(self, volume: Volume, features: FeatureVolume) -> None:
        super().__init__(volume, PRESETS[DEFAULT_PRESET])
        self.use_features(features)
        self.candidate: Candidate | None = None
        self.seconds: list[float] = []

    def refined_map(
        self,
        low: ClassMap,
        requests: Sequence[ClassRequest],
        index: int,
        method: RefinementMethod,
        between: Between = nothing_between,
    ) -> RefinedMap:
        """See `SegmentationSession`; the method is the candidate's."""
        if self.candidate is None:
            return super().refined_map(low, requests, index, method, between)
        positive = requests[index].positive
        at_positives = float(np.median(sample_at(low.array[..., None], self.features.geometry, positive)))
        coarse = CoarseMap(low.array, low.iso, at_positives, positive, self.volume, self.display_window)
        start = time.perf_counter()
        voxels = replace(VoxelMap.whole(self.candidate.refine(coarse)), coarse=low.array)
        self.seconds.append(time.perf_counter() - start)
        iso: float | str = self.candidate.iso
        if iso == "coarse":
            iso = low.iso
        elif iso == "refined":
            iso = self.rule.refined_iso(voxels, SimilarityMap(low.array, low.prior), requests, index).chosen
        if self.candidate.settles:
            against = points_against(requests, index)
            voxels = settle(voxels, self.volume, self.display_window, positive, against, float(iso), between)
        return RefinedMap(voxels, float(iso))


class CaseBench:
    """All candidates on one labelled volume.

    Args:
        name: of the case.
        labelled: the volume and its truth.
        features: of the volume.
        kept: what was measured before.
    """

    def __init__(self, name: str, labelled: LabelledVolume, features: FeatureVolume, kept: KeptResults) -> None:
        self._name, self._labelled, self._kept = name, labelled, kept
        self._session = CandidateSession(labelled.volume, features)
        self._clicks = ClickSequence.from_json(kept.get(f"refinement, {name}, clicks", self._place_clicks))

    def row(self, candidate: Candidate) -> dict[str, Any]:
        """Mean figures of the structures at the candidate's rounds."""
        measured = self._kept.get(f"refinement, {self._name}, {candidate.name}", partial(self._measure, candidate))
        return {"case": self._name, "candidate": candidate.name, **measured}

    def together(self) -> dict[str, Any]:
        """Seconds of all structures at the default's clicks; never kept, since they are this machine's and this code's."""
        self._session.candidate = None
        return {"case": self._name, **refine_together(self._session, self._labelled, self._clicks.at(LATE_ROUNDS[0]))}

    def _place_clicks(self) -> dict[str, Any]:
        """The clicks that correct the default method's errors."""
        self._session.candidate = None
        states = click_in_rounds(self._labelled.truth, self._labelled.spacing_mm, self._labels, ALL_ROUNDS[-1])
        return ClickSequence.of_rounds(ClickedRound(s.number, s.clicks, np.empty(0)) for s in states).as_json()

    def _labels(self, clicks: Clicks) -> np.ndarray:
        return labels_of(self._session, self._labelled, clicks)

    def _measure(self, candidate: Candidate) -> dict[str, Any]:
        self._session.candidate, self._session.seconds = candidate, []
        rounds = {str(number): self._metrics(self._labels(self._clicks.at(number))) for number in candidate.rounds}
        return {"rounds": rounds, "seconds": round(float(np.mean(self._session.seconds)), 4)}

    def _metrics(self, labels: np.ndarray) -> dict[str, Any]:
        truth, spacing_mm = self._labelled.truth, self._labelled.spacing_mm
        masks = [(labels == label, truth == label) for label in range(1, len(self._labelled.names) + 1)]
        return {
            "dice": [round(dice(*pair), 4) for pair in masks],
            "surface_distance_mm": [round(mean_surface_distance_mm(*pair, spacing_mm), 3) for pair in masks],
        }


def mean_surface_distance_mm(predicted: np.ndarray, truth: np.ndarray, spacing_mm: Sequence[float]) -> float:
    """Mean distance from the faces of either surface to the other, millimetres.

    Where nothing was predicted, it is the diagonal of the box around the truth: as if all were missed by its size.

    Args:
        predicted: (K, J, I) bool.
        truth: (K, J, I) bool, not empty.
        spacing_mm: of the voxels, along (K, J, I).

    Raises:
        ValueError: the truth is empty, and so is the prediction.
    """
    box = bounding_box(predicted | truth)
    if box is None:
        raise ValueError("a structure without any voxel has no surface to be far from")
    if not predicted.any():
        return float(np.linalg.norm(np.multiply([extent.stop - extent.start for extent in box], spacing_mm)))
    return float(surface_distances_mm(predicted[box], truth[box], spacing_mm).mean())


def write_report(report: dict[str, Any], folder: Path) -> None:
    """Write refinement.json and refinement.md."""
    summary = summarised(report["rows"])
    write_results(folder, "refinement", {**report, "summary": summary}, _text(report, summary))


def summarised(rows: Sequence[dict[str, Any]]) -> Summary:
    """The figures of the table; all candidates were measured at these rounds."""
    summary: Summary = {}
    for row in rows:
        late = [row["rounds"][str(number)] for number in LATE_ROUNDS]
        summary.setdefault(row["candidate"], {})[row["case"]] = {
            metric: round(float(np.mean([of_round[metric] for of_round in late])), 4)
            for metric in ("dice", "surface_distance_mm")
        }
    return summary


def verdict(summary: Summary) -> str:
    """Who wins, in words: beyond noise and on every volume, or not."""
    default = summary[DEFAULT.name]
    gains = {
        name: [of_case[case]["dice"] - default[case]["dice"] for case in default]
        for name, of_case in summary.items()
        if name != DEFAULT.name
    }
    means = {name: _mean(of_case, "dice") for name, of_case in summary.items()}
    distances = {name: _mean(of_case, "surface_distance_mm") for name, of_case in summary.items()}
    highest, nearest = max(means, key=means.__getitem__), min(distances, key=distances.__getitem__)
    sentences = [
        f"Over the volumes, mean Dice is highest with *{highest}* ({means[highest]:.3f}; default {means[DEFAULT.name]:.3f}), "
        f"and the mean surface distance smallest with *{nearest}* ({distances[nearest]:.2f} mm; default "
        f"{distances[DEFAULT.name]:.2f} mm).",
        f"Better than the default by more than {NOISE} Dice on every volume: {_listed(gains, lambda gain: min(gain) > NOISE)}.",
        f"Worse by more than that on every volume: {_listed(gains, lambda gain: max(gain) < -NOISE)}.",
        f"Within {NOISE} of it on every volume: {_listed(gains, lambda gain: max(map(abs, gain)) <= NOISE)}.",
    ]
    return " ".join(sentences)


def _mean(of_case: dict[str, dict[str, float]], metric: str) -> float:
    return float(np.mean([figures[metric] for figures in of_case.values()]))


def _listed(gains: dict[str, list[float]], chosen: Callable[[list[float]], bool]) -> str:
    return "; ".join(name for name, of_cases in gains.items() if chosen(of_cases)) or "none"


def _text(report: dict[str, Any], summary: Summary) -> str:
    cases = list(dict.fromkeys(row["case"] for row in report["rows"]))
    seconds = {(row["candidate"], row["case"]): row["seconds"] for row in report["rows"]}
    header = ["refinement", *(f"{case}: Dice / distance, mm" for case in cases), "Dice", "seconds a class"]
    rows = [
        [
            name,
            *(f"{number(of_case[c]['dice'])} / {number(of_case[c]['surface_distance_mm'], 2)}" for c in cases),
            number(_mean(of_case, "dice")),
            number(float(np.mean([seconds[name, case] for case in cases])), 2),
        ]
        for name, of_case in summary.items()
    ]
    intro = f"Features of {report['model']}, default preset. {in_words(report['machine'])}. "
    intro += "Command: `python dev.py bench refinement`."
    return paragraphs(
        "# Refinement on real data",
        intro,
        table(header, rows),
        verdict(summary),
        HOW_TO_READ,
        "## All structures of a scan",
        f"From coarse maps to labels, after {LATE_ROUNDS[0]} rounds of clicks: median of {REPEATS} (slowest).",
        table(
            ["volume", "structures", "time"],
            [
                [of["case"], str(of["structures"]), f"{number(of['seconds'], 2)} s ({number(of['slowest'], 2)} s)"]
                for of in report["together"]
            ],
        ),
    )


if __name__ == "__main__":
    main()
