"""From a low-resolution map S_L to a full-resolution map S_H that follows the edges in the intensities (paper §III-C)."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from .errors import InputError
from .feature_volume import sample_at
from .intensity_window import IntensityWindow
from .volume import Volume

RefinementMethod = Literal["bilateral", "guided", "none"]
REFINEMENT_METHODS: tuple[str, ...] = get_args(RefinementMethod)

ACTIVE_SHARE_OF_ISO = 0.5
"""Voxels whose map stays below this share of the iso value are far from the surface and are not refined."""


def refine(
    similarity: np.ndarray,
    volume: Volume,
    display: IntensityWindow,
    positive_ras: np.ndarray,
    iso: float,
    method: RefinementMethod,
) -> np.ndarray:
    """Upsample a class's map and sharpen it against the volume's intensities.

    Args:
        similarity: S_L, (K', J', I') float32 in [0, 1], on cells that fill the volume's box.
        volume: the intensities.
        display: the window in which a person would look at them (`display_window`).
        positive_ras: (N, 3) RAS millimetres, points on the structure: its intensities are the ones to tell apart.
        iso: threshold that will be applied, which says where the surface will be.
        method: "bilateral": 3D bilateral solver; "guided": 3D guided filter; "none": trilinear upsampling alone.

    Returns:
        S_H, (K, J, I) float32, within the range of `similarity`.
    """
    import torch

    from .bilateral_solver import refine_map
    from .upsampling import upsampled

    low = torch.from_numpy(np.ascontiguousarray(similarity, dtype=np.float32))
    if method == "none":
        return upsampled(low, volume.shape).numpy()
    window = class_window(volume, display, positive_ras)
    intensities = torch.from_numpy(np.ascontiguousarray(volume.array))
    spacing_mm = tuple(volume.geometry.spacing_mm[::-1].tolist())
    if method == "bilateral":
        bounds = (window.low, window.high)
        return refine_map(low, intensities, bounds, spacing_mm, threshold=ACTIVE_SHARE_OF_ISO * iso).map.numpy()
    if method == "guided":
        from .guided_filter import guided_filter

        return guided_filter(upsampled(low, volume.shape), torch.from_numpy(window.apply(volume.array)), spacing_mm).numpy()
    raise InputError(f"Unknown refinement '{method}'; expected one of {', '.join(REFINEMENT_METHODS)}.")


def class_window(volume: Volume, display: IntensityWindow, positive_ras: np.ndarray) -> IntensityWindow:
    """The window in which a structure's edges show: as wide as the display's, centred on the annotated intensities.

    So lung is told from the chest wall and from outside air although a soft-tissue window shows it as plain black.
    """
    annotated = _intensities_at(volume, positive_ras)
    if not annotated.size:
        return display
    centre = float(np.median(annotated))
    return IntensityWindow(centre - 0.5 * display.width, centre + 0.5 * display.width)


def _intensities_at(volume: Volume, points_ras: np.ndarray) -> np.ndarray:
    """Finite interpolated intensities at world points, (≤ N,)."""
    samples = sample_at(volume.array[..., None], volume.geometry, points_ras)
    return samples[np.isfinite(samples)]
