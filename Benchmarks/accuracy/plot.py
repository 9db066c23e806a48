"""Intersection over union by number of annotations, as the paper's figure shows it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from Benchmarks.accuracy import published_figures as published
from Benchmarks.accuracy.comparison import methods_on
from Benchmarks.accuracy.figures import Figures, figures_of, names_of
from Benchmarks.shared.report_files import save_figure

LINE_STYLES: dict[str, dict[str, Any]] = {
    "default": {"color": "#c1272d", "linewidth": 2.4},
    "default, guided filter": {"color": "#c1272d", "linestyle": "--"},
    "default, not refined": {"color": "#c1272d", "linestyle": ":"},
    "Eq. 1, whitened features": {"color": "#8e44ad", "linestyle": "--"},
    "Eq. 1, raw features": {"color": "#8e44ad"},
    "Grow from seeds": {"color": "#2e7d32"},
    "Grow from seeds, true background": {"color": "#2e7d32", "linestyle": "--"},
    "SVM on the network's features": {"color": "#1565c0", "linestyle": "--"},
    "RF on the network's features": {"color": "#ef6c00", "linestyle": "--"},
    "SVM on 11 local features": {"color": "#1565c0"},
    "RF on 11 local features": {"color": "#ef6c00"},
    "threshold": {"color": "#757575"},
}
PUBLISHED_STYLES: dict[str, dict[str, Any]] = {
    "Ours": {"color": "#8e44ad"},
    "SAM-Med3D (t)": {"color": "#00838f"},
    "SAM-Med3D (o)": {"color": "#4dd0e1"},
    "RF": {"color": "#ef6c00"},
    "SVM": {"color": "#1565c0"},
}
TICKS = (1, 3, 5, 10, 1024, 8192)


def plot_iou(runs: Sequence[dict[str, Any]], path: Path) -> None:
    """One panel for each volume that several methods were given, and one for the published figures.

    Args:
        runs: all that was measured.
        path: of the PNG file to write.
    """
    import matplotlib.pyplot as plt

    cases = [case for case in names_of(runs, "case") if len(methods_on(runs, case)) > 1]
    columns = min(len(cases) + 1, 3)
    rows = -(-(len(cases) + 1) // columns)
    figure, grid = plt.subplots(
        rows, columns, figsize=(4.6 * columns, 3.8 * rows), sharey=True, squeeze=False, layout="constrained"
    )
    panels = list(grid.flat)
    for axes, case in zip(panels, cases, strict=False):
        for method, figures in methods_on(runs, case).items():
            _draw_method(axes, method, figures)
        for method in names_of(runs, "method"):
            # Trained on true samples, the same methods go on farther right.
            _draw_method(axes, method, figures_of(runs, case, method, "true samples"))
        _finish(axes, case)
    _draw_published(panels[len(cases)])
    for axes in panels[len(cases) + 1 :]:
        axes.axis("off")
    handles, labels = panels[0].get_legend_handles_labels() if cases else ([], [])
    figure.legend(handles, labels, loc="outside lower center", ncols=columns + 1, fontsize=8.5, frameon=False)
    save_figure(figure, path)


def _draw_method(axes: Any, method: str, figures: Figures) -> None:
    name = method.removesuffix(", true samples")
    iou = [found.mean for found in (figures.mean(clicks, "iou") for clicks in figures.clicks) if found]
    annotations = [int(clicks) for clicks in figures.clicks]
    label = name if name == method and iou else None
    axes.plot(annotations, iou, marker="o", markersize=3.5, label=label, **LINE_STYLES.get(name, {}))


def _draw_published(axes: Any) -> None:
    for name, style in PUBLISHED_STYLES.items():
        points = [(annotations, metrics["iou"]) for annotations, method, metrics in published.BY_ANNOTATIONS if method == name]
        axes.plot(*zip(*points, strict=True), marker="s", markersize=4.5, label=name, **style)
    axes.legend(fontsize=8, frameon=False, loc="center", bbox_to_anchor=(0.62, 0.72))
    _finish(axes, f"as published ({published.DATA_SET})")


def _finish(axes: Any, title: str) -> None:
    axes.set(xscale="log", xlim=(0.8, 12000), ylim=(0.0, 1.03), xlabel="annotations a structure", title=title)
    axes.set_xticks(TICKS, [str(tick) for tick in TICKS])
    axes.minorticks_off()
    axes.grid(color="0.9")
    axes.set_ylabel("mean intersection over union")
