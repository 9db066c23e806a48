"""How alike two places are: the kernel of kernel ridge regression.

Two places are alike when their features, their intensities and their positions are, so it is a product:

    k(x, y) = exp(γ (cos(F_x, F_y) − 1)) · exp(−(u_x − u_y)² / 2σ_u²) · ((1 − a) + a exp(−|x − y|² / 2σ_x²)).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..core.volumes.geometry import Geometry
from ..core.volumes.torch_arrays import array_of, tensor_of

if TYPE_CHECKING:
    from torch import Tensor

FEATURE_SHARPNESS = 2.5
"""γ: how fast similarity falls with the angle between whitened features."""
INTENSITY_SIGMA = 0.12
"""σ_u, in units of the CDF: intensities are compared by what share of the volume's voxels lies between them, about."""
POSITION_SIGMA = 0.15
"""σ_x, as a share of the longest edge of the volume, or of that of which it is a part."""
POSITION_WEIGHT = 0.5
"""a: similarity of far places is this much smaller, so that the second kidney is found, but after the first."""
PAIRS_AT_ONCE = 2**19
"""So many values of kernels, two megabytes, stay near the processor while they are computed."""
RIGHT_ANGLE = 1e-6
"""The largest cosine between axes that count as being at right angles to each other."""


class Places:
    """Where and what.

    Args:
        features: (N, C) float32, unit vectors; fastest compared where those of many places lie channel by channel.
        positions: (N, 3) float32, in units of σ_x, around the middle of the cells: so that differences of positions far from
            the origin are as exact.
        cdf: (N,) float32, the intensities' CDF.
    """

    def __init__(self, features: np.ndarray, positions: np.ndarray, cdf: np.ndarray) -> None:
        self.features, self.positions, self.cdf = features, positions, cdf

    def subset(self, index: np.ndarray | slice) -> Places:
        """Some of them."""
        return Places(self.features[index], self.positions[index], self.cdf[index])


def place_kernel(a: Places, b: Places) -> np.ndarray:
    """Kernel of every place of `a` with every place of `b`, (len a, len b) float32."""
    import torch

    kernel = torch.empty((len(a.cdf), len(b.cdf)))
    _write_kernel(kernel, a, b, _near(a, b))
    return array_of(kernel)


def alike(a: Places, b: Places) -> np.ndarray:
    """The kernel as if all places were one: how alike features and intensities are, (len a, len b) float32."""
    import torch

    kernel = torch.empty((len(a.cdf), len(b.cdf)))
    _write_kernel(kernel, a, b, torch.ones_like(kernel))
    return array_of(kernel)


def nearness(a: Places, b: Places, sigma: np.ndarray) -> np.ndarray:
    """exp(−|x − y|² / 2σ²) with a σ for each place of `a`, (len a,) in units of σ_x: (len a, len b) float32."""
    return array_of(_near(a, b, sigma))


class CellKernel:
    """Kernel of places with the cells of a grid.

    Args:
        cells: all of them, in the order of a flattened array.
        geometry: of the grid.
        sigma_mm: σ_x.

    Attributes:
        cells: those.
        at_right_angles: whether the grid's axes are. Then |x − y|² is a sum over the axes, and what is computed of it a product
            of little tables. Only a transform that shears the volume makes them otherwise.
    """

    def __init__(self, cells: Places, geometry: Geometry, sigma_mm: float) -> None:
        self.cells = cells
        self._shape = geometry.shape
        steps = geometry.ijk_to_ras[:3, 2::-1].T / sigma_mm
        lengths = np.linalg.norm(steps, axis=1)
        self._directions = steps / lengths[:, None]
        cosines = self._directions @ self._directions.T
        self.at_right_angles = bool((np.abs(cosines - np.eye(3)) <= RIGHT_ANGLE).all())
        self._coordinates = [
            (np.arange(count) - 0.5 * (count - 1)) * length for count, length in zip(geometry.shape, lengths, strict=True)
        ]

    def write(self, places: Places, kernel: np.ndarray) -> None:
        """Write the kernel of places (P) with all cells to an array (P, cells) float32, whose rows may lie apart."""
        columns, rows = self._shape[2], tensor_of(kernel)
        lines = self._shape[0] * self._shape[1]
        at_once = max(1, PAIRS_AT_ONCE // (len(places.cdf) * columns))
        for first in range(0, lines, at_once):
            some = slice(first, min(first + at_once, lines))
            cells = self.cells.subset(slice(some.start * columns, some.stop * columns))
            near = self._near_lines(places, some) if self.at_right_angles else _near(places, cells)
            _write_kernel(rows[:, some.start * columns : some.stop * columns], places, cells, near)

    def nearness(self, places: Places, sigma: float) -> np.ndarray:
        """exp(−|x − y|² / 2σ²) of places (P) with all cells, with σ in units of σ_x, (P, cells) float32."""
        if self.at_right_angles:
            return array_of(self._near_lines(places, slice(None), sigma))
        return nearness(places, self.cells, np.full(len(places.cdf), sigma))

    def _near_lines(self, places: Places, lines: slice, sigma: float = 1.0) -> Tensor:
        """`_near` with the cells of some of the lines of cells along I, where the axes are at right angles.

        It is a product of one such factor for each of these.
        """
        along = places.positions @ self._directions.T
        of_k, of_j, of_i = (
            np.exp(-0.5 * ((coordinates - of_places[:, None]) / sigma) ** 2).astype(np.float32)
            for coordinates, of_places in zip(self._coordinates, along.T, strict=True)
        )
        of_lines = (of_k[:, :, None] * of_j[:, None, :]).reshape(len(along), -1)[:, lines]
        return (tensor_of(of_lines)[:, :, None] * tensor_of(of_i)[:, None, :]).flatten(1)


def _near(a: Places, b: Places, sigma: np.ndarray | float = 1.0) -> Tensor:
    """exp(−|x − y|² / 2σ²), (len a, len b), with one σ for all or each place of `a` in units of σ_x."""
    import torch

    squared = torch.zeros((len(a.cdf), len(b.cdf)))
    for of_a, of_b in zip(a.positions.T, b.positions.T, strict=True):
        _add_squared_differences(squared, of_a, of_b, 1.0)
    return squared.mul_(tensor_of(np.float32(-0.5) / np.atleast_1d(np.float32(sigma))[:, None] ** 2)).exp_()


def _write_kernel(kernel: Tensor, a: Places, b: Places, near: Tensor) -> None:
    """Write the kernel (len a, len b), given exp(−|x − y|² / 2σ_x²), in as few passes as there are."""
    # Far places' part of the weight goes into the exponent, and near ones' is added to it.
    kernel.fill_(math.log(1.0 - POSITION_WEIGHT) - FEATURE_SHARPNESS)
    _add_squared_differences(kernel, a.cdf, b.cdf, -0.5 / INTENSITY_SIGMA**2)
    kernel.addmm_(tensor_of(np.float32(FEATURE_SHARPNESS) * a.features), tensor_of(b.features).T)
    far = kernel.exp_()
    far.addcmul_(far, near, value=POSITION_WEIGHT / (1.0 - POSITION_WEIGHT))


def _add_squared_differences(sums: Tensor, a: np.ndarray, b: np.ndarray, weight: float) -> None:
    """Add to sums (A, B) the squared differences of numbers (A,) and (B,), times a weight."""
    differences = tensor_of(a)[:, None] - tensor_of(b)
    sums.addcmul_(differences, differences, value=weight)
