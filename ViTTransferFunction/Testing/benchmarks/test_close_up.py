"""Who looks closely at what, and what becomes of the figures."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from Benchmarks.close_up.looking_user import LookingUser, Press
from Benchmarks.close_up.report import CHOICES, CLOSE_UPS, WHOLE, lost_share, pairs_of, summary, write_report
from Benchmarks.close_up.who_presses import SMALL_ML, small_or_thin, volumes_ml
from Benchmarks.shared.every_structure import EVERY_STRUCTURE
from Benchmarks.shared.labelled_cases import LabelledVolume
from Benchmarks.shared.machine import machine
from Benchmarks.shared.simulated_clicker import Click, Clicks
from ViTTransferFunction.Logic.core.classes.class_map import ClassMap
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.classes.close_up_choice import close_up_of
from ViTTransferFunction.Logic.core.system.progress import Progress, no_progress
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.session.segmentation import Segmentation
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession


class WatchedSession(SegmentationSession):
    """Looks at the whole volume whatever it is asked, and remembers which close-ups it was asked for."""

    def __init__(self, labelled: LabelledVolume, features: FeatureVolume) -> None:
        super().__init__(labelled.volume, PRESETS[DEFAULT_PRESET])
        self.use_features(features)
        self.segmented: list[list[str]] = []
        self.looked: list[list[str]] = []

    def segment(self, requests: Sequence[ClassRequest], *args: Any, **options: Any) -> Segmentation:
        self.segmented.append(_closely(requests))
        return super().segment([replace(request, close_up=None) for request in requests], *args, **options)

    def look_closer(self, requests: Sequence[ClassRequest], progress: Progress = no_progress) -> None:
        if _closely(requests):
            self.looked.append(_closely(requests))

    def low_resolution_maps(self, requests: Sequence[ClassRequest], *args: Any) -> list[ClassMap]:
        return super().low_resolution_maps([replace(request, close_up=None) for request in requests], *args)


def _closely(requests: Sequence[ClassRequest]) -> list[str]:
    return [request.name for request in requests if request.close_up is not None]


def clicks_on(labelled: LabelledVolume) -> Clicks:
    """One on the middle of each structure."""
    middles = [np.argwhere(labelled.truth == label).mean(axis=0).round().astype(int) for label in (1, 2, 3)]
    return [[Click((int(k), int(j), int(i)), positive=True)] for k, j, i in middles]


def test_close_ups_are_asked_for_once_at_the_first_clicks_and_stay(labelled: LabelledVolume, features: FeatureVolume) -> None:
    session = WatchedSession(labelled, features)
    user, clicks = LookingUser(session, ("left", "dark")), clicks_on(labelled)
    user(labelled, clicks)
    # Pressed on one, then on the other; and in use when labels are made.
    assert session.looked == [["left"], ["left", "dark"], ["left", "dark"]]
    # What is shown before the presses, and what is measured after them.
    assert session.segmented == [[], ["left", "dark"]]
    user(labelled, [[*of_class, Click((0, 0, 0), positive=False)] for of_class in clicks])
    assert session.looked[3:] == [["left", "dark"]]
    assert session.segmented[2:] == [["left", "dark"]]


def test_a_box_is_that_of_the_segment_as_it_is_shown(labelled: LabelledVolume, features: FeatureVolume) -> None:
    user, clicks = LookingUser(WatchedSession(labelled, features), ("right",)), clicks_on(labelled)
    geometry = labelled.volume.geometry
    shown = user(labelled, clicks) == labelled.names.index("right") + 1
    assert shown.any()
    point = geometry.ijk_to_ras_points(np.array([clicks[labelled.names.index("right")][0].kji[::-1]], dtype=float))
    expected = close_up_of(ClassMap(shown.astype(np.float32), geometry, 0.5), point, geometry)
    (press,) = user.pressed
    assert press.size_mm == expected.size_mm
    assert press.voxels == shown[expected.box_in(geometry, point)].size


def test_a_structure_whose_box_is_too_large_stays_as_it_is(
    labelled: LabelledVolume, features: FeatureVolume, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ViTTransferFunction.Logic.core.classes.close_up_choice.LARGEST_SHARE", 0.01)
    session = WatchedSession(labelled, features)
    user = LookingUser(session, ("left",))
    user(labelled, clicks_on(labelled))
    assert user.pressed == [Press("left")]
    assert session.looked == []


def test_by_the_whole_nothing_is_computed_twice(labelled: LabelledVolume, features: FeatureVolume) -> None:
    session = WatchedSession(labelled, features)
    LookingUser(session, ())(labelled, clicks_on(labelled))
    assert session.segmented == [[]]


def test_what_is_small_or_a_tube_is_looked_at_closely(labelled: LabelledVolume) -> None:
    named = replace(labelled, names=("iliac artery left", "heart", "liver"))
    millilitres = dict(volumes_ml(named))
    # Balls of 16 mm radius.
    assert millilitres["heart"] == pytest.approx(17.2, rel=0.05)
    assert small_or_thin(named, 10.0) == ("iliac artery left",)
    assert small_or_thin(named, 20.0) == named.names


def test_all_cases_with_every_structure_are_measured() -> None:
    assert set(SMALL_ML) == {case.name for case in EVERY_STRUCTURE}


def run(way: str, path: int, dice: dict[str, float], presses: Sequence[Press] = ()) -> dict[str, Any]:
    """A run of a case "scan" whose Dice is the same in all rounds."""
    rounds = {clicks: {name: {"dice": value} for name, value in dice.items()} for clicks in "12345"}
    pressed = [asdict(press) for press in presses]
    return {"case": "scan", "way": way, "path": path, "rounds": rounds, "placed": {}, "presses": pressed}


RUNS = [
    run(WHOLE, 1, {"gland": 0.2, "vein": 0.3, "liver": 0.9}),
    run(CLOSE_UPS, 1, {"gland": 0.6, "vein": 0.3, "liver": 0.85}, [Press("gland", (9.0, 8.0, 7.0), 504), Press("vein")]),
    run(WHOLE, 2, {"gland": 0.4, "vein": 0.5, "liver": 0.9}),
    run(CLOSE_UPS, 2, {"gland": 0.3, "vein": 0.9, "liver": 0.89},
        [Press("gland", (9.0, 8.0, 7.0), 504), Press("vein", (1.0, 2.0, 30.0), 60)]),
    run(WHOLE, 3, {"gland": 0.4, "vein": 0.5, "liver": 0.9}),
]  # fmt: skip
TIMED = [Press("gland", (9.0, 8.0, 7.0), 504, 2.0), Press("vein"), Press("duct", (9.0, 8.0, 7.0), 504, 4.0)]
CASES = {
    "scan": {
        "millilitres": {"gland": 3.0, "vein": 20.0, "liver": 1500.0},
        "timed": [asdict(press) for press in TIMED],
        "timed_on": machine("cpu"),
    }
}


def test_both_ways_are_compared_on_what_was_looked_at_on_the_same_path() -> None:
    of_case = summary(RUNS, CASES)["scan"]
    # Path 3 was measured one way only.
    assert of_case["paths"] == 2
    # 0.2 and (0.4 + 0.5) / 2; 0.6 and (0.3 + 0.9) / 2.
    assert of_case["looked at closely"][WHOLE]["5"][0] == pytest.approx(0.325)
    assert of_case["looked at closely"][CLOSE_UPS]["5"] == pytest.approx([0.6, 0.0])
    assert of_case["all"][WHOLE]["1"][0] == pytest.approx((1.4 + 1.8) / 6, abs=1e-4)
    assert (of_case["close_ups"], of_case["refused"], of_case["seconds"]) == (3, 1, 3.0)


def test_a_loss_is_what_a_user_would_see() -> None:
    pairs = pairs_of(RUNS)["scan"]
    assert lost_share(pairs, CHOICES["looked at closely"]) == pytest.approx(1 / 3, abs=1e-4)
    assert lost_share(pairs, CHOICES["all others"]) == pytest.approx(1 / 3, abs=1e-4)
    assert lost_share(pairs, lambda pair: []) is None


def test_the_report_has_a_line_for_every_structure(tmp_path: Path) -> None:
    write_report({"model": "m", "machine": machine("cpu"), "cases": CASES, "runs": RUNS}, tmp_path)
    text = (tmp_path / "close_up.md").read_text(encoding="utf-8")
    assert "| gland | 3.0 | 2 | 0.300 | 0.450 | 0.300 | 0.450 | 0.300 | 0.450 | +0.150 |" in text
    assert "| scan | 3 | 1 | 9 (9 to 30) | 1 (0 to 1) |" in text
    assert "| scan | 2 | 3.0 (2.0 to 4.0) |" in text
    # The gland of the first path; the gland and the vein of the second one.
    assert "| scan | 0.2 to 0.4 | 1 | +0.400 | +0.400 | +0.400 | 0% |" in text
    assert "| scan | 0.4 to 1.0 | 2 | +0.150 | +0.150 | +0.150 | 50% |" in text
    figures = json.loads((tmp_path / "close_up.json").read_text(encoding="utf-8"))
    assert figures["summary"]["scan"]["refused"] == 1
    assert [run["way"] for run in figures["runs"]] == [run["way"] for run in RUNS]
