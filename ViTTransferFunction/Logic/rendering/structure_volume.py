"""A volume of structures with what is needed to show it: where it lies, and what its numbers stand for."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from ..core.volumes.geometry import Geometry, body_scale
from .appearance import Appearance, appearance_rows, window_levels
from .composition import DEPTH, NUMBER, SURFACE, own_levels
from .shader import CONTEXT, SCENE, STRUCTURES
from .surroundings import Surroundings

UNITS = 200.0
"""Densities are for so many parts of the scan's longest edge: what is translucent is so at any size of voxels and bodies."""


@dataclass(frozen=True, eq=False)
class StructureVolume:
    """A volume of structures (`composition`).

    Attributes:
        voxels: (K, J, I, 4) uint8.
        own_levels: (structures, 2), the grey levels between which most voxels of each structure lie.
        levels: (256,), the intensity that each grey level stands for.
        hounsfield: whether intensities are Hounsfield units.
        unit_voxels: the length that densities are for, in voxels.
        geometry: of its voxels, in the scan's frame.
    """

    voxels: np.ndarray
    own_levels: np.ndarray
    levels: np.ndarray
    hounsfield: bool
    unit_voxels: float
    geometry: Geometry

    @property
    def body_scale(self) -> float:
        """By what lengths that are meant for bodies are multiplied in the scan that it is of (`body_scale`)."""
        return body_scale(UNITS * self.unit_voxels * float(np.cbrt(np.prod(self.geometry.spacing_mm))))

    def voxels_without(self, hidden: Collection[int]) -> np.ndarray:
        """The voxels, with structures of these indices, from 0, lying as far outside as they lie inside; itself for none.

        By depths alone, VTK finds what a click in a 3D view meets. For the others, the shader takes depths the same way.
        """
        if not hidden:
            return self.voxels
        numbers = np.zeros(256, dtype=bool)
        numbers[[index + 1 for index in hidden]] = True
        voxels: np.ndarray = self.voxels.copy()
        depths = voxels[..., DEPTH]
        np.copyto(depths, 255 - depths, where=numbers[voxels[..., NUMBER]] & (depths > SURFACE))
        return voxels

    def window(self, index: int, look: Appearance) -> tuple[float, float]:
        """The intensities between which the structure of an index, from 0, gets brighter and more opaque."""
        low, high = window_levels(look, self.own_levels[index], self.levels)
        return float(np.interp(low, np.arange(256), self.levels)), float(np.interp(high, np.arange(256), self.levels))

    def uniforms(self, appearances: Sequence[Appearance], surroundings: Surroundings) -> dict[str, np.ndarray]:
        """The shader's variables by name, float64: matrices (N, 4, 4), or a vector (4,).

        Args:
            appearances: of the structures, in the order of their numbers.
            surroundings: of what belongs to none.
        """
        colors = surroundings.colors(self.levels, self.unit_voxels)
        return {
            STRUCTURES: appearance_rows(appearances, self.own_levels, self.levels, self.unit_voxels),
            CONTEXT: colors.reshape(-1, 4, 4),
            SCENE: np.array(surroundings.scene_vector(colors)),
        }


def structure_volume(
    voxels: np.ndarray, structures: int, levels: np.ndarray, geometry: Geometry, scan: Geometry, *, hounsfield: bool
) -> StructureVolume:
    """A volume of structures, seen as part of a scan.

    Args:
        voxels: (K, J, I, 4) uint8.
        structures: how many there are.
        levels: the intensity that each grey level stands for (`intensity_levels`).
        geometry: where the voxels lie.
        scan: where all of the scan lies.
        hounsfield: whether its intensities are Hounsfield units.
    """
    unit_mm = float(scan.extent_mm.max()) / UNITS
    unit_voxels = unit_mm / float(np.cbrt(np.prod(geometry.spacing_mm)))
    return StructureVolume(voxels, own_levels(voxels, structures), levels, hounsfield, unit_voxels, geometry)
