"""What was measured: as JSON with every figure, and as tables and pictures for people."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from Benchmarks.accuracy import published_figures as published
from Benchmarks.accuracy.cases import GROUPS
from Benchmarks.accuracy.click_changes import ChangeSummary, in_rounds, of_the_clicked, of_the_others, summarised
from Benchmarks.accuracy.comparison import lead_of, methods_on
from Benchmarks.accuracy.earlier import Cases, before_and_now
from Benchmarks.accuracy.failures import Failure, plot_failures
from Benchmarks.accuracy.figures import COLUMNS, Figures, column_of, figures_of, names_of
from Benchmarks.accuracy.goals import goals_reached
from Benchmarks.accuracy.methods import DEFAULT
from Benchmarks.accuracy.plot import plot_iou
from Benchmarks.accuracy.summary import single_runs, summary
from Benchmarks.shared.arguments import DEFAULT_MODEL
from Benchmarks.shared.machine import in_words
from Benchmarks.shared.report_files import write_results
from Benchmarks.shared.report_tables import number, paragraphs, table
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET

REPORTED_CLICKS = ("1", "3", "5", "10")
TYPICAL_CLICKS = "5"
"""At which tables stand that show one number of clicks: about the paper's 5.2."""
METRICS = ("precision", "recall", "dice", "iou", "surface_dice")
DETAILS = ("precision", "recall", "surface_dice")
"""Of each structure, beside its Dice."""
ALONE, STEPPED = COLUMNS

CAPTION = """Mean Dice over the structures, mean ± standard deviation between the paths of clicks where there are several: the
first click anywhere in the inner half of a structure, later ones on the largest error, about (σ 3 mm) where it is deepest.
*With one size step*: after the same clicks, each structure may be made smaller or larger once, where that is better."""
_COMPARISON = """All methods are on the same clicks, which correct the default's errors; in the last column on clicks that
correct their own, on one path. The baselines know more than ours. All: what is there at a negative click. Classifiers: 100
voxels of the true background. Grow from seeds: 4 mm around a click, as far as it belongs to the same, and 100 voxels from
anywhere, as ours; or of the true background. Slow methods were given the first path only."""
CLICK_CAPTION = """What one more click changes, of the Dice of a structure. In a round, every structure gets a click. Clicked
alone: one structure after the other on one path, the others as they are; of these, the one that loses most counts."""

Run = dict[str, Any]


def write_report(report: dict[str, Any], failures: Sequence[Failure], folder: Path, earlier: Cases) -> None:
    """Write accuracy.json, accuracy.md, accuracy_iou.png and accuracy_failures.webp, with an earlier run's cases beside.

    Of another model or preset than the default there are no pictures, and its name is in the files', as in accuracy_fine.json.
    """
    runs, name = report["runs"], _name(report)
    # Short: with all metrics and clicks, it would be too large to be kept with every version of the code.
    figures = {**report, "summary": summary(runs), "runs": single_runs(runs)}
    write_results(folder, name, figures, text(report, earlier))
    if _has_pictures(report):
        plot_iou(runs, folder / f"{name}_iou.png")
        plot_failures(failures, folder / f"{name}_failures.webp")


def text(report: dict[str, Any], earlier: Cases) -> str:
    """The report for people."""
    runs, name = report["runs"], _name(report)
    compared = [case for case in names_of(runs, "case") if len(methods_on(runs, case)) > 1]
    return paragraphs(
        "# Accuracy by clicks",
        f"Features of {report['model']} (weights of SHA-256 {report['weights_sha256'][:8]}…), preset *{report['preset']}*, "
        f"{report['paths']} paths of clicks. "
        f"{in_words(report['machine'])}. "
        f"Command: `{_command(report)}`. Dice by structure, path and click is in `{name}.json`.",
        CAPTION,
        *(part for group in GROUPS for part in case_table(group.title, [case.name for case in group.cases], runs)),
        *(("## Before and now", before_and_now(earlier, summary(runs)["cases"])) if earlier else ()),
        "## Goals",
        _goals(runs),
        "## A click never hurts",
        CLICK_CAPTION,
        click_change_table(runs),
        *([f"![Worst structures of each volume]({name}_failures.webp)"] if _has_pictures(report) else []),
        *(part for case in names_of(runs, "case") for part in structure_table(runs, case)),
        *(_beside_other_methods(runs, compared, f"{name}_iou.png" if _has_pictures(report) else None) if compared else ()),
        f"## As published ({published.DATA_SET})",
        _published(),
    )


