"""How methods are run on clicks, and what becomes of the figures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from Benchmarks.accuracy.runs import run_on_clicks, run_with_own_clicks
from Benchmarks.shared.click_sequence import ClickSequence
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.labelled_cases import LabelledVolume, PhantomCase, classes_of
from Benchmarks.shared.machine import machine
from Benchmarks.shared.simulated_clicker import Click, Clicks
from Benchmarks.topology.topology import Topology, topology_of


def balls_around_clicks(labelled: LabelledVolume, clicks: Clicks) -> np.ndarray:
    """A method whose answer grows with the positive clicks: cubes around them."""
    labels = np.zeros(labelled.truth.shape, dtype=np.uint16)
    for label, of_class in enumerate(clicks, start=1):
        for click in of_class:
            if click.positive:
                labels[tuple(slice(max(n - 3, 0), n + 4) for n in click.kji)] = label
    return labels


def test_other_methods_are_given_the_very_same_clicks(labelled: LabelledVolume) -> None:
    seen: list[Clicks] = []

    def segment(part: LabelledVolume, clicks: Clicks) -> np.ndarray:
        seen.append(clicks)
        return balls_around_clicks(part, clicks)

    rounds, sequence = run_with_own_clicks(labelled, segment, "together", 3, with_negatives=True)
    first = list(seen)
    seen.clear()
    again = run_on_clicks(labelled, segment, "together", sequence, (1, 3))
    assert seen == [first[0], first[2]]
    for number in ("1", "3"):
        for name in labelled.names:
            assert again[number][name]["dice"] == rounds[number][name]["dice"]


def test_one_by_one_a_structure_has_its_own_clicks_alone(labelled: LabelledVolume) -> None:
    seen: list[Clicks] = []

    def segment(part: LabelledVolume, clicks: Clicks) -> np.ndarray:
        seen.append(clicks)
        assert len(part.names) == 1
        assert set(np.unique(part.truth)) == {0, 1}
        return balls_around_clicks(part, clicks)

    rounds, sequence = run_with_own_clicks(labelled, segment, "one by one", 2, with_negatives=True)
    assert len(seen) == 6
    assert set(rounds["2"]) == {"left", "right", "dark"}
    own = list(seen)
    seen.clear()
    run_on_clicks(labelled, segment, "one by one", sequence, (2,))
    assert seen == own[1::2]


def test_a_perfect_method_scores_one_and_needs_no_second_click(labelled: LabelledVolume) -> None:
    rounds, sequence = run_with_own_clicks(labelled, lambda part, _: part.truth, "together", 3, with_negatives=True)
    assert all(metrics["dice"] == metrics["surface_dice"] == 1.0 for metrics in rounds["3"].values())
    assert [len(of_class) for of_class in sequence.clicks] == [1, 1, 1]


def test_clicks_are_read_as_they_were_written() -> None:
    sequence = ClickSequence(((Click((1, 2, 3), True), Click((4, 5, 6), False)), (Click((7, 8, 9), True),)), ((1, 1), (2, 1)))
    assert ClickSequence.from_json(json.loads(json.dumps(sequence.as_json()))) == sequence
    assert sequence.at(1) == [[Click((1, 2, 3), True)], [Click((7, 8, 9), True)]]
    assert sequence.of_class(0).at(2) == [[Click((1, 2, 3), True), Click((4, 5, 6), False)]]


def test_a_method_without_negatives_gets_none(labelled: LabelledVolume) -> None:
    clicks = [[Click((1, 2, 3), True), Click((4, 5, 6), False)]]
    (with_them,) = classes_of(("one",), clicks, labelled.volume.geometry)
    (without,) = classes_of(("one",), clicks, labelled.volume.geometry, with_negatives=False)
    assert (len(with_them.negative), len(without.negative)) == (1, 0)
    np.testing.assert_array_equal(with_them.positive, without.positive)


def test_the_phantom_case_holds_a_sphere_and_a_torus_of_equal_brightness() -> None:
    labelled = PhantomCase(size=48).read(Path())
    assert topology_of(labelled.truth == 1) == Topology(1, 0, 0)
    assert topology_of(labelled.truth == 2) == Topology(1, 1, 0)
    ball, ring, around = (labelled.volume.array[labelled.truth == label].mean() for label in (1, 2, 0))
    assert ball == pytest.approx(ring, abs=2.0)
    assert ball > around + 50.0


def test_what_was_kept_is_not_measured_again(tmp_path: Path) -> None:
    kept = KeptResults(tmp_path)
    assert kept.get("one", lambda: {"dice": 0.5}) == {"dice": 0.5}
    assert kept.get("one", lambda: pytest.fail("measured again")) == {"dice": 0.5}


def a_run(method: str, mode: str, clicks: str, dice: dict[str, float]) -> dict[str, Any]:
    names = ("precision", "recall", "dice", "iou", "surface_dice", "seconds")
    rounds = {number: {"liver": dict.fromkeys(names, value)} for number, value in dice.items()}
    return {"case": "torso", "method": method, "mode": mode, "clicks": clicks, "rounds": rounds}


RUNS = [
    a_run("default", "together", "own", {"1": 0.5, "2": 0.6, "3": 0.7, "5": 0.8, "10": 0.9}),
    a_run("threshold", "together", "same", {"1": 0.1, "3": 0.2, "5": 0.3, "10": 0.4}),
    a_run("threshold", "together", "own", {"5": 0.35, "10": 0.45}),
    a_run("default", "one by one", "own", {"1": 0.55, "5": 0.85}),
    a_run("threshold", "one by one", "same", {"5": 0.25}),
    a_run("RF on 11 local features, true samples", "together", "true samples", {"1024": 0.65}),
]


def test_methods_are_compared_on_the_same_clicks() -> None:
    from Benchmarks.accuracy.report import summary

    means = summary(RUNS)
    assert means["mean_dice"]["torso"]["threshold"] == {"1": 0.1, "3": 0.2, "5": 0.3, "10": 0.4}
    assert means["mean_dice"]["torso"]["default"]["2"] == 0.6
    assert means["mean_dice"]["torso"]["RF on 11 local features, true samples"] == {"1024": 0.65}
    assert means["mean_dice_one_by_one"]["torso"] == {"default": {"1": 0.55, "5": 0.85}, "threshold": {"5": 0.25}}
    assert means["mean_dice_own_clicks"]["torso"]["threshold"] == {"5": 0.35, "10": 0.45}


def test_the_report_shows_every_method_and_names_the_best_baseline(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib").use("Agg")
    from Benchmarks.accuracy.report import write_report

    write_report({"model": "m", "machine": machine("cpu"), "runs": RUNS}, tmp_path)
    text = (tmp_path / "accuracy.md").read_text(encoding="utf-8")
    assert "| torso | threshold | 0.100 | 0.200 | 0.300 | 0.400 | 0.250 | 0.350 | 0.450 |" in text
    assert "0.300 (threshold)" in text
    assert "another data set" in text
    assert json.loads((tmp_path / "accuracy.json").read_text(encoding="utf-8"))["runs"] == RUNS
    assert (tmp_path / "accuracy_iou.png").stat().st_size > 0
