"""How methods are run on clicks, and what becomes of the figures."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from Benchmarks.accuracy.runs import run_on_clicks, run_one_by_one, run_with_own_clicks
from Benchmarks.accuracy.single_clicks import run_single_clicks
from Benchmarks.accuracy.size_steps import run_size_steps
from Benchmarks.shared.aim import Aim, persons_aims
from Benchmarks.shared.click_sequence import ClickSequence
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.labelled_cases import LabelledVolume, PhantomCase, classes_of
from Benchmarks.shared.sessions import labels_of, session_on
from Benchmarks.shared.simulated_clicker import Click, Clicks
from Benchmarks.topology.topology import Topology, topology_of
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession


def balls_around_clicks(labelled: LabelledVolume, clicks: Clicks) -> np.ndarray:
    """A method whose answer grows with the positive clicks: cubes around them."""
    labels = np.zeros(labelled.truth.shape, dtype=np.uint16)
    for label, of_class in enumerate(clicks, start=1):
        for click in of_class:
            if click.positive:
                labels[tuple(slice(max(n - 3, 0), n + 4) for n in click.kji)] = label
    return labels


def aims_of(labelled: LabelledVolume) -> list[Aim]:
    return persons_aims(1, len(labelled.names))


def test_other_methods_are_given_the_very_same_clicks(labelled: LabelledVolume) -> None:
    seen: list[Clicks] = []

    def segment(part: LabelledVolume, clicks: Clicks) -> np.ndarray:
        seen.append(clicks)
        return balls_around_clicks(part, clicks)

    rounds, sequence = run_with_own_clicks(labelled, segment, 3, True, aims_of(labelled))
    first = list(seen)
    seen.clear()
    again = run_on_clicks(labelled, segment, sequence, (1, 3))
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

    rounds = run_one_by_one(labelled, segment, 2, aims_of(labelled))
    assert len(seen) == 6
    assert set(rounds["2"]) == {"left", "right", "dark"}


def test_paths_differ_and_each_is_always_the_same(labelled: LabelledVolume) -> None:
    def clicks(path: int) -> Clicks:
        _, sequence = run_with_own_clicks(labelled, balls_around_clicks, 2, True, persons_aims(path, len(labelled.names)))
        return sequence.at(2)

    assert clicks(1) == clicks(1)
    assert clicks(1) != clicks(2)


def test_a_perfect_method_scores_one_and_needs_no_second_click(labelled: LabelledVolume) -> None:
    rounds, sequence = run_with_own_clicks(labelled, lambda part, _: part.truth, 3, True, aims_of(labelled))
    assert all(metrics["dice"] == metrics["surface_dice"] == 1.0 for metrics in rounds["3"].values())
    assert [len(of_class) for of_class in sequence.clicks] == [1, 1, 1]


def test_one_size_step_is_never_worse_and_is_said(labelled: LabelledVolume, features: FeatureVolume) -> None:
    session = session_on(labelled.volume, features)
    _, clicks = run_with_own_clicks(labelled, partial(whole_session, session), 1, True, aims_of(labelled))
    chosen = run_on_clicks(labelled, partial(whole_session, session), clicks, (1,))["1"]
    stepped = run_size_steps(labelled, session, clicks, (1,))["1"]
    for name in labelled.names:
        assert stepped[name]["step"] in (-1.0, 0.0, 1.0)
        assert stepped[name]["dice"] >= chosen[name]["dice"]
        assert stepped[name]["dice"] > chosen[name]["dice"] or stepped[name]["step"] == 0.0


def test_a_step_is_taken_where_the_truth_is_larger(labelled: LabelledVolume, features: FeatureVolume) -> None:
    session = session_on(labelled.volume, features)
    clicks = ClickSequence(((Click((16, 20, 12), True),),), ((1,),))
    requests = classes_of(("left",), clicks.at(1), labelled.volume.geometry)
    larger = session.segment([replace(request, size=1.0) for request in requests]).labels
    wanted = replace(labelled, truth=larger.astype(np.uint8), names=("left",))
    found = run_size_steps(wanted, session, clicks, (1,))["1"]["left"]
    assert (found["step"], found["dice"]) == (1.0, 1.0)


def whole_session(session: SegmentationSession, labelled: LabelledVolume, clicks: Clicks) -> np.ndarray:
    return labels_of(session, labelled, clicks)


def test_single_clicks_say_what_becomes_of_the_clicked_and_of_the_others(labelled: LabelledVolume) -> None:
    def segment(part: LabelledVolume, clicks: Clicks) -> np.ndarray:
        """All is right, until the second click on the right one empties the left one."""
        labels = part.truth.astype(np.uint16)
        labels[0, 0, 0] = 2
        if len(clicks[1]) > 1:
            labels[labels == 1] = 0
        return labels

    changes = run_single_clicks(labelled, segment, 2, aims_of(labelled))
    assert [change["structure"] for change in changes] == ["right"]
    assert changes[0]["others"] == {"left": -1.0, "dark": 0.0}
    assert (changes[0]["change"], changes[0]["positive"], changes[0]["round"]) == (0.0, False, 2)


def test_clicks_are_read_as_they_were_written() -> None:
    sequence = ClickSequence(((Click((1, 2, 3), True), Click((4, 5, 6), False)), (Click((7, 8, 9), True),)), ((1, 1), (2, 1)))
    assert ClickSequence.from_json(json.loads(json.dumps(sequence.as_json()))) == sequence
    assert sequence.at(1) == [[Click((1, 2, 3), True)], [Click((7, 8, 9), True)]]
    assert sequence.at(2) == sequence.at(9) == [list(of_class) for of_class in sequence.clicks]


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
