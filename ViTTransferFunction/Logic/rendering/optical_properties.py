"""How a volume of colours and codes is lit and how opaque it is, in numbers: the same in Slicer's views and in pictures.

A renderer interpolates colours and codes, takes opacity from the code, and normals from the code's gradient.
"""

from __future__ import annotations

import numpy as np

SURFACE = 127
"""Code on every surface."""

LAYER_VOXELS = 2.0
"""Thickness of the ramp inside the surface."""

DEEPEST = 8.0
"""Optical depth of an opaque class: a screen's 256 levels cannot tell it from infinity."""

CODE_COMPONENT = 3
"""The component of a voxel that is its code; those before it are its colour."""

UNIT_VOXELS = 0.1
"""The distance that opacities are for, short enough for the highest of them to stay below 1."""

AMBIENT, DIFFUSE, SPECULAR, SPECULAR_POWER = 0.35, 0.65, 0.2, 20.0
"""How surfaces answer light."""


def optical_density() -> np.ndarray:
    """Optical depth that a ray gathers on each voxel of its way, at each code, (256,) float64.

    On a ramp of height h, w voxels long, a ray gathers w/h ∫₀ʰ τ dx; with τ = 3 DEEPEST x² / w that is DEEPEST h².
    """
    height = np.clip((np.arange(256) - SURFACE) / (255.0 - SURFACE), 0.0, 1.0)
    return 3.0 * DEEPEST * height**2 / LAYER_VOXELS


def opacity_points(lowest: float, highest: float) -> list[tuple[float, float]]:
    """Positions and opacities in [0, 1] that define VTK's opacity function, for a way of `UNIT_VOXELS` voxels.

    Args:
        lowest: the lowest code that occurs in the volume.
        highest: the highest one.
    """
    # VTK spreads its table over the codes that occur, and then reads it as if that were all of 0 … 255.
    opacities = 1.0 - np.exp(-optical_density() * UNIT_VOXELS)
    spread = max(highest - lowest, 1.0)
    return [(lowest + spread * code / 255.0, float(opacities[code])) for code in (0, *range(SURFACE, 256))]
