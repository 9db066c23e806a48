"""Figures in the documents and in the module's help are those that were measured last: copies, and easily forgotten."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterator
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from ViTTransferFunction.Logic.core.classes.small_outlines import LEAST_AGREEMENT

ROOT = Path(__file__).parents[3]
CASES = {
    "abdominal CT with contrast (AMOS 336), 7 organs": "amos_0336",
    "AMOS 336, contrast CT, 7 organs": "amos_0336",
    "torso CT, 7 organs": "torso_small",
    "brain MR, 7 structures": "brain",
    "AMOS 336, the liver's box, 4 organs": "amos_0336 liver crop",
    "torso, the liver's box, 5 organs": "torso_small liver crop",
    "chest, the lungs' box": "chest lungs crop",
    "chest CT in 10 mm slices: lungs, ribs, vertebrae": "chest",
    "chest CT, 10 mm slices, lungs, ribs, vertebrae": "chest",
    "abdominal MR, 11 structures": "abdomen MR",
    "chest CT with a dissected aorta: aorta, heart, pulmonary artery": "aortic dissection",
    "brain tumour in MR, 16 ml": "brain tumour 1",
    "brain tumour in MR, 2 ml": "brain tumour 2",
    "breast tumour in MR, 0.1 ml": "breast tumour",
    "abdominal MR, 117×91×20 voxels of 3 mm": "abdomen MR",
    "chest CT with contrast, 233×167×191 voxels of 1.5 mm": "aortic dissection",
    "brain MR, 25 slices of 6.5 mm: a tumour of 16 ml": "brain tumour 1",
    "brain MR, 23 slices of 6.5 mm: a tumour of 2 ml": "brain tumour 2",
    "breast MR, 45×120×21 voxels: a tumour of 0.1 ml": "breast tumour",
    "torso CT": "torso_small",
    "brain MR": "brain",
    "AMOS 336": "amos_0336",
    "torso": "torso_small",
    "brain": "brain",
    "chest": "chest",
}
"""The scans' names in tables, and those in the results."""
OWN_SCANS = {
    "brain tumour in MR (FLAIR), all of its 110 ml": "brain tumour MR FLAIR",
    "the same, with contrast: its core, 59 ml": "brain tumour MR T1 contrast",
    "brain MR, 8 deep structures": "deep brain MR",
    "heart MR: ventricles, left myocardium": "heart MR 1",
    "another heart MR, the same": "heart MR 2",
    "abdominal CT with contrast: liver": "liver CT",
    "chest CT: lungs, a tumour of 156 ml, spinal cord": "lung cancer CT",
    "chest CT: a nodule of 2 ml": "lung nodule CT",
    "spine MR, 5 discs": "spine MR discs",
    "spine MR, 7 vertebral bodies": "spine MR vertebrae",
    "sarcoma of a thigh in MR (T1): tumour, oedema": "thigh sarcoma MR T1",
    "the same (T2)": "thigh sarcoma MR T2",
}
"""The names of scans that were not looked at before, in the README's table and in the results."""
LUNGS = {
    "a nodule of 6.7 ml, at the pleura": "lung nodule CT LIDC-IDRI-0001",
    "three nodules of 5.4, 0.4 and 1.2 ml": "lung nodule CT LIDC-IDRI-0003",
    "a nodule of 1.4 ml, 5 mm slices": "lung nodule CT PyRadiomics lung1",
    "ground glass, 5.1 ml": "lung nodule CT LIDC-IDRI-0002",
    "a tumour of 48 ml, 5 mm slices": "lung tumour CT PyRadiomics lung2",
    "a part: a tumour of 6.5 ml around a bronchus": "lung nodule CT Maastro patient 2",
    "a part: a tumour of 11.6 ml at the mediastinum": "lung nodule CT Maastro patient 3",
}
"""The names of scans of lungs in RESULTS, and in the results."""
OTHER_KINDS = {
    "foetal brain MR (T2), 28 weeks: 7 tissues and parts": "foetal brain MR",
    "brain MR (T2) of a newborn: 7 structures": "newborn brain MR",
    "lumbar spine MR (T2), a part: 3 vertebrae, discs, canal": "lumbar MR T2",
    "neck MR (T1): spinal cord": "spinal cord MR T1",
    "neck MR (T2): spinal cord": "spinal cord MR T2",
    "neck MR (T2*), 11 slices of 7.5 mm: grey matter of the cord, 1.3 ml": "spinal cord MR T2-star",
    "MR angiography, a part: aorta where it divides, 13 ml": "aorta MR angiography",
    "prostate MR (T2)": "prostate MR T2",
    "MR (T1): a sarcoma of 80 ml": "sarcoma MR T1",
    "CT: a sarcoma of 53 ml": "sarcoma CT",
    "lumbar spine CT, a part: 3 vertebrae with their processes": "vertebrae CT",
    "whole-body PET: a tumour of the neck, 9 metastases": "neck PET",
    "whole-body PET: a sarcoma of a thigh, its oedema": "thigh sarcoma PET",
    "SPECT: 2 lesions in a liver": "liver SPECT",
    "ultrasound: prostate": "prostate ultrasound",
}
"""The names of scans of other kinds in RESULTS, and in the results."""
NO_CT_NOR_MR = ("neck PET", "thigh sarcoma PET", "liver SPECT", "prostate ultrasound")
GESTURES = {
    "all structures of 21 scans and 3 parts of scans, whatever their shape": "",
    "a nodule of 2 ml in a lung": "lung nodule CT",
    "a brain tumour of 2 ml": "brain tumour 2",
}
"""The README's rows of what a first gesture is worth, and the scans in the results; "" for the mean of all."""
BEGUN_WITH = {"clicks": "clicks", "a diameter, then clicks": "diameter", "an outline, then clicks": "outline"}
CLOSE_UPS = {"amos_0336 all": "AMOS 336", "brain 20": "brain", "torso_small all": "torso"}
SMALL_STRUCTURES = CLOSE_UPS | {"lung cancer CT": "lung cancer CT", "lung nodule CT": "lung nodule", "all": "all"}
"""What the scans are called where closer looks are measured, and in the results."""
PRESETS = {"*balanced*": "accuracy", "*fine*": "accuracy_fine"}
REFINEMENTS = {
    "solver, default": ("bilateral (default)", "bilateral, not settled"),
    "guided filter": ("guided", "guided, not settled"),
    "trilinear interpolation": ("", "trilinear"),
    "solver with the published parameters": ("", "bilateral as published"),
}
"""METHOD's rows of refinement, and in the results the candidates whose surfaces have settled and have not; "" for none."""
TUNED_ON = ("amos_0336", "torso_small", "brain")
SPOILED = {
    "three scans, in rounds": ("accuracy", TUNED_ON),
    "chest, in rounds": ("accuracy", ("chest",)),
    "five [other scans](#how-accurate-is-it-on-other-scans), in rounds": (
        "accuracy",
        ("abdomen MR", "aortic dissection", "brain tumour 1", "brain tumour 2", "breast tumour"),
    ),
    "all cases of `bench accuracy` together, changed scans and single structures too, in rounds": ("accuracy", ()),
    "twelve [scans not looked at before](#how-accurate-is-it-on-scans-not-looked-at-before), in rounds": ("own_scans", ()),
}
"""RESULTS' rows of what one more click spoils, and the results and cases that they are of; () for all."""
CLICKS = ("1", "3", "5")


