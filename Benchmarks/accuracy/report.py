"""What was measured: as JSON with every figure, and as tables and a plot for people."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from Benchmarks.accuracy import published_figures as published
from Benchmarks.accuracy.methods import DEFAULT, OURS
from Benchmarks.accuracy.plot import plot_iou
from Benchmarks.shared.machine import in_words
from Benchmarks.shared.report_files import write_results
from Benchmarks.shared.report_tables import number, paragraphs, table

REPORTED_CLICKS = ("1", "3", "5", "10")
TYPICAL_CLICKS = "5"
"""At which tables stand that show one number of clicks: about the paper's 5.2."""
METRICS = ("precision", "recall", "dice", "iou", "surface_dice")

_CAPTION = """Mean Dice over the structures. All methods are on the same clicks, which correct the default method's errors; in
the last two columns, on clicks that correct their own. The baselines know more than ours. All: what is there at a negative
click. Classifiers: 100 voxels of the true background. Grow from seeds: 4 mm around a click, as far as it belongs to the same,
and 100 voxels from anywhere, as ours; or of the true background."""

Run = dict[str, Any]


def write_report(report: dict[str, Any], folder: Path) -> None:
    """Write accuracy.json, accuracy.md and accuracy_iou.png."""
    report = {**report, "summary": summary(report["runs"])}
    write_results(folder, "accuracy", report, text(report))
    plot_iou(main_runs(report["runs"], "together"), folder / "accuracy_iou.png")


def summary(runs: Sequence[Run]) -> dict[str, Any]:
    """Mean Dice over the structures, by case, method and number of annotations of a structure."""
    return {
        "mean_dice": _means(main_runs(runs, "together")),
        "mean_dice_one_by_one": _means(main_runs(runs, "one by one")),
        "mean_dice_own_clicks": _means(run for run in runs if run["mode"] == "together" and run["clicks"] == "own"),
    }


def main_runs(runs: Sequence[Run], mode: str) -> list[Run]:
    """Those to compare by: of the default, of the others on its clicks, and of those trained on true samples."""
    return [run for run in runs if run["mode"] == mode and (run["clicks"] != "own" or run["method"] == DEFAULT.name)]


def text(report: dict[str, Any]) -> str:
    """The report for people."""
    runs = report["runs"]
    together = main_runs(runs, "together")
    return paragraphs(
        "# Accuracy by clicks",
        f"Features of {report['model']}, default preset. {in_words(report['machine'])}. "
        "Command: `python dev.py bench accuracy`. Every figure by structure and click is in `accuracy.json`.",
        _CAPTION,
        "![Intersection over union by annotations](accuracy_iou.png)",
        _main_table(report["summary"]),
        *(part for run in together if run["method"] == DEFAULT.name for part in _by_structure(run, together)),
        f"## Metrics by number of annotations\n\nMeans over the structures of {_volumes(runs)}, annotated together.",
        _by_annotations(together),
        f"## Seconds for an update of all structures\n\nAt {TYPICAL_CLICKS} clicks, features at hand; those trained "
        "on true samples by how many of each structure.",
        _seconds(together),
        f"## As published ({published.DATA_SET})",
        _published(),
    )


def mean(structures: dict[str, dict[str, float]], metric: str) -> float:
    """Mean of a metric over the structures."""
    return float(np.mean([metrics[metric] for metrics in structures.values()]))


def _means(runs: Iterable[Run]) -> dict[str, Any]:
    means: dict[str, Any] = {}
    for run in runs:
        by_clicks = {clicks: round(mean(structures, "dice"), 4) for clicks, structures in run["rounds"].items()}
        means.setdefault(run["case"], {})[run["method"]] = by_clicks
    return means


def _main_table(means: dict[str, Any]) -> str:
    rows = []
    for case, methods in means["mean_dice"].items():
        for method, by_clicks in methods.items():
            if "true samples" in method:
                continue
            alone = means["mean_dice_one_by_one"].get(case, {}).get(method, {})
            own = means["mean_dice_own_clicks"].get(case, {}).get(method, {})
            figures = [by_clicks.get(clicks) for clicks in REPORTED_CLICKS]
            figures += [alone.get(TYPICAL_CLICKS), own.get(TYPICAL_CLICKS), own.get(REPORTED_CLICKS[-1])]
            rows.append([case, method, *(number(figure) for figure in figures)])
    header = ["volume", "method", *REPORTED_CLICKS, f"one by one, {TYPICAL_CLICKS}"]
    return table([*header, f"own clicks, {TYPICAL_CLICKS}", f"own clicks, {REPORTED_CLICKS[-1]}"], rows)


def _by_structure(run: Run, together: Sequence[Run]) -> Iterator[str]:
    yield f"## {run['case']}, {run['method']}"
    others = [other for other in together if other["case"] == run["case"] and TYPICAL_CLICKS in other["rounds"]]
    ours = {method.name for method in OURS}
    baselines = [other for other in others if other["method"] not in ours]
    header = ["structure", *(f"Dice @{clicks}" for clicks in REPORTED_CLICKS)]
    header += [f"{metric.replace('_', ' ')} @{TYPICAL_CLICKS}" for metric in METRICS if metric != "dice"]
    header.append(f"best baseline, Dice @{TYPICAL_CLICKS}")
    rows = []
    for name in next(iter(run["rounds"].values())):
        at = {clicks: structures[name] for clicks, structures in run["rounds"].items()}
        typical = at.get(TYPICAL_CLICKS, {})
        dice = [number(at[clicks]["dice"] if clicks in at else None) for clicks in REPORTED_CLICKS]
        figures = [number(typical.get(metric)) for metric in METRICS if metric != "dice"]
        rows.append([name, *dice, *figures, _best(baselines, name)])
    yield table(header, rows)


def _best(baselines: Sequence[Run], structure: str) -> str:
    if not baselines:
        return "–"
    dice, method = max((run["rounds"][TYPICAL_CLICKS][structure]["dice"], run["method"]) for run in baselines)
    return f"{dice:.3f} ({method})"


def _by_annotations(together: Sequence[Run]) -> str:
    found: dict[tuple[int, str], list[dict[str, dict[str, float]]]] = {}
    for run in together:
        for clicks, structures in run["rounds"].items():
            if clicks == TYPICAL_CLICKS or run["clicks"] == "true samples":
                found.setdefault((int(clicks), run["method"].removesuffix(", true samples")), []).append(structures)
    rows = [
        [str(annotations), method, *(number(float(np.mean([mean(s, metric) for s in by_case]))) for metric in METRICS)]
        for (annotations, method), by_case in sorted(found.items(), key=lambda item: item[0][0])
    ]
    return table(["annotations a structure", "method", *(metric.replace("_", " ") for metric in METRICS)], rows)


def _seconds(together: Sequence[Run]) -> str:
    cases = list(dict.fromkeys(run["case"] for run in together))
    found: dict[str, dict[str, float]] = {}
    for run in together:
        for clicks, structures in run["rounds"].items():
            if clicks == TYPICAL_CLICKS or run["clicks"] == "true samples":
                name = run["method"] if clicks == TYPICAL_CLICKS else f"{run['method']}, {clicks}"
                found.setdefault(name, {})[run["case"]] = mean(structures, "seconds")
    rows = [[name, *(number(by_case.get(case), 2) for case in cases)] for name, by_case in found.items()]
    return table(["method", *cases], rows)


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


def _volumes(runs: Sequence[Run]) -> str:
    return ", ".join(dict.fromkeys(run["case"] for run in runs))