def _name(report: dict[str, Any]) -> str:
    """Of the files with the results."""
    return "_".join(["accuracy", *_not_default(report).values()])


def _has_pictures(report: dict[str, Any]) -> bool:
    """Every version of a picture stays in the repository for ever: the default's failures are looked at."""
    return not _not_default(report)


def _command(report: dict[str, Any]) -> str:
    options = [f"--{option} {name}" for option, name in _not_default(report).items()]
    return " ".join(["python dev.py bench accuracy --volumes DIR", *options])


def _not_default(report: dict[str, Any]) -> dict[str, str]:
    """What was measured other than by default, by the option that asks for it."""
    default = {"model": DEFAULT_MODEL, "preset": DEFAULT_PRESET}
    return {option: report[option] for option, usual in default.items() if report[option] != usual}


def case_table(title: str, cases: Sequence[str], runs: Sequence[Run]) -> Iterator[str]:
    """The main table of some cases."""
    measured = [case for case in names_of(runs, "case") if case in cases]
    if not measured:
        return
    clicks = _reported(column_of(runs, measured[0], ALONE))
    columns = [name for name in COLUMNS if column_of(runs, measured[0], name).paths]
    rows = []
    for case in measured:
        alone, figures = column_of(runs, case, ALONE), [column_of(runs, case, name) for name in columns]
        means = [column.mean(n) for column in figures for n in clicks]
        means += [column.mean(TYPICAL_CLICKS, "surface_dice") for column in figures]
        rows.append([case, len(alone.structures), len(alone.paths), *map(_figure, means)])
    header = ["volume", "structures", "paths", *_headers("", columns, clicks)]
    yield f"## {title}"
    yield table([*header, *_headers("surface Dice", columns, [TYPICAL_CLICKS])], rows)


def _headers(what: str, columns: Sequence[str], clicks: Sequence[str]) -> list[str]:
    """Clicks alone need not be said."""
    return [" ".join(filter(None, (what, "" if name == ALONE else name, f"@{n}"))) for name in columns for n in clicks]


def _goals(runs: Sequence[Run]) -> str:
    rows = [
        [goal.goal, number(goal.figure), number(goal.stepped), "yes" if goal.is_reached else "no", goal.note]
        for goal in goals_reached(runs)
    ]
    return table(["goal", "figure", STEPPED, "reached", ""], rows)


def click_change_table(runs: Sequence[Run]) -> str:
    """How much clicks gain and lose."""
    cases = names_of(runs, "case")
    of_cases = [(case, summarised(in_rounds(run for run in runs if run["case"] == case))) for case in cases]
    rows = [
        *(_change_row(f"{case}, in rounds", found) for case, found in of_cases),
        _change_row("all, in rounds", summarised(in_rounds(runs))),
        _change_row("the clicked, clicked alone", summarised(of_the_clicked(runs))),
        _change_row("the others, one clicked alone", summarised(of_the_others(runs))),
    ]
    return table(["structures", "clicks", "lose at most .02", "worst change", "there"], [row for row in rows if row])


def _change_row(what: str, found: ChangeSummary | None) -> list[str]:
    if found is None:
        return []
    return [what, str(found.count), f"{found.unhurt:.1%}", f"{found.worst.change:+.3f}", found.worst.where]


def _beside_other_methods(runs: Sequence[Run], cases: Sequence[str], picture: str | None) -> Iterator[str]:
    yield f"## Beside other methods\n\n{_COMPARISON}"
    if picture is not None:
        yield f"![Intersection over union by annotations]({picture})"
    yield _comparison(runs, cases)
    yield f"## Metrics by number of annotations\n\nMeans over the structures and paths of {', '.join(cases)}."
    yield _by_annotations(runs, cases)
    yield (
        f"## Seconds for an update of all structures\n\nAt {TYPICAL_CLICKS} clicks, features at hand; those trained on true "
        "samples by how many of each structure."
    )
    yield _seconds(runs, cases)


