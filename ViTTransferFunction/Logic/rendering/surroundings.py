"""What belongs to no structure, as the volume itself shows it: from nothing over bones and skin to any of Slicer's presets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..core.classes.colors import Color
from .shader import CONTEXT_COLORS

Knot = tuple[float, Color, float]
"""An intensity, the colour there, and the opacity there per unit of length, in [0, 1]; linear between them."""

BONE: Color = (0.93, 0.90, 0.82)
VESSEL: Color = (0.85, 0.45, 0.36)
SKIN: Color = (0.90, 0.72, 0.60)


@dataclass(frozen=True)
class Surroundings:
    """How what belongs to no structure looks.

    Attributes:
        knots: by increasing intensity; none: it is not shown.
        strength: how dense it is, 1 for as the knots say, in [0, 1].
        cutaway: how much of what lies before structures gives way to them, in [0, 1].
    """

    knots: tuple[Knot, ...] = ()
    strength: float = 1.0
    cutaway: float = 0.0

    @property
    def visible(self) -> bool:
        """Whether any of it is seen."""
        return self.strength > 0.0 and any(opacity > 0.0 for _, _, opacity in self.knots)

    def colors(self, levels: np.ndarray, unit_voxels: float) -> np.ndarray:
        """What the shader reads, (CONTEXT_COLORS, 4) float64: colours, and the integral over the range of densities per voxel.

        Args:
            levels: (256,), the intensity that each grey level stands for.
            unit_voxels: the length that opacities are for, in voxels.
        """
        table = np.zeros((CONTEXT_COLORS, 4))
        if self.visible:
            at = np.interp(np.linspace(0.0, 255.0, CONTEXT_COLORS), np.arange(256), levels)
            positions = [position for position, _, _ in self.knots]
            for channel in range(3):
                table[:, channel] = np.interp(at, positions, [color[channel] for _, color, _ in self.knots])
            opacities = np.interp(at, positions, [opacity for _, _, opacity in self.knots])
            densities = -np.log1p(-np.minimum(opacities, 0.995)) * self.strength / unit_voxels
            steps = 0.5 * (densities[1:] + densities[:-1]) / (CONTEXT_COLORS - 1)
            table[1:, 3] = np.cumsum(steps)
        return table

    def scene_vector(self, colors: np.ndarray) -> list[float]:
        """Whether there is any of it, how much gives way, and between which shares of the range it is seen; for a shader."""
        seen = np.flatnonzero(np.diff(colors[:, 3]) > 0.0)
        if not seen.size:
            return [0.0, self.cutaway, 2.0, 2.0]
        last = len(colors) - 1
        # What is beyond the range is as its end.
        low, high = seen[0] / last, (seen[-1] + 1) / last
        return [1.0, self.cutaway, low if low > 0.0 else -1.0, high if high < 1.0 else 2.0]


def bones_and_vessels(hounsfield: bool, levels: np.ndarray) -> tuple[Knot, ...]:
    """Bright things: bones, and vessels with contrast agent."""
    low, high = (150.0, 350.0) if hounsfield else _shares(levels, 0.55, 0.85)
    end = max(float(levels[-1]), high + 1.0)
    return (low, VESSEL, 0.0), (0.6 * low + 0.4 * high, VESSEL, 0.3), (high, BONE, 0.85), (end, BONE, 0.97)


def skin(hounsfield: bool, levels: np.ndarray) -> tuple[Knot, ...]:
    """The body's surface, from the air to what lies under the skin."""
    low, high = (-750.0, -150.0) if hounsfield else _shares(levels, 0.1, 0.28)
    middle = 0.5 * (low + high)
    return (low, SKIN, 0.0), (middle, SKIN, 0.5), (high, SKIN, 0.0)


def _shares(levels: np.ndarray, *shares: float) -> list[float]:
    return [float(levels[0] + share * (levels[-1] - levels[0])) for share in shares]


CONTEXTS = {"bones and vessels": bones_and_vessels, "skin": skin}
"""By name, what makes their knots: of whether intensities are Hounsfield units, and of the levels' intensities."""
