"""Speed against error of the bilateral solver: `python dev.py bench solver [--quick] [--threads 2] [--volumes DIR]`.

Writes `solver.json`, `solver.md` and plots. All methods that are compared are run in turn, and the best
of their runs counts, because a machine is seldom idle.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import torch

from Benchmarks.shared.arguments import benchmark_parser
from Benchmarks.shared.machine import machine
from Benchmarks.shared.process_memory import forget_peak, peak_resident_bytes, require_linux, resident_bytes
from Benchmarks.shared.refinement_phantoms import Phantom, best_dice, body_phantom, coarse_map_of, sphere_phantom
from Benchmarks.solver.nearest_slice import nearest_slicing, slice_nearest
from Benchmarks.solver.published_bilateral_solver import solve_as_published
from Benchmarks.solver.report import write_report
from ViTTransferFunction.Logic.refinement import bilateral_energy
from ViTTransferFunction.Logic.refinement.bilateral_cells import Target, splat
from ViTTransferFunction.Logic.refinement.bilateral_energy import solve_cells
from ViTTransferFunction.Logic.refinement.bilateral_grid import GridLayout, VoxelCells
from ViTTransferFunction.Logic.refinement.bilateral_slice import slice_multilinear
from ViTTransferFunction.Logic.refinement.bilateral_solver import (
    BilateralSolution,
    BilateralSolverSettings,
    refine_map,
    solve_bilateral,
)
from ViTTransferFunction.Logic.refinement.guided_filter import GuidedFilterSettings, guided_filter
from ViTTransferFunction.Logic.refinement.upsampling import Upsampling, upsampled
from ViTTransferFunction.Logic.refinement.workers import Workers

UNIT_SPACING = (1.0, 1.0, 1.0)
WINDOW = (0.0, 1.0)
SETTINGS = BilateralSolverSettings(sigma_spatial_mm=5.0)
EDGES = (5, 5, 5)
THRESHOLD = 0.25
"""The paper's τ."""
SOFT_TISSUE = (-100.0, 300.0)
"""Intensity window in Hounsfield units."""


