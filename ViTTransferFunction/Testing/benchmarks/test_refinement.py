"""The refinement benchmark: candidates against the product, its figures, and what it says of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from Benchmarks.refinement.candidates import CANDIDATES, DEFAULT, Candidate, CoarseMap, walker_seeds
from Benchmarks.refinement.run import CandidateSession, CaseBench, mean_surface_distance_mm, verdict, write_report
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.labelled_cases import LabelledVolume
from Benchmarks.shared.machine import machine
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.refinement import intensity_likelihood
from ViTTransferFunction.Logic.refinement.refinement import RefinementMethod, refine

SPACING_MM = (3.0, 2.0, 2.0)


@pytest.fixture
def coarse(labelled: LabelledVolume, features: FeatureVolume) -> CoarseMap:
    """The left sphere."""
    centre = labelled.volume.geometry.ijk_to_ras_points(np.argwhere(labelled.truth == 1).mean(axis=0)[None, ::-1])
    session = CandidateSession(labelled.volume, features)
    similarity = np.clip(features.array[..., 1].astype(np.float32), 0.0, 1.0)
    return CoarseMap(similarity, 0.5, 1.0, centre, labelled.volume, session.display_window)


@pytest.mark.parametrize(("name", "method"), [(DEFAULT.name, "bilateral"), ("guided", "guided"), ("trilinear", "none")])
def test_candidates_of_the_product_are_the_product(coarse: CoarseMap, name: str, method: RefinementMethod) -> None:
    refined = refine(coarse.similarity, coarse.volume, coarse.display, coarse.positive_ras, coarse.iso, method).array
    np.testing.assert_array_equal(_called(name).refine(coarse), refined)


def test_another_temper_is_used_and_then_restored(coarse: CoarseMap) -> None:
    before = intensity_likelihood.TEMPER
    strong, default = _called("likelihood β 1.0").refine(coarse), DEFAULT.refine(coarse)
    assert before == intensity_likelihood.TEMPER
    assert np.abs(strong - default).max() > 0.01


@pytest.mark.parametrize("candidate", CANDIDATES, ids=lambda candidate: candidate.name)
def test_every_candidate_finds_most_of_a_plain_sphere(
    coarse: CoarseMap, labelled: LabelledVolume, candidate: Candidate
) -> None:
    if candidate.name.startswith("random walker"):
        pytest.importorskip("skimage.segmentation")
    truth = labelled.truth == 1
    refined = candidate.refine(coarse)
    assert refined.shape == truth.shape
    assert refined.dtype == np.float32
    assert refined.min() >= 0.0
    assert refined.max() <= 1.0
    assert refined[truth].mean() > 3.0 * refined[~truth].mean()


def test_candidates_have_names_of_their_own() -> None:
    assert len({candidate.name for candidate in CANDIDATES}) == len(CANDIDATES)


def test_the_random_walker_always_has_seeds_of_both_kinds() -> None:
    flat = np.array([[[0.3, 0.35, 0.4]]], dtype=np.float32)
    assert walker_seeds(flat, at_positives=0.9, iso=0.5).tolist() == [[[2, 0, 1]]]
    steep = np.array([[[0.0, 0.1, 0.3, 0.8, 0.9]]], dtype=np.float32)
    assert walker_seeds(steep, at_positives=0.9, iso=0.5).tolist() == [[[2, 2, 0, 1, 1]]]


@pytest.mark.slow
def test_shifted_slabs_are_apart_by_what_their_faces_are() -> None:
    truth, predicted = np.zeros((2, 20, 400, 400), dtype=bool)
    truth[5:10], predicted[7:12] = True, True
    assert mean_surface_distance_mm(predicted, truth, SPACING_MM) == pytest.approx(2 * SPACING_MM[0], rel=0.05)
    assert mean_surface_distance_mm(truth, truth, SPACING_MM) == 0.0


def test_nothing_predicted_is_as_far_away_as_the_structure_is_large() -> None:
    truth = np.zeros((8, 8, 8), dtype=bool)
    truth[2:6, 2:4, 3] = True
    assert mean_surface_distance_mm(np.zeros_like(truth), truth, SPACING_MM) == pytest.approx(np.sqrt(12**2 + 4**2 + 2**2))


@pytest.mark.slow
def test_a_candidate_is_given_the_clicks_that_were_kept(
    labelled: LabelledVolume, features: FeatureVolume, tmp_path: Path
) -> None:
    bench = CaseBench("spheres", labelled, features, KeptResults(tmp_path))
    first = bench.row(DEFAULT)
    clicks = json.loads((tmp_path / "refinement, spheres, clicks.json").read_text(encoding="utf-8"))
    assert len(clicks["counts"]) == 10
    assert set(first["rounds"]) == {"3", "5", "10"}
    assert min(first["rounds"]["10"]["dice"]) > 0.9
    renamed = Candidate("the default again", DEFAULT.in_crop, rounds=DEFAULT.rounds)
    again = CaseBench("spheres", labelled, features, KeptResults(tmp_path)).row(renamed)
    assert again["rounds"] == first["rounds"]


@pytest.mark.slow
def test_all_structures_are_timed_as_the_product_refines_them(labelled: LabelledVolume, features: FeatureVolume) -> None:
    bench = CaseBench("spheres", labelled, features, KeptResults(None))
    together = bench.together()
    assert (together["case"], together["structures"]) == ("spheres", len(labelled.names))
    assert 0.0 < together["seconds"] <= together["slowest"]


def test_the_report_says_who_wins(tmp_path: Path) -> None:
    rows = [_row(DEFAULT.name, "a", 0.8), _row(DEFAULT.name, "b", 0.7), _row("other", "a", 0.85), _row("other", "b", 0.75)]
    together = [{"case": "a", "structures": 2, "seconds": 0.123, "slowest": 0.2}]
    write_report({"model": "tiny", "machine": machine("cpu"), "rows": rows, "together": together}, tmp_path)
    summary = json.loads((tmp_path / "refinement.json").read_text(encoding="utf-8"))["summary"]
    assert summary["other"]["a"] == {"dice": 0.85, "surface_distance_mm": 1.0}
    text = (tmp_path / "refinement.md").read_text(encoding="utf-8")
    assert "| other | 0.850 / 1.00 | 0.750 / 1.00 | 0.800 |" in text
    assert "| a | 2 | 0.12 s (0.20 s) |" in text
    assert "Better than the default by more than 0.01 Dice on every volume: other." in text


def test_a_gain_on_one_volume_alone_is_none() -> None:
    figures = {"surface_distance_mm": 1.0}
    summary = {
        DEFAULT.name: {"a": {"dice": 0.8, **figures}, "b": {"dice": 0.7, **figures}},
        "other": {"a": {"dice": 0.9, **figures}, "b": {"dice": 0.7, **figures}},
    }
    assert "on every volume: other" not in verdict(summary)


def _row(candidate: str, case: str, dice: float) -> dict[str, Any]:
    of_round = {"dice": [dice, dice], "surface_distance_mm": [1.0, 1.0]}
    return {"candidate": candidate, "case": case, "rounds": {"5": of_round, "10": of_round}, "seconds": 0.1}


def _called(name: str) -> Candidate:
    return next(candidate for candidate in CANDIDATES if candidate.name == name)