def rows_of(document: str, header: str) -> Iterator[list[str]]:
    """The rows of all tables with a header, as cells; where the first one is empty, with that of the row above."""
    text = (ROOT / document).read_text(encoding="utf-8")
    tables = re.findall(rf"^{re.escape(header)}\n\|[-|]+\n((?:\|.*\n)+)", text, re.MULTILINE)
    assert tables, f"{document} has no table with the header {header}"
    for table in tables:
        first = ""
        for line in table.splitlines():
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            first = cells[0] or first
            yield [first, *cells[1:]]


def summary(name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((ROOT / f"Benchmarks/results/{name}.json").read_text(encoding="utf-8"))["summary"]
    return found


def means(cases: Collection[dict[str, Any]], clicks: str = "12345") -> list[str]:
    """The mean Dice of cases after so many clicks."""
    return [figure(sum(case["clicks alone"][n]["dice"][0] for case in cases) / len(cases), None) for n in clicks]


def one_line(document: str) -> str:
    return " ".join((ROOT / document).read_text(encoding="utf-8").split())


def figure(mean: float, spread: float | None, *, digits: int = 2) -> str:
    return f"{mean:.{digits}f}" if spread is None else f"{mean:.{digits}f} ± {spread:.{digits}f}"


def listed(figures: list[str]) -> str:
    return f"{', '.join(figures[:-1])} and {figures[-1]}"


def test_readme_has_the_accuracy_that_was_measured_last() -> None:
    measured = summary("accuracy")
    rows = list(rows_of("README.md", "| scan | 1 | 3 | 5 | 5, *Grow from seeds* |"))
    assert len(rows) == 9
    for scan, *figures, of_seeds in rows:
        of_case = measured["cases"][CASES[scan]]["clicks alone"]
        seeds = measured["methods"].get(CASES[scan], {}).get("Grow from seeds")
        assert figures == [figure(*of_case[n]["dice"]) for n in CLICKS], scan
        assert of_seeds == (figure(*seeds["5"]) if seeds else "–"), scan


@pytest.mark.parametrize("preset", PRESETS)
def test_results_have_the_accuracy_that_was_measured_last(preset: str) -> None:
    cases = summary(PRESETS[preset])["cases"]
    rows = list(rows_of("docs/RESULTS.md", "| volume | features | @1 | @3 | @5 | with one size step @1 | @3 |"))
    for scan, _, *figures in (row for row in rows if row[1] == preset):
        of_case = cases[CASES[scan]]
        measured = [of_case["clicks alone"][n] for n in CLICKS] + [of_case["with one size step"][n] for n in ("1", "3")]
        assert figures == [figure(*each["dice"]) for each in measured], scan


def test_results_have_each_structures_accuracy_that_was_measured_last() -> None:
    cases = [summary(name)["cases"] for name in PRESETS.values()]
    scan, count = "", 0
    for name, *figures in rows_of("docs/RESULTS.md", "| structure | *balanced* @1 | *fine* @1 | @3 | @3 | @5 | @5 |"):
        if name.startswith("**"):
            scan = CASES[name.strip("*")]
            continue
        measured = [of[scan]["clicks alone"][n]["structures"][name] for n in CLICKS for of in cases]
        assert figures == [figure(*each) for each in measured], name
        count += 1
    assert count > 20


def test_results_have_what_other_methods_were_measured_to_have_last() -> None:
    measured = summary("accuracy")
    rows = list(rows_of("docs/RESULTS.md", "| volume | method | @1 | @3 | @5 |"))
    assert len(rows) > 15
    for scan, method, *figures in rows:
        own = method == "*balanced*"
        of = measured["cases"][CASES[scan]]["clicks alone"] if own else measured["methods"][CASES[scan]][method]
        means_and_spreads = [of[n]["dice"] if own else of[n] for n in CLICKS]
        assert figures == [figure(mean, spread, digits=3) for mean, spread in means_and_spreads], (scan, method)


def test_method_has_what_eq_1_and_the_guided_filter_were_measured_to_have_last() -> None:
    measured = summary("accuracy")["methods"]

    def three(method: str) -> str:
        return ", ".join(figure(measured[scan][method]["5"][0], None, digits=3) for scan in TUNED_ON)

    raw, whitened = three("Eq. 1, raw features"), three("Eq. 1, whitened features")
    text = one_line("docs/METHOD.md")
    for told in (
        f"given our clicks: raw {raw}; whitened {whitened}.",
        f"Eq. 1 on whitened features, given the same clicks, has {whitened} (",
        f"given the solver's clicks, it has {three('default, guided filter')}, and the solver",
    ):
        assert told in text, told


def test_results_have_the_accuracy_on_other_scans() -> None:
    cases, scan, count = summary("accuracy")["cases"], "", 0
    for name, *figures in rows_of("docs/RESULTS.md", "| scan and structure | @1 | @3 | @5 | with one size step @1 | @3 |"):
        whole = name.startswith("**")
        scan = CASES[name.strip("*")] if whole else scan
        of_case = cases[scan]
        measured = [of_case["clicks alone"][n] for n in CLICKS] + [of_case["with one size step"][n] for n in ("1", "3")]
        assert figures == [figure(*(each["dice"] if whole else each["structures"][name])) for each in measured], name
        count += 1
    assert count > 15


def test_readme_has_the_accuracy_on_scans_not_looked_at_before() -> None:
    cases = summary("own_scans")["cases"]
    rows = list(rows_of("README.md", "| scans not looked at before | 1 | 3 | 5 | 5, with one size step |"))
    assert [OWN_SCANS[name] for name, *_ in rows] == list(cases)
    for name, *figures in rows:
        of_case = cases[OWN_SCANS[name]]
        measured = [of_case["clicks alone"][n] for n in CLICKS] + [of_case["with one size step"]["5"]]
        assert figures == [figure(*each["dice"]) for each in measured], name


def test_readme_and_results_have_the_mean_of_the_scans_not_looked_at_before() -> None:
    first, second, third, fourth, fifth = means(summary("own_scans")["cases"].values())
    readme, results = one_line("README.md"), one_line("docs/RESULTS.md")
    assert f"the mean is {first} after one click, {third} after three and {fifth} after five" in readme
    assert f"the mean Dice is {first}, {third} and {fifth} after one, three and five clicks" in results
    assert f"is {first}, {second}, {third}, {fourth} and {fifth} after one to five clicks" in results


@pytest.mark.parametrize(
    ("results", "scans", "of_scans"),
    [("other_kinds", "scan of another kind", OTHER_KINDS), ("lung_nodules", "scan of a lung", LUNGS)],
)
def test_results_have_the_accuracy_on_scans_that_others_labelled(results: str, scans: str, of_scans: dict[str, str]) -> None:
    cases = summary(f"{results}/own_scans")["cases"]
    rows = list(rows_of("docs/RESULTS.md", f"| {scans} | @1 | @3 | @5 | @5 with one size step |"))
    assert {of_scans[name] for name, *_ in rows} == cases.keys()
    for name, *figures in rows:
        of_case = cases[of_scans[name]]
        measured = [of_case["clicks alone"][n] for n in CLICKS] + [of_case["with one size step"]["5"]]
        assert figures == [figure(*each["dice"]) for each in measured], name


def test_readme_and_results_have_the_means_of_the_scans_of_other_kinds() -> None:
    cases = summary("other_kinds/own_scans")["cases"]
    readme, results = one_line("README.md"), one_line("docs/RESULTS.md")
    scans, others = ([cases[name] for name in cases if (name in NO_CT_NOR_MR) == other] for other in (False, True))
    assert f"eleven CTs and MRs is {listed(means(scans, '12345'))} after one to five clicks" in results
    assert f"the four others is {listed(means(others, '12345'))}." in results
    assert f"it is {listed(means(scans, '135'))}, on PET, SPECT and ultrasound {listed(means(others, '135'))}." in results
    assert f"to a spinal cord, {listed(means(scans, '135'))}." in readme
    *functional, ultrasound = (cases[name] for name in NO_CT_NOR_MR)
    assert f"in two PETs and a SPECT the mean was {means(functional, '5')[0]} after five clicks" in readme
    assert f"the one that was tried, with {means([ultrasound], '5')[0]}." in readme


def test_readme_and_results_have_the_means_of_the_scans_of_lungs() -> None:
    first, second, third, fourth, fifth = means(summary("lung_nodules/own_scans")["cases"].values())
    readme, results = one_line("README.md"), one_line("docs/RESULTS.md")
    assert f"the mean is {first}, {third} and {fifth}." in readme
    assert f"the mean Dice of the seven is {first}, {second}, {third}, {fourth} and {fifth} after one to five clicks" in results


def test_readme_and_results_have_what_a_first_gesture_is_worth_in_lungs() -> None:
    of_ways = summary("lung_nodules/gestures")["mean"]
    (click, then), (diameter, after_it), (outline, after_that) = (
        [figure(of_ways[way][count], None) for count in "15"] for way in ("clicks", "diameter", "outline")
    )
    first, then_clicks = f"{click}, {diameter} and {outline}", f"{then}, {after_it} and {after_that}"
    assert f"the mean of the seven is {first} at once, and {then_clicks} after four clicks more" in one_line("docs/RESULTS.md")
    assert f"have {diameter} at once and {after_it} after four clicks more;" in one_line("README.md")
    assert f"begun with a click, which may flood the lung, {click} and {then}." in one_line("README.md")


def test_results_have_what_a_first_gesture_is_worth() -> None:
    measured = summary("gestures")
    columns = [(way, count) for count in CLICKS for way in ("clicks", "diameter", "outline")]
    header = "| volume | " + " | ".join(f"{way} @{count}" for way, count in columns) + " |"
    *rows, of_all = list(rows_of("docs/RESULTS.md", header))
    assert len(rows) == len(measured["cases"])
    for (name, *figures), of_case in zip(rows, measured["cases"].values(), strict=True):
        assert figures == [figure(*of_case[way][count]) for way, count in columns], name
    assert of_all[1:] == [figure(measured["mean"][way][count], None) for way, count in columns]


def test_readme_has_what_a_first_gesture_is_worth() -> None:
    measured, rows = summary("gestures"), list(rows_of("README.md", "| structure | begun with | 1 | 2 | 3 | 5 |"))
    assert {name for name, *_ in rows} == GESTURES.keys()
    assert {begun_with for _, begun_with, *_ in rows} == BEGUN_WITH.keys()
    for name, begun_with, *figures in rows:
        way, of_case = BEGUN_WITH[begun_with], measured["cases"][GESTURES[name]] if GESTURES[name] else None
        means = [of_case[way][n][0] if of_case else measured["mean"][way][n] for n in ("1", "2", "3", "5")]
        assert figures == [figure(mean, None) for mean in means], name


def test_method_has_what_a_first_gesture_is_worth() -> None:
    of_ways = summary("gestures")["mean"]
    clicks, diameter, outline = (
        listed([figure(of_ways[way][count], None) for count in ("1", "2", "3", "5")])
        for way in ("clicks", "diameter", "outline")
    )
    assert (
        f"outlines lead to a mean Dice of {outline} after one, two, three and five gestures, diameters to {diameter}, "
        f"and clicks alone to {clicks} ("
    ) in one_line("docs/METHOD.md")


def test_results_and_readme_have_what_points_placed_at_once_are_worth() -> None:
    at_once, clicks = summary("points_at_once"), summary("gestures")
    assert at_once["cases"].keys() == clicks["cases"].keys()
    of_rows = [at_once["mean"]["points alone"], at_once["mean"]["with one size step"], clicks["mean"]["clicks"]]
    scans = len(at_once["cases"])
    rows = list(rows_of("docs/RESULTS.md", f"| mean of the {scans} | 1 | 3 | 5 |"))
    assert [cells for _, *cells in rows] == [[figure(of_row[n], None) for n in ("1", "3", "5")] for of_row in of_rows]
    corrected, five_at_once = figure(of_rows[2]["3"], None), figure(of_rows[0]["5"], None)
    assert (
        f"On {scans} scans, three such clicks reach a mean Dice of {corrected}, and five points that were placed without "
        f"looking in between {five_at_once} ("
    ) in one_line("README.md")


def test_results_say_on_how_many_scans_an_outline_is_ahead() -> None:
    firsts = [{way: of_case[way]["1"] for way in BEGUN_WITH.values()} for of_case in summary("gestures")["cases"].values()]
    clicks, diameters = (sum(first["outline"][0] > first[way][0] for first in firsts) for way in ("clicks", "diameter"))
    closer = sum(first["outline"][1] < first["clicks"][1] for first in firsts)
    text = one_line("docs/RESULTS.md")
    assert f"An outline is ahead of a click @1 on {clicks} of the {len(firsts)}," in text
    assert f"It is ahead of a diameter @1 on {diameters}," in text
    assert f"The spread between paths @1 is smaller than with clicks on {closer}," in text


def test_method_has_what_refinement_was_measured_to_be_worth_last() -> None:
    measured = summary("refinement")

    def of_scans(candidate: str) -> str:
        return ", ".join(figure(measured[candidate][scan]["dice"], None, digits=3) for scan in TUNED_ON)

    rows = list(rows_of("docs/METHOD.md", "| refinement | surfaces settled | before surfaces settle |"))
    assert {name for name, *_ in rows} == REFINEMENTS.keys()
    for name, *cells in rows:
        assert cells == [of_scans(candidate) if candidate else "" for candidate in REFINEMENTS[name]], name
    without, with_it = of_scans("bilateral, no likelihood"), of_scans("bilateral (default)")
    assert f"surfaces settled: {without} without, and {with_it} with it." in one_line("docs/METHOD.md")


def test_results_have_what_one_more_click_was_measured_to_spoil_last() -> None:
    told = {
        name: cells for name, *cells in rows_of("docs/RESULTS.md", "| clicks | number | lose more than 0.02 | worst loss |")
    }
    for name, (results, cases) in SPOILED.items():
        of_cases = summary(results)["click_changes"]["in_rounds"]
        changes = [of_cases[case] for case in cases or of_cases if of_cases[case]]
        count, worst = sum(of["count"] for of in changes), min(of["worst"]["change"] for of in changes)
        losing = 100.0 * sum(of["count"] * (1.0 - of["unhurt"]) for of in changes) / count
        number, percent, loss = told[name]
        share = percent.removesuffix(" %")
        assert number == str(count), name
        assert abs(float(share) - losing) <= 0.501 * 10.0 ** -len(share.partition(".")[2]), name
        assert loss.startswith(f"{-worst:.2f},"), name


def three(of_clicks: dict[str, Any]) -> str:
    """The means after so many clicks, as a cell of RESULTS has them."""
    means = (value[0] if isinstance(value, list) else value for value in of_clicks.values())
    return ", ".join(figure(mean, None) for mean in means)


def test_results_have_what_a_closer_look_is_worth() -> None:
    measured = summary("close_up")
    rows = list(rows_of("docs/RESULTS.md", "| structures | paths of clicks | whole scan | with close-ups | lost |"))
    assert len(rows) == 2 * len(measured)
    for (name, *cells), (scan, which) in zip(rows, product(measured, ("looked at closely", "all")), strict=True):
        assert name.startswith(CLOSE_UPS[scan])
        of_scan, of_these = measured[scan], measured[scan][which]
        ways = [three(of_these[way]) for way in ("whole", "with close-ups")]
        assert cells == [str(of_scan["paths"]), *ways, f"{of_these['lost']:.0%}"], name


def test_results_have_what_a_closer_look_that_begins_by_itself_is_worth() -> None:
    measured, kind = summary("small_structures")["much"], "begins"
    rows = list(rows_of("docs/RESULTS.md", "| | outlines | whole scan | looked at closely | lost |"))
    assert len(rows) == sum(len(of_kind) for of_kind in measured.values()) - 1, "the mean of those that stay is left out"
    for name, *cells in rows:
        kind = "stays" if name.startswith("**stays") else kind
        (of_scan,) = [
            of for scan, of in measured[kind].items() if name.rpartition("**: ")[2].startswith(SMALL_STRUCTURES[scan])
        ]
        ways = [three(of_scan[way]) for way in ("whole scan", "looked at closely")]
        found = [cell.strip("*") for cell in cells]
        assert found == [str(of_scan["outlines"]), *ways, f"{of_scan['lost']:.0%}"], (kind, name)


def test_readme_has_what_a_closer_look_that_begins_by_itself_is_worth() -> None:
    measured = json.loads((ROOT / "Benchmarks/results/small_structures.json").read_text(encoding="utf-8"))
    of_all, limit = measured["summary"]["much"]["begins"]["all"], LEAST_AGREEMENT
    begins = [run for run in measured["runs"] if run["slice"] == "much" and run["agreement"] < limit]
    structures = {(run["case"], run["structure"]) for run in begins}
    before, after = (of_all[way] for way in ("whole scan", "looked at closely"))
    assert len(begins) == of_all["outlines"]
    text = one_line("README.md")
    assert (
        f"For {len(begins)} such outlines of {len(structures)} structures the mean Dice is {after['1']:.2f} instead of "
        f"{before['1']:.2f}, and after two clicks more {after['3']:.2f} instead of {before['3']:.2f}"
    ) in text


def test_readme_has_what_single_structures_gain_by_a_closer_look() -> None:
    runs = json.loads((ROOT / "Benchmarks/results/small_structures.json").read_text(encoding="utf-8"))["runs"]

    def after_the_outline(structure: str, way: str) -> str:
        of_way = [
            run[way]["1"]
            for run in runs
            if (run["slice"], run["structure"]) == ("much", structure) and run["agreement"] < LEAST_AGREEMENT
        ]
        return figure(sum(of_way) / len(of_way), None)

    (gallbladder, before), (gland, flooded) = (
        (after_the_outline(structure, "looked at closely"), after_the_outline(structure, "whole scan"))
        for structure in ("gallbladder", "left adrenal gland")
    )
    of_all = summary("close_up")["amos_0336 all"]["all"]
    closely, whole = (figure(of_all[way]["5"][0], None) for way in ("with close-ups", "whole"))
    text = one_line("README.md")
    assert (
        f"a gallbladder has {gallbladder} instead of {before} at once, a left adrenal gland {gland} instead of {flooded}"
        in text
    )
    assert f"the mean Dice after five clicks each is {closely} instead of {whole}" in text


@pytest.mark.parametrize(
    ("document", "sentence", "begins"),
    [
        ("docs/METHOD.md", r"a box would make it worse at first \((.*?)\)", False),
        ("docs/RESULTS.md", r"some are worse at first \((.*?)\)", True),
    ],
)
def test_what_a_closer_look_makes_worse_at_first_was_measured_so(document: str, sentence: str, begins: bool) -> None:
    runs = json.loads((ROOT / "Benchmarks/results/small_structures.json").read_text(encoding="utf-8"))["runs"]
    measured = {
        f"{run['whole scan']['1']:.2f} → {run['looked at closely']['1']:.2f}"
        for run in runs
        if (run["agreement"] < LEAST_AGREEMENT) == begins
    }
    (told,) = re.findall(sentence, one_line(document))
    changes = set(re.findall(r"0\.\d\d → 0\.\d\d", told))
    assert len(changes) == 2
    assert changes <= measured


def test_results_have_the_app_and_cohorts_that_were_measured_last() -> None:
    app, cohort, text = summary("web_app"), summary("cohort"), one_line("docs/RESULTS.md")
    assert f"medians are {app['overlay_ms']:.0f} ms (slowest {app['overlay_worst_ms']:.0f};" in text
    one, two = (cohort[f"cases_per_hour_{workers}"] for workers in (1, 2))
    assert f"{one:.0f} cases an hour by one worker with two threads, and {two:.0f} by two workers" in text


def test_what_the_module_takes_beside_slicer_is_what_was_measured_last() -> None:
    rows = json.loads((ROOT / "Benchmarks/results/memory.json").read_text(encoding="utf-8"))["rows"]
    usual, large = (f"{row['panel_peak_gb']:.1f} GB" for row in rows if row["size"] in ("512×512×300", "512×512×1200"))
    for path, told in (
        ("README.md", f"{usual} for a scan of 512×512×300 voxels, {large} for 512×512×1200"),
        ("ViTTransferFunction/ViTTransferFunction.py", f"{usual} for 512×512×300 voxels, {large} for 512×512×1200"),
        ("CHANGELOG.md", f"512×512×1200 voxels take {large} beside Slicer"),
    ):
        assert told in (ROOT / path).read_text(encoding="utf-8"), path


def test_results_and_method_have_the_times_of_the_solver_that_were_measured_last() -> None:
    rows = json.loads((ROOT / "Benchmarks/results/solver.json").read_text(encoding="utf-8"))["speed"]
    (of_256,) = (row for row in rows if row["size"] == 256)
    nearest, ours = (f"{of_256[name]:.2f} s" for name in ("nearest_s", "multilinear_s"))
    published = f"{of_256['published_s']:.1f} s"
    for document, told in (
        ("docs/RESULTS.md", f"| 256³ | {nearest} | {ours} | {published} |"),
        ("docs/METHOD.md", f"At 256³ the solver takes {ours}, and the published algorithm {published} ("),
    ):
        assert told in one_line(document), document