def main() -> None:
    """Run everything, and write what was measured."""
    parser = benchmark_parser(__doc__)
    parser.add_argument("--quick", action="store_true", help="small volumes and few runs: whether it works, not how well")
    parser.add_argument("--volumes", type=Path, help="folder with amos_0336_ct.nii.gz and its labels")
    parser.add_argument("--threads", type=int, default=1, help="of PyTorch (default 1)")
    parser.add_argument("--memory-of", nargs=2, metavar=("SIZE", "SLICING"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    require_linux()
    torch.set_num_threads(options.threads)
    if options.memory_of:
        print(extra_memory_bytes(int(options.memory_of[0]), options.memory_of[1]))
        return
    sizes = (32, 64) if options.quick else (128, 256, 512)
    middle = sizes[-2]
    body = body_phantom(middle)
    measured: dict[str, Any] = {
        "machine": machine("cpu"),
        "speed": [speed(size, runs=2 if size > 256 else 7, against_published=size <= 256) for size in sizes],
        "stages": stages(body),
        "iterations": error_by_iterations(body),
        "quality": quality(body_phantom(middle, noise=0.1)),
        "active": time_by_active_cells(middle),
        "memory": [{"size": s, "slicing": k, "bytes": memory_in_new_process(s, k)} for s in sizes[-2:] for k in REFINE],
        "real": real_edges(options.volumes) if options.volumes else [],
    }
    measured["summary"] = summary(measured, middle, sizes[-1])
    write_report(measured, options.results)


def summary(measured: dict[str, Any], middle: int, large: int) -> dict[str, float]:
    """The figures that are tracked; named for the full run, whose middle size is 256 and whose large one 512."""
    speed_of = {row["size"]: row for row in measured["speed"]}
    memory = {size: max(row["bytes"] for row in measured["memory"] if row["size"] == size) for size in (middle, large)}
    return {
        "speedup_256": speed_of[middle]["published_s"] / speed_of[middle]["nearest_s"],
        "rms_256": speed_of[middle]["rms"],
        "nearest_256_s": speed_of[middle]["nearest_s"],
        "linear_256_s": speed_of[middle]["multilinear_s"],
        "nearest_512_s": speed_of[large]["nearest_s"],
        "linear_512_s": speed_of[large]["multilinear_s"],
        "extra_memory_256_bytes": memory[middle],
        "extra_memory_512_bytes": memory[large],
        "floor_ratio_512": speed_of[large]["nearest_s"] / speed_of[large]["floor_s"],
    }


def speed(size: int, runs: int, against_published: bool) -> dict[str, Any]:
    """Seconds for a fully occupied volume, from the coarse map to the refined one."""
    phantom = body_phantom(size)
    target = upsampled(phantom.coarse_map, phantom.luma.shape)
    out = torch.empty_like(target)
    ways: dict[str, Callable[[], Any]] = {
        **{name: partial(way, phantom) for name, way in REFINE.items()},
        "nearest_from_full_map": nearest_slicing()(lambda: solve_bilateral(target, phantom.luma, None, UNIT_SPACING, SETTINGS)),
        "upsampling": lambda: upsampled(phantom.coarse_map, phantom.luma.shape),
        "guided_filter": lambda: guided_filter(target, phantom.luma, UNIT_SPACING, GuidedFilterSettings(radius_mm=5.0)),
        "floor": lambda: torch.add(phantom.luma, target, out=out),
    }
    row: dict[str, Any] = {"size": size}
    if against_published:
        row["published_s"], row["published_cpu_s"] = best_times({"published": lambda: published(phantom, 25)}, 1)["published"]
    for name, (seconds, cpu_seconds) in best_times(ways, runs).items():
        row[f"{name}_s"], row[f"{name}_cpu_s"] = seconds, cpu_seconds
    solution = ways["nearest"]()
    row |= {"cells": solution.cells, "iterations": solution.iterations, "residual": solution.residual}
    if against_published:
        # The published method once more, after the others, so that a busy spell does not count for one side only.
        again = best_times({"published": lambda: published(phantom, 25)}, 1)["published"]
        row["published_s"], row["published_cpu_s"] = min((row["published_s"], row["published_cpu_s"]), again)
        row["rms"] = rms(solution.map, converged(phantom, SETTINGS.smoothness))
    return row


def refine(phantom: Phantom, settings: BilateralSolverSettings = SETTINGS, threshold: float | None = None) -> BilateralSolution:
    """The product's answer."""
    return refine_map(phantom.coarse_map, phantom.luma, WINDOW, UNIT_SPACING, settings, threshold)


refine_nearest = nearest_slicing()(refine)
"""The same, but each voxel reads its own cell."""
REFINE = {"nearest": refine_nearest, "multilinear": refine}


def best_times(ways: dict[str, Callable[[], Any]], runs: int) -> dict[str, tuple[float, float]]:
    """Least wall-clock and processor seconds of each way, run in turn."""
    seconds: dict[str, list[tuple[float, float]]] = {name: [] for name in ways}
    for _ in range(runs):
        for name, run in ways.items():
            start, cpu_start = time.perf_counter(), time.process_time()
            run()
            seconds[name].append((time.perf_counter() - start, time.process_time() - cpu_start))
    return {name: (min(wall for wall, _ in times), min(cpu for _, cpu in times)) for name, times in seconds.items()}


def published(phantom: Phantom, iterations: int, smoothness: float = SETTINGS.smoothness, **others: Any) -> np.ndarray:
    """The baseline's map from the same question."""
    target = upsampled(phantom.coarse_map, phantom.luma.shape).numpy()
    settings = {"cell_voxels": EDGES, "sigma_luma": SETTINGS.sigma_luma, **others}
    return solve_as_published(target, phantom.luma.numpy(), smoothness=smoothness, iterations=iterations, **settings).map


def converged(phantom: Phantom, smoothness: float) -> np.ndarray:
    """The exact answer in float64, bistochastisation included, by the independent implementation."""
    return published(phantom, 5000, smoothness, tolerance=1e-12, bistochastisation_steps=50)


def rms(refined: torch.Tensor, exact: np.ndarray) -> float:
    """Root mean square of the differences."""
    return float(np.sqrt(np.mean((refined.numpy().astype(np.float64) - exact) ** 2)))


def stages(phantom: Phantom) -> dict[str, float]:
    """Seconds in each stage: where the time goes."""
    size = len(phantom.luma)
    layout = GridLayout.of_sigmas((size, size, size), UNIT_SPACING, 5.0, SETTINGS.sigma_luma)
    voxel_cells = VoxelCells(layout, phantom.luma, WINDOW, SETTINGS.sigma_luma)
    target = Target(Upsampling(phantom.coarse_map, phantom.luma.shape).read, largest=1.0)
    with Workers(phantom.luma.device, phantom.luma.numel()) as workers:
        cells, places = splat(voxel_cells, target, None, workers)
        solve = partial(solve_cells, cells, SETTINGS.smoothness, SETTINGS.max_iterations, SETTINGS.tolerance, workers)
        values, out = solve().values, torch.empty_like(phantom.luma)
        ways: dict[str, Callable[[], Any]] = {
            "splatting, finding neighbours": lambda: splat(voxel_cells, target, None, workers),
            "bistochastisation, conjugate gradients": solve,
            "nearest slice": lambda: slice_nearest(voxel_cells, places, values, target, out, workers),
            "multilinear slice": lambda: slice_multilinear(voxel_cells, places, values, target, out, workers),
        }
        return {name: seconds for name, (seconds, _) in best_times(ways, 5).items()}


def error_by_iterations(phantom: Phantom) -> list[dict[str, Any]]:
    """Error and processor seconds after each number of iterations, in float32 and float64."""
    rows = []
    for smoothness in (8.0, 32.0, 256.0):
        exact = converged(phantom, smoothness)
        for precision, largest_ratio in (("float32", np.inf), ("float64", 0.0)):
            for iterations in (1, 2, 3, 4, 6, 8, 12, 16, 25):
                settings = replace(SETTINGS, smoothness=smoothness, max_iterations=iterations, tolerance=1e-9)
                run = partial(refine_nearest, phantom, settings)
                row = {"smoothness": smoothness, "precision": precision, "iterations": iterations}
                with patch.object(bilateral_energy, "MAX_FLOAT32_RATIO", largest_ratio):
                    rows.append({**row, "rms": rms(run().map, exact), "cpu_seconds": best_times({"": run}, 3)[""][1]})
        error = rms(torch.from_numpy(published(phantom, 25, smoothness)), exact)
        rows.append({"smoothness": smoothness, "precision": "published", "iterations": 25, "rms": error})
    return rows


def quality(phantom: Phantom) -> list[dict[str, Any]]:
    """Dice of each method, and of the solver over σ, λ and the slices."""
    target = upsampled(phantom.coarse_map, phantom.luma.shape)
    rows: list[dict[str, Any]] = [{"method": "trilinear", "dice": best_dice(target, phantom.structure)}]
    as_published = {"cell_voxels": (7, 7, 7), "sigma_luma": 5 / 255}
    refined = torch.from_numpy(published(phantom, 25, 256.0, **as_published))
    rows.append({"method": "published, its σ 7/5 and λ 256", "dice": best_dice(refined, phantom.structure)})
    for radius in (3.0, 5.0, 8.0):
        refined = guided_filter(target, phantom.luma, UNIT_SPACING, GuidedFilterSettings(radius_mm=radius))
        rows.append({"method": f"guided filter, radius {radius:g}", "dice": best_dice(refined, phantom.structure)})
    changes: list[dict[str, float]] = [{"smoothness": s} for s in (2.0, 128.0)]
    changes += [{"sigma_spatial_mm": s} for s in (3.0, 8.0)] + [{"sigma_luma": s / 255} for s in (5, 20, 40)]
    for slicing, change in [*((name, {}) for name in REFINE), *(("multilinear", change) for change in changes)]:
        settings = replace(SETTINGS, **change)  # type: ignore[arg-type]
        sigmas = f"σ {settings.sigma_spatial_mm:g}/{settings.sigma_luma * 255:g}"
        dice = best_dice(REFINE[slicing](phantom, settings).map, phantom.structure)
        rows.append({"method": f"solver, {sigmas}, λ {settings.smoothness:g}, {slicing}", "dice": dice})
    return rows


def time_by_active_cells(size: int) -> list[dict[str, Any]]:
    """Seconds where only cells near a sphere are solved for, over the sphere's radius."""
    rows = []
    for radius in (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4):
        phantom = sphere_phantom(size, radius)
        ways: dict[str, Callable[[], Any]] = {name: partial(way, phantom, threshold=THRESHOLD) for name, way in REFINE.items()}
        times = {f"{name}_s": seconds for name, (seconds, _) in best_times(ways, 5).items()}
        rows.append({"radius": radius, "cells": ways["nearest"]().cells, **times})
    return rows


def memory_in_new_process(size: int, slicing: str) -> int:
    """`extra_memory_bytes` in a process that has done nothing before."""
    threads = str(torch.get_num_threads())
    command = [sys.executable, "-m", "Benchmarks.solver.run", "--threads", threads, "--memory-of", str(size), slicing]
    return int(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def extra_memory_bytes(size: int, slicing: str) -> int:
    """Peak resident memory while refining, above that with the inputs alone; the refined map is included (Linux only)."""
    phantom = body_phantom(size)
    way = REFINE[slicing]
    way(body_phantom(32))
    before = resident_bytes()
    forget_peak()
    way(phantom)
    return peak_resident_bytes() - before


def real_edges(folder: Path) -> list[dict[str, Any]]:
    """Dice on real intensities: an organ's label, made as coarse as a similarity map, is refined and compared with itself."""
    import SimpleITK

    image = SimpleITK.ReadImage(str(folder / "amos_0336_ct.nii.gz"))
    labels = SimpleITK.GetArrayFromImage(SimpleITK.ReadImage(str(folder / "amos_0336_labels.nii.gz")))
    intensities = torch.from_numpy(SimpleITK.GetArrayFromImage(image).astype(np.float32))
    spacing_mm = image.GetSpacing()[::-1]
    luma = ((intensities - SOFT_TISSUE[0]) / (SOFT_TISSUE[1] - SOFT_TISSUE[0])).clamp(0.0, 1.0)
    rows = []
    for organ, label in (("spleen", 1), ("right kidney", 2), ("liver", 6), ("bladder", 14)):
        structure = torch.from_numpy(labels == label)
        coarse = coarse_map_of(structure)
        target = upsampled(coarse, intensities.shape)
        solve = partial(refine_map, coarse, intensities, SOFT_TISSUE, spacing_mm, BilateralSolverSettings(), THRESHOLD)
        solution = solve()
        dice = {
            "trilinear": best_dice(target, structure),
            "guided_filter": best_dice(guided_filter(target, luma, spacing_mm), structure),
            "solver": best_dice(solution.map, structure),
        }
        rows.append({"case": f"CT, {organ}", **dice, "cells": solution.cells, "solver_s": best_times({"": solve}, 3)[""][0]})
    return rows


if __name__ == "__main__":
    main()
