"""A volume of structures with what is needed to show it: where it lies, and what its numbers stand for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..core.geometry import Geometry
from .appearance import Appearance, appearance_rows
from .composition import own_levels
from .shader import CONTEXT, SCENE, STRUCTURES
from .surroundings import Surroundings

UNITS = 200.0
"""Densities are for so many parts of the scan's longest edge: what is translucent is so at any size of voxels and bodies."""

OUTLIERS_PERCENT = 0.02
"""Of the voxels at either end of the intensities, which are not told apart: 256 levels are few, and metal is rare."""


@dataclass(frozen=True, eq=False)
class StructureVolume:
    """A volume of structures (`composition`).

    Attributes:
        voxels: (K, J, I, 4) uint8.
        own_levels: (structures, 2), the grey levels between which most voxels of each structure lie.
        between: the intensities that grey levels 0 and 255 stand for.
        unit_voxels: the length that densities are for, in voxels.
        geometry: of its voxels, in the scan's frame.
    """

    voxels: np.ndarray
    own_levels: np.ndarray
    between: tuple[float, float]
    unit_voxels: float
    geometry: Geometry

    def uniforms(self, appearances: Sequence[Appearance], surroundings: Surroundings) -> dict[str, np.ndarray]:
        """The shader's variables by name, float64: matrices (N, 4, 4), or a vector (4,).

        Args:
            appearances: of the structures, in the order of their numbers.
            surroundings: of what belongs to none.
        """
        colors = surroundings.colors(self.between, self.unit_voxels)
        return {
            STRUCTURES: appearance_rows(appearances, self.own_levels, self.between, self.unit_voxels),
            CONTEXT: colors.reshape(-1, 4, 4),
            SCENE: np.array(surroundings.scene_vector(colors)),
        }


def structure_volume(
    voxels: np.ndarray, structures: int, between: tuple[float, float], geometry: Geometry, scan: Geometry
) -> StructureVolume:
    """A volume of structures, seen as part of a scan.

    Args:
        voxels: (K, J, I, 4) uint8.
        structures: how many there are.
        between: the intensities that grey levels 0 and 255 stand for.
        geometry: where the voxels lie.
        scan: where those of the scan do, all of it.
    """
    unit_mm = float(scan.extent_mm.max()) / UNITS
    unit_voxels = unit_mm / float(np.cbrt(np.prod(geometry.spacing_mm)))
    return StructureVolume(voxels, own_levels(voxels, structures), between, unit_voxels, geometry)