def _comparison(runs: Sequence[Run], cases: Sequence[str]) -> str:
    rows = []
    clicks: list[str] = []
    for case in cases:
        methods = methods_on(runs, case)
        default = methods[DEFAULT.name]
        clicks = _reported(default)
        first = default.on(default.paths[:1])
        listed = {**methods}
        if len(default.paths) > 1 and any(len(figures.paths) == 1 for figures in methods.values()):
            listed = {DEFAULT.name: default, f"{DEFAULT.name}, on the first path": first, **methods}
        for name, figures in listed.items():
            own = figures_of(runs, case, name) if name != DEFAULT.name else first
            means = [figures.mean(n) for n in clicks] + [own.mean(TYPICAL_CLICKS)]
            rows.append([case, name, len(figures.paths), *map(_figure, means)])
        alone = figures_of(runs, case, kind="one by one")
        if alone.paths:
            means = [alone.mean(n) for n in clicks] + [None]
            rows.append([case, f"{DEFAULT.name}, structures one by one", len(alone.paths), *map(_figure, means)])
    return table(["volume", "method", "paths", *(f"@{n}" for n in clicks), f"own clicks, @{TYPICAL_CLICKS}"], rows)


def structure_table(runs: Sequence[Run], case: str) -> Iterator[str]:
    """The table of the structures of a case."""
    columns = [name for name in COLUMNS if column_of(runs, case, name).paths]
    alone, figures = column_of(runs, case, ALONE), [column_of(runs, case, name) for name in columns]
    clicks, compared = _reported(alone), len(methods_on(runs, case)) > 1
    header = ["structure", *_headers("", columns, clicks)]
    header += [f"{metric.replace('_', ' ')} @{TYPICAL_CLICKS}" for metric in DETAILS]
    header += [f"best baseline @{TYPICAL_CLICKS}"] * compared
    rows = []
    for name in alone.structures:
        of_structure = [column.structure(name, n) for column in figures for n in clicks]
        of_structure += [alone.structure(name, TYPICAL_CLICKS, metric) for metric in DETAILS]
        rows.append([name, *map(_figure, of_structure)] + [_best(runs, case, name)] * compared)
    yield f"## {case}"
    yield table(header, rows)


def _best(runs: Sequence[Run], case: str, structure: str) -> str:
    lead = lead_of(runs, case, structure, TYPICAL_CLICKS)
    return "–" if lead is None else f"{lead.dice:.3f} ({lead.baseline})"


def _by_annotations(runs: Sequence[Run], cases: Sequence[str]) -> str:
    rows = []
    for method, clicks, measured in _by_method(runs, cases):
        at = [[figures.mean(clicks, metric) for figures in measured] for metric in METRICS]
        means = [[found.mean for found in of_metric if found] for of_metric in at]
        rows.append([clicks, method, *(number(sum(values) / len(values)) for values in means)])
    return table(["annotations a structure", "method", *(metric.replace("_", " ") for metric in METRICS)], rows)


def _seconds(runs: Sequence[Run], cases: Sequence[str]) -> str:
    rows = []
    for method, clicks, measured in _by_method(runs, cases):
        seconds = [figures.mean(clicks, "seconds") for figures in measured]
        name = method if clicks == TYPICAL_CLICKS else f"{method}, {clicks}"
        rows.append([name, *(number(found.mean if found else None, 2) for found in seconds)])
    return table(["method", *cases], rows)


def _by_method(runs: Sequence[Run], cases: Sequence[str]) -> Iterator[tuple[str, str, list[Figures]]]:
    """Each method, at the typical number of clicks or at all its numbers of true samples, with its figures of the cases."""
    for method in names_of(runs, "method"):
        kind = "own" if method == DEFAULT.name else "true samples" if "true samples" in method else "same"
        measured = [figures_of(runs, case, method, kind) for case in cases]
        for clicks in dict.fromkeys(n for figures in measured for n in figures.clicks):
            if clicks == TYPICAL_CLICKS or kind == "true samples":
                yield method, clicks, measured


def _published() -> str:
    classes = list(published.IOU_BY_CLASS["Ours"])
    by_class = [[name, *(number(iou[c]) for c in classes)] for name, iou in published.IOU_BY_CLASS.items()]
    metrics = ("precision", "recall", "dice", "iou")
    by_annotations = [[f"{n:g}", name, *(number(m[key]) for key in metrics)] for n, name, m in published.BY_ANNOTATIONS]
    tables = [
        table(["IoU at 5.2 annotations a class", *classes], by_class),
        table(["annotations a class", "method", *metrics], by_annotations),
        table(["resolution", "method", "preprocessing, s", "inference of a class, s"], published.SECONDS),
    ]
    return "\n\n".join(tables)


def _reported(figures: Figures) -> list[str]:
    return [clicks for clicks in REPORTED_CLICKS if clicks in figures.clicks]


def _figure(found: Any) -> str:
    return "–" if found is None else str(found)
