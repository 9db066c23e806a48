"""The ways from a coarse map to a fine one that are compared: the product's, with other parameters, and others.

Of the product's refinement every step is its own, but for the one that a candidate replaces; see `Logic/refinement`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal
from unittest.mock import patch

import numpy as np

from ViTTransferFunction.Logic.core.classes.class_map import NEAR_SHARE_OF_ISO
from ViTTransferFunction.Logic.core.volumes.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.refinement import intensity_likelihood
from ViTTransferFunction.Logic.refinement.intensity_likelihood import weigh_by_intensity
from ViTTransferFunction.Logic.refinement.refinement import SIGMA_SHARE_OF_CELL, active_box, class_window

Iso = Literal["coarse", "refined"] | float
"""Threshold of the refined map: that of the coarse one, the one that the session chooses for a refined map, or a fixed one."""

ALL_ROUNDS = (3, 5, 10)
LATE_ROUNDS = (5, 10)
"""The rounds at which every candidate is measured."""
WALKER_VOXELS = 200_000
"""The random walker's crop is made coarser where it has more: it solves for every voxel between the seeds."""
WALKER_INSIDE, WALKER_OUTSIDE = 0.8, 0.3
"""Seeds: where the map exceeds this share of its value at the positive points, and where it is below this share of the iso."""
WALKER_ISO = 0.5
WALKER_TOLERANCE = 1e-5
SMALLEST_SIGMA_VOXELS = 2.0


@dataclass(frozen=True, eq=False)
class CoarseMap:
    """A class's map, and what is known where it is refined.

    Attributes:
        similarity: S_L, (K', J', I') float32 in [0, 1], on cells that fill the volume's box.
        iso: its threshold.
        at_positives: median of the map at the class's positive points.
        positive_ras: (N, 3) RAS millimetres, those points.
        volume: the intensities.
        display: the window in which a person would look at them.
    """

    similarity: np.ndarray
    iso: float
    at_positives: float
    positive_ras: np.ndarray
    volume: Volume
    display: IntensityWindow


@dataclass(frozen=True, eq=False)
class Crop:
    """The part of a volume that is refined.

    Attributes:
        map: (K, J, I) float32, interpolated, and weighed by the intensities where the candidate does so.
        intensities: (K, J, I).
        window: in which the structure's edges show.
        spacing_mm: along (K, J, I).
        cell_edge_mm: the shortest edge of a feature cell.
        coarse: what is refined.
    """

    map: np.ndarray
    intensities: np.ndarray
    window: IntensityWindow
    spacing_mm: tuple[float, ...]
    cell_edge_mm: float
    coarse: CoarseMap


@dataclass(frozen=True)
class BilateralParameters:
    """The product's choice, and its deviations.

    Attributes:
        smoothness: λ.
        luma: σ_luma, in 255ths of the window.
        cells: σ_spatial in feature cells, two voxels at least.
        iterations: of conjugate gradients, at most.
    """

    smoothness: float = 32.0
    luma: float = 10.0
    cells: float = SIGMA_SHARE_OF_CELL
    iterations: int = 50


@dataclass(frozen=True)
class Candidate:
    """One way of refinement.

    Attributes:
        name: in reports.
        in_crop: refines the map of a crop; None: interpolation alone.
        temper: β of the intensity likelihood; None: without.
        iso: threshold of the refined map.
        rounds: at which it is measured.
        settles: whether the refined map's surface settles, as in the product.
    """

    name: str
    in_crop: Callable[[Crop], np.ndarray] | None
    temper: float | None = intensity_likelihood.TEMPER
    iso: Iso = "refined"
    rounds: tuple[int, ...] = LATE_ROUNDS
    settles: bool = True

    def refine(self, coarse: CoarseMap) -> np.ndarray:
        """S_H, (K, J, I) float32 in [0, 1]."""
        import torch

        from ViTTransferFunction.Logic.refinement.upsampling import upsampled

        volume, similarity = coarse.volume, coarse.similarity
        refined = upsampled(torch.from_numpy(np.ascontiguousarray(similarity)), volume.shape).numpy()
        near = NEAR_SHARE_OF_ISO * coarse.iso
        box = active_box(similarity > near, volume.shape)
        if self.in_crop is None or box is None:
            return refined
        window = class_window(volume, coarse.display, coarse.positive_ras)
        intensities, target = np.ascontiguousarray(volume.array[box]), refined[box].copy()
        if self.temper is not None:
            with patch.object(intensity_likelihood, "TEMPER", self.temper):
                weigh_by_intensity(target, intensities, window, coarse.iso, near)
        spacing_mm = volume.geometry.spacing_mm[::-1]
        cell_edge_mm = float((spacing_mm * volume.shape / similarity.shape).min())
        refined[box] = self.in_crop(Crop(target, intensities, window, tuple(spacing_mm.tolist()), cell_edge_mm, coarse))
        return refined


def bilateral(parameters: BilateralParameters) -> Callable[[Crop], np.ndarray]:
    """The product's bilateral solver with these parameters."""

    def in_crop(crop: Crop) -> np.ndarray:
        import torch

        from ViTTransferFunction.Logic.refinement.bilateral_solver import BilateralSolverSettings, refine_map

        settings = BilateralSolverSettings(
            sigma_spatial_mm=max(parameters.cells * crop.cell_edge_mm, SMALLEST_SIGMA_VOXELS * min(crop.spacing_mm)),
            sigma_luma=parameters.luma / 255.0,
            smoothness=parameters.smoothness,
            max_iterations=parameters.iterations,
        )
        tensors = torch.from_numpy(crop.map), torch.from_numpy(crop.intensities)
        bounds, threshold = (crop.window.low, crop.window.high), NEAR_SHARE_OF_ISO * crop.coarse.iso
        return refine_map(*tensors, bounds, crop.spacing_mm, settings, threshold).map.numpy()

    return in_crop


