"""What becomes of the figures of the accuracy benchmark."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from Benchmarks.accuracy.click_changes import ClickChange, in_rounds, of_the_clicked, of_the_others, summarised
from Benchmarks.accuracy.comparison import lead_of, leads
from Benchmarks.accuracy.earlier import before_and_now
from Benchmarks.accuracy.figures import figures_of, spread
from Benchmarks.accuracy.goals import goals_reached
from Benchmarks.accuracy.summary import summary
from Benchmarks.shared.arguments import DEFAULT_MODEL
from Benchmarks.shared.labelled_cases import LabelledVolume
from Benchmarks.shared.machine import machine
from Benchmarks.shared.simulated_clicker import Click

METRICS = ("precision", "recall", "dice", "iou", "surface_dice", "seconds")
ALL_ROUNDS = ("1", "2", "3", "5")


def a_run(case: str, method: str, clicks: str, path: int, liver: dict[str, float], aorta: float = 0.5) -> dict[str, Any]:
    rounds = {
        number: {"liver": dict.fromkeys(METRICS, dice), "aorta": dict.fromkeys(METRICS, aorta)}
        for number, dice in liver.items()
    }
    return {"case": case, "method": method, "clicks": clicks, "path": path, "rounds": rounds}


def own(case: str, path: int, liver: dict[str, float], aorta: float = 0.5) -> dict[str, Any]:
    placed = {"clicks": [], "counts": [[n, 1] for n in range(1, len(liver) + 1)]}
    return {**a_run(case, "default", "own", path, liver, aorta), "placed": placed}


RUNS = [
    own("torso_small", 1, {"1": 0.4, "2": 0.6, "3": 0.55}),
    own("torso_small", 2, {"1": 0.6, "2": 0.8, "3": 0.75}, aorta=0.7),
    a_run("torso_small", "default", "size step", 1, {"1": 0.5, "3": 0.75}),
    a_run("torso_small", "default", "size step", 2, {"1": 0.7, "3": 0.75}, aorta=0.7),
    a_run("torso_small", "threshold", "same", 1, {"1": 0.2, "3": 0.3}, aorta=0.6),
    a_run("torso_small", "threshold", "same", 2, {"1": 0.2, "3": 0.3}, aorta=0.6),
    a_run("torso_small", "Grow from seeds", "same", 1, {"1": 0.3, "3": 0.4}, aorta=0.45),
    a_run("torso_small", "threshold", "own", 1, {"1": 0.2, "3": 0.35}, aorta=0.35),
    a_run("torso_small", "default", "one by one", 1, {"1": 0.5, "3": 0.6}),
    {
        "case": "torso_small", "method": "default", "clicks": "single clicks", "path": 1,
        "changes": [
            {"round": 2, "structure": "liver", "positive": True, "change": 0.1, "others": {"aorta": -0.3}},
            {"round": 2, "structure": "aorta", "positive": True, "change": -0.05, "others": {"liver": 0.0}},
        ],
    },
    own("brain", 1, {"1": 0.9}),
]  # fmt: skip


def test_the_spread_is_that_of_the_paths_and_not_of_the_structures() -> None:
    mean = figures_of(RUNS, "torso_small").mean("1")
    assert mean is not None
    # Means over the structures: 0.45 and 0.65.
    assert mean.mean == pytest.approx(0.55)
    assert mean.sd == pytest.approx(np.std([0.45, 0.65], ddof=1))
    assert str(mean) == "0.550 ± 0.141"


def test_one_path_has_no_spread() -> None:
    assert str(spread([0.5])) == "0.500"


def test_a_structure_has_its_own_spread() -> None:
    liver = figures_of(RUNS, "torso_small").structure("liver", "1")
    assert liver is not None
    assert (liver.mean, liver.sd, liver.paths) == (pytest.approx(0.5), pytest.approx(0.1414, abs=1e-3), 2)


def test_the_summary_has_both_columns_by_case_clicks_and_structure() -> None:
    columns = summary(RUNS)["cases"]["torso_small"]
    assert columns["clicks alone"]["1"]["dice"] == [0.55, 0.1414]
    assert columns["with one size step"]["1"]["structures"]["liver"] == [0.6, 0.1414]
    assert columns["clicks alone"]["1"]["paths"] == 2
    assert summary(RUNS)["cases"]["brain"]["clicks alone"]["1"]["dice"] == [0.7, None]


def test_the_lead_over_a_baseline_is_on_the_paths_that_it_was_given() -> None:
    # Threshold had both paths: 0.6 and 0.6 against 0.5 and 0.7. Grow from seeds had the first: 0.45 against 0.5.
    lead = lead_of(RUNS, "torso_small", "aorta", "1")
    assert lead is not None
    assert (lead.difference, lead.baseline) == (pytest.approx(0.0), "threshold")
    on_the_first = list(leads([run for run in RUNS if run["path"] == 1]))
    assert len(on_the_first) == 4
    assert min(on_the_first).difference == pytest.approx(-0.1)


def test_a_click_counts_where_the_structure_got_one() -> None:
    changes = list(in_rounds(RUNS[:1]))
    # The aorta was never clicked again.
    assert [round(change.change, 3) for change in changes] == [0.2, -0.05]
    assert changes[1].where == "torso_small, path 1: liver, click 3"


def test_a_loss_of_two_hundredths_is_none_also_where_it_is_a_difference() -> None:
    (change,) = in_rounds([own("torso_small", 1, {"1": 0.92, "2": 0.9})])
    found = summarised([change])
    assert found is not None
    assert found.unhurt == 1.0


def test_of_the_others_the_one_that_loses_most_counts() -> None:
    assert [change.change for change in of_the_clicked(RUNS)] == [0.1, -0.05]
    assert [change.change for change in of_the_others(RUNS)] == [-0.3, 0.0]


def test_a_loss_of_two_hundredths_is_none() -> None:
    found = summarised([ClickChange("a", -0.02), ClickChange("b", -0.03), ClickChange("c", 0.5), ClickChange("d", 0.0)])
    assert found is not None
    assert (found.count, found.unhurt, found.worst.where) == (4, 0.75, "b")
    assert summarised([]) is None


def test_goals_are_those_that_there_are_figures_for() -> None:
    reached = {goal.goal: goal for goal in goals_reached(RUNS)}
    first = reached["torso_small @1 ≥ 0.72"]
    assert (first.figure, first.stepped, first.is_reached) == (pytest.approx(0.55), pytest.approx(0.6), False)
    assert not any("amos" in goal for goal in reached)
    assert any("worst drop" in goal for goal in reached)


def test_what_is_below_a_goal_for_all_structures_is_named() -> None:
    (goal,) = goals_reached([own("amos_0336 all", 1, dict.fromkeys(("1", "2", "3", "4", "5"), 0.9), aorta=0.65)])[:1]
    assert goal.is_reached
    assert goal.note == "1 of 2 are below by themselves: aorta 0.65"


def test_the_report_shows_spread_methods_and_goals(tmp_path: Path, labelled: LabelledVolume) -> None:
    pytest.importorskip("matplotlib").use("Agg")
    _write_report("balanced", labelled, tmp_path)
    text = (tmp_path / "accuracy.md").read_text(encoding="utf-8")
    assert "| torso_small | 2 | 2 | 0.550 ± 0.141 | 0.625 ± 0.141 | 0.600 ± 0.141 | 0.675 ± 0.071 |" in text
    assert "| torso_small | threshold | 2 | 0.400 ± 0.000 | 0.450 ± 0.000 | – |" in text
    assert "| torso_small | default, on the first path | 1 | 0.450 | 0.525 | – |" in text
    assert "torso_small @1 ≥ 0.72" in text
    assert "another data set" in text
    written = json.loads((tmp_path / "accuracy.json").read_text(encoding="utf-8"))
    assert written["runs"][0]["dice"] == {"1": [0.4, 0.5], "2": [0.6, 0.5], "3": [0.55, 0.5]}
    assert written["summary"]["cases"]["torso_small"]["clicks alone"]["1"]["dice"] == [0.55, 0.1414]
    for picture in ("accuracy_iou.png", "accuracy_failures.webp"):
        assert (tmp_path / picture).stat().st_size > 0


@pytest.mark.parametrize(
    ("preset", "model", "name", "options"),
    [
        ("fine", DEFAULT_MODEL, "accuracy_fine", "--preset fine"),
        ("balanced", "dino_vits8", "accuracy_dino_vits8", "--model dino_vits8"),
        ("fine", "dino_vits8", "accuracy_dino_vits8_fine", "--model dino_vits8 --preset fine"),
    ],
)
def test_a_report_of_another_preset_or_model_has_files_of_its_own(
    tmp_path: Path, labelled: LabelledVolume, preset: str, model: str, name: str, options: str
) -> None:
    pytest.importorskip("matplotlib").use("Agg")
    _write_report(preset, labelled, tmp_path, model)
    text = (tmp_path / f"{name}.md").read_text(encoding="utf-8")
    assert f"`python dev.py bench accuracy --volumes DIR {options}`" in text
    for linked in re.findall(r"\]\((.*?)\)", text):
        assert (tmp_path / linked).stat().st_size > 0
    assert not list(tmp_path.glob("accuracy.*"))


def _write_report(preset: str, labelled: LabelledVolume, folder: Path, model: str = DEFAULT_MODEL) -> None:
    from Benchmarks.accuracy.failures import worst_structures
    from Benchmarks.accuracy.report import write_report

    clicks = [[Click((16, 20, 12), True)]] * 3
    failures = worst_structures("spheres", labelled, clicks, np.roll(labelled.truth, 3, axis=2))
    measured = {"model": model, "weights_sha256": "0" * 64, "preset": preset, "paths": 2}
    report = {**measured, "machine": machine("cpu"), "runs": RUNS}
    write_report(report, failures, folder, {})


def test_the_worst_structures_come_first(labelled: LabelledVolume) -> None:
    from Benchmarks.accuracy.failures import worst_structures

    labels = labelled.truth.copy()
    labels[labels == 3] = 0
    labels[:14][labels[:14] == 2] = 0
    clicks = [[Click((16, 20, 12), True)]] * 3
    worst, second = worst_structures("spheres", labelled, clicks, labels)
    assert worst.title == "spheres\ndark: 0.00 @1"
    assert "right" in second.title
    assert second.truth.sum() > second.result.sum() > 0


def test_a_failure_is_shown_in_the_slice_that_holds_most_of_it(labelled: LabelledVolume) -> None:
    from Benchmarks.accuracy.failures import worst_structures

    truth = np.zeros_like(labelled.truth)
    truth[4:28, 10:12, 8:40] = 1
    plate = LabelledVolume(labelled.volume, truth, ("plate",))
    (failure,) = worst_structures("box", plate, [[Click((16, 10, 12), True)]], np.zeros_like(truth))
    # Across J: rows are slices of 3 mm, columns 2 mm.
    assert failure.pixel_mm == (3.0, 2.0)
    assert failure.truth.sum() == 24 * 32


def test_an_earlier_run_is_put_beside_this_one_where_both_have_a_volume() -> None:
    cases = summary(RUNS)["cases"]
    name = next(iter(cases))
    lines = before_and_now({name: cases[name], "another": cases[name]}, cases).splitlines()
    assert lines[2].startswith(f"| **{name}** | mean, clicks alone |")
    first = [cell.strip() for cell in lines[2].split("|")][3:5]
    assert first[0] == first[1] != "–"
    assert not any("another" in line for line in lines)