def bilateral_as_published(crop: Crop) -> np.ndarray:
    """The settings of the published solver, which knows voxels and no millimetres, in all of the crop."""
    import torch

    from Benchmarks.solver.nearest_slice import nearest_slicing
    from ViTTransferFunction.Logic.refinement.bilateral_solver import BilateralSolverSettings, refine_map

    settings = BilateralSolverSettings(sigma_spatial_mm=7.0, sigma_luma=5.0 / 255.0, smoothness=256.0)
    tensors = torch.from_numpy(crop.map), torch.from_numpy(crop.intensities)
    with nearest_slicing():
        return refine_map(*tensors, (crop.window.low, crop.window.high), (1.0, 1.0, 1.0), settings).map.numpy()


def unchanged(crop: Crop) -> np.ndarray:
    """The map as it is."""
    return crop.map


def guided(crop: Crop) -> np.ndarray:
    """The product's guided filter."""
    import torch

    from ViTTransferFunction.Logic.refinement.guided_filter import guided_filter

    luma = torch.from_numpy(crop.window.apply(crop.intensities))
    return guided_filter(torch.from_numpy(crop.map), luma, crop.spacing_mm).numpy()


def random_walker(beta: float) -> Callable[[Crop], np.ndarray]:
    """The probability with which a random walker from a voxel comes to the seeds inside first (Grady 2006)."""

    def in_crop(crop: Crop) -> np.ndarray:
        import torch
        from skimage.segmentation import random_walker as walk
        from torch.nn.functional import adaptive_avg_pool3d

        from ViTTransferFunction.Logic.refinement.upsampling import upsampled

        step = max(1.0, (crop.map.size / WALKER_VOXELS) ** (1.0 / 3.0))
        k, j, i = (max(1, math.floor(n / step)) for n in crop.map.shape)
        shape = k, j, i
        luma, coarse = (
            adaptive_avg_pool3d(torch.from_numpy(a)[None], shape)[0].numpy()
            for a in (crop.window.apply(crop.intensities), crop.map)
        )
        spacing = [s * n / m for s, n, m in zip(crop.spacing_mm, crop.map.shape, shape, strict=True)]
        seeds = walker_seeds(coarse, crop.coarse.at_positives, crop.coarse.iso)
        relative = np.array(spacing) / min(spacing)
        # No warning of probabilities that are off where β is large and parts are hardly connected: they are clipped.
        exactness = {"tol": WALKER_TOLERANCE, "prob_tol": np.inf}
        walked = walk(luma, seeds, beta=beta, mode="cg_j", spacing=relative, return_full_prob=True, **exactness)
        inside = np.clip(walked[0], 0.0, 1.0).astype(np.float32)
        return upsampled(torch.from_numpy(inside), crop.map.shape).numpy()

    return in_crop


def walker_seeds(similarity: np.ndarray, at_positives: float, iso: float) -> np.ndarray:
    """Seeds from a map (K, J, I): 1 inside, 2 outside, 0 for what the random walker decides; at least one voxel of each."""
    seeds = np.zeros(similarity.shape, dtype=np.uint8)
    seeds[similarity < WALKER_OUTSIDE * iso] = 2
    seeds[similarity > WALKER_INSIDE * at_positives] = 1
    seeds.flat[similarity.argmin()] = 2
    seeds.flat[similarity.argmax()] = 1
    return seeds


PRODUCT = BilateralParameters()


def _varied(name: str, **change: float) -> Candidate:
    return Candidate(name, bilateral(replace(PRODUCT, **change)))  # type: ignore[arg-type]


def _walker(beta: float, iso: Iso) -> Candidate:
    name = f"random walker, β {beta}" + (", refined iso" if iso == "refined" else "")
    return Candidate(name, random_walker(beta), temper=None, iso=iso, settles=False)


DEFAULT = Candidate("bilateral (default)", bilateral(PRODUCT), rounds=ALL_ROUNDS)
CANDIDATES: tuple[Candidate, ...] = (
    DEFAULT,
    Candidate("bilateral, not settled", bilateral(PRODUCT), rounds=ALL_ROUNDS, settles=False),
    Candidate("bilateral, no likelihood", bilateral(PRODUCT), temper=None, rounds=ALL_ROUNDS),
    Candidate("trilinear", None, iso="coarse", rounds=ALL_ROUNDS, settles=False),
    Candidate("trilinear, refined iso", None, rounds=ALL_ROUNDS, settles=False),
    Candidate("likelihood alone", unchanged, rounds=ALL_ROUNDS),
    Candidate("guided", guided, rounds=ALL_ROUNDS),
    Candidate("guided, no likelihood", guided, temper=None, rounds=ALL_ROUNDS),
    Candidate("guided, not settled", guided, rounds=ALL_ROUNDS, settles=False),
    Candidate("bilateral as published", bilateral_as_published, temper=None, rounds=ALL_ROUNDS, settles=False),
    *(_walker(beta, WALKER_ISO) for beta in (130, 1000, 10000)),
    *(_walker(beta, "refined") for beta in (1000, 10000)),
    *(_varied(f"λ {value}", smoothness=value) for value in (2, 8, 128, 512)),
    *(_varied(f"σ_luma {value} of 255", luma=value) for value in (5, 20, 40)),
    *(_varied(f"σ_spatial {value} cells", cells=value) for value in (0.3, 1.0, 1.5)),
    *(_varied(f"iterations {value}", iterations=value) for value in (1, 2, 4, 8)),
    *(Candidate(f"likelihood β {value}", bilateral(PRODUCT), temper=value) for value in (0.25, 1.0)),
)
