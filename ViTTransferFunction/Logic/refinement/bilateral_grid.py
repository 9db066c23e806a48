"""The bilateral grid: voxels that are near each other in space and in intensity share a cell, which is one unknown.

A 4D grid over (K, J, I, luma). Spatial cells are whole numbers of voxels; luma cells are centred on the multiples of
`sigma_luma`, in units of the intensity window. A voxel's place in the dense grid is arithmetic: nothing is sorted or hashed.

The grid is processed in layers (all cells with the same K) or, if these are small, in runs of several layers; their voxels are
processed in pieces of a few slices or rows. So the data of each step stays in the processor's cache, and no temporary has the
size of the volume or of the dense grid. Unoccupied cells pad every row and column of a layer, so that neighbours can be read
without checks for borders; voxels that take no part are added to padding.

Cells are coloured red and black like a chessboard: every neighbour of a red cell is black, and vice versa. The padding makes
every stride odd, so that a cell's colour is the parity of the sum of its layer and its place in the layer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from ..core.system.errors import InputError
from . import large_arrays

if TYPE_CHECKING:
    from collections.abc import Iterator

    from torch import Tensor

    from ..core.volumes.geometry import Box

    Piece = tuple[slice, slice]
    """Ranges of slices (along K) and rows (along J), with all voxels along I."""

DIMENSIONS = 4
PIECE_VOXELS = 2**17
"""Most voxels of a piece. At 4 bytes a voxel, each temporary has half a megabyte and stays in the cache of a core."""
RUN_CELLS = 2**17
"""Cells that are processed at once if layers are small; half a megabyte for each temporary as well."""
MAX_DENSE_CELLS = 2**27
"""Most cells of the dense grid. A volume of 600³ voxels in cells of 5 voxels fits twice."""


@dataclass(frozen=True)
class GridLayout:
    """The number of cells, and the assignment of voxels to cells, in integers.

    Attributes:
        voxels: shape of the volume, (K, J, I).
        cell_voxels: voxels along each edge of a spatial cell, (K, J, I).
        luma_cells: number of cells along luma.
        before: by how many voxels the first cells begin before the volume, (K, J, I).
    """

    voxels: tuple[int, int, int]
    cell_voxels: tuple[int, int, int]
    luma_cells: int
    before: tuple[int, int, int] = (0, 0, 0)

    @classmethod
    def of_sigmas(
        cls,
        voxels: tuple[int, int, int],
        spacing_mm: tuple[float, float, float],
        sigma_spatial_mm: float,
        sigma_luma: float,
        border: tuple[int, int, int] = (0, 0, 0),
    ) -> GridLayout:
        """The layout whose cells are as near to `sigma_spatial_mm` as possible along each axis, and have `sigma_luma` in luma.

        Along each axis, a cell begins with the voxel of index `border`, or would if the volume reached as far.

        Raises:
            InputError: the grid would be too large to hold.
        """
        layout = cls._of_sigmas(voxels, spacing_mm, sigma_spatial_mm, sigma_luma)
        if layout.dense_cells > MAX_DENSE_CELLS:
            raise InputError(
                f"sigma_spatial_mm {sigma_spatial_mm:g} and sigma_luma {sigma_luma:g} divide a volume of {voxels} voxels of "
                f"{tuple(float(s) for s in spacing_mm)} mm into {layout.dense_cells:.3g} cells; expected at most "
                f"{MAX_DENSE_CELLS:.3g}. Raise either sigma, or refine a smaller region."
            )
        k, j, i = (-at % edge for at, edge in zip(border, layout.cell_voxels, strict=True))
        return replace(layout, before=(k, j, i))

    @classmethod
    def sigma_that_fits_mm(
        cls, voxels: tuple[int, int, int], spacing_mm: tuple[float, float, float], sigma_spatial_mm: float, sigma_luma: float
    ) -> float:
        """`sigma_spatial_mm` if `of_sigmas` has a layout for it, else about the smallest larger one for which it has."""
        longest_mm = max(n * s for n, s in zip(voxels, spacing_mm, strict=True))
        fits = sigma_spatial_mm
        while fits < longest_mm and cls._of_sigmas(voxels, spacing_mm, fits, sigma_luma).dense_cells > MAX_DENSE_CELLS:
            fits *= 1.05
        return fits

    @classmethod
    def _of_sigmas(
        cls, voxels: tuple[int, int, int], spacing_mm: tuple[float, float, float], sigma_spatial_mm: float, sigma_luma: float
    ) -> GridLayout:
        """As `of_sigmas`, but without a limit of its size."""
        # Cells are at most as large as the volume, which also covers infinite ratios.
        edges = [max(1, round(min(sigma_spatial_mm / s, n))) for s, n in zip(spacing_mm, voxels, strict=True)]
        return cls(voxels, (edges[0], edges[1], edges[2]), math.floor(min(1.0 / sigma_luma, 2.0**31) + 0.5) + 1)

    @property
    def cells(self) -> tuple[int, int, int]:
        """Spatial cells along (K, J, I), the first and the last of each row perhaps incomplete."""
        extents = zip(self.voxels, self.before, self.cell_voxels, strict=True)
        return tuple(-(-(before + n) // edge) for n, before, edge in extents)  # type: ignore[return-value]

    @property
    def layer_shape(self) -> tuple[int, int, int]:
        """Cells of a layer along (J, I, luma), padding included: odd numbers."""
        return (self.cells[1] + 1) | 1, (self.cells[2] + 1) | 1, (self.luma_cells + 1) | 1

    @property
    def layer_size(self) -> int:
        """Cells of a layer, padding included. The last is padding along every axis."""
        return math.prod(self.layer_shape)

    @property
    def dense_cells(self) -> int:
        """Cells of the dense grid."""
        return self.cells[0] * self.layer_size

    @property
    def strides(self) -> tuple[int, int, int]:
        """Distance within a layer between neighbours along (J, I, luma)."""
        _, columns, lumas = self.layer_shape
        return columns * lumas, lumas, 1

    def layers(self) -> list[tuple[int, slice]]:
        """Number of each layer of cells, and its voxels along K."""
        return [(layer, self.slices(slice(layer, layer + 1))) for layer in range(self.cells[0])]

    def runs(self) -> list[slice]:
        """All layers of cells in runs of about `RUN_CELLS` cells, but at least one layer."""
        count, end = max(RUN_CELLS // self.layer_size, 1), self.cells[0]
        return [slice(start, min(start + count, end)) for start in range(0, end, count)]

    def slices(self, layers: slice) -> slice:
        """The voxels along K of a range of layers."""
        return self._along(0, layers)

    def extents(self, cells: Box) -> Box:
        """The voxels of a box of spatial cells."""
        k, j, i = (self._along(axis, extent) for axis, extent in enumerate(cells))
        return k, j, i

    def part(self, cells: Box) -> GridLayout:
        """The layout of the voxels of a box of spatial cells."""
        k, j, i = (extent.stop - extent.start for extent in self.extents(cells))
        before_k, before_j, before_i = (
            0 if extent.start else before for extent, before in zip(cells, self.before, strict=True)
        )
        return replace(self, voxels=(k, j, i), before=(before_k, before_j, before_i))

    def _along(self, axis: int, cells: slice) -> slice:
        """The voxels of a range of cells along an axis."""
        edge, before = self.cell_voxels[axis], self.before[axis]
        return slice(max(cells.start * edge - before, 0), min(cells.stop * edge - before, self.voxels[axis]))


@dataclass(frozen=True, eq=False)
class VoxelCells:
    """Which cell of the dense grid each voxel lies in.

    Attributes:
        layout: the dense grid.
        intensities: (K, J, I), any real dtype; voxels that are not finite take no part.
        window: the intensities that count as luma 0 and luma 1; those outside are clamped.
        sigma_luma: size of a luma cell.
        active: (K, J, I) bool over spatial cells: those that take part; None for all.
    """

    layout: GridLayout
    intensities: Tensor
    window: tuple[float, float]
    sigma_luma: float
    active: Tensor | None = None

    def pieces(self, slices: slice) -> Iterator[Piece]:
        """Slices divided into pieces of at most `PIECE_VOXELS`, but at least one row; on a GPU, all in one piece."""
        _, rows, columns = self.layout.voxels
        most = PIECE_VOXELS if self.intensities.device.type == "cpu" else math.prod(self.layout.voxels)
        slice_step, row_step = max(1, most // (rows * columns)), min(rows, max(1, most // columns))
        for k in range(slices.start, slices.stop, slice_step):
            for j in range(0, rows, row_step):
                yield slice(k, min(k + slice_step, slices.stop)), slice(j, min(j + row_step, rows))

    def taking_part(self, piece: Piece) -> Tensor | None:
        """(slices, rows, I) bool: whether the voxels of a piece take part; None if all do."""
        import torch

        part = None
        if self.active is not None:
            slices, rows = piece
            layers, of_rows, of_columns = self._cells_of_voxels
            first, last = ((at + self.layout.before[0]) // self.layout.cell_voxels[0] for at in (slices.start, slices.stop - 1))
            part = self.active[first : last + 1].index_select(2, of_columns).index_select(1, of_rows[rows])
            part = (
                part.index_select(0, layers[slices] - first)
                if last > first
                else part.expand(slices.stop - slices.start, -1, -1)
            )
            part = None if bool(part.all()) else part
        if large_arrays.all_finite(self.intensities[piece]):
            return part
        finite = torch.isfinite(self.intensities[piece])
        return finite if part is None else finite & part

    def luma_coordinates(
        self, piece: Piece, part: Tensor | None, origin: float, unit: float, out: Tensor | None = None
    ) -> Tensor:
        """(slices, rows, I) float32: where voxels lie along luma; where not in `part`, anywhere on it.

        The axis has luma 0 at `origin` and cells of length `unit`.
        """
        import torch

        low, high = self.window
        # A window without width tells no intensities apart.
        units_per_intensity = unit / ((high - low) * self.sigma_luma) if high > low else 0.0
        # In one piece, also where the intensities are a part of a larger volume.
        intensities = self.intensities[piece].to(torch.float32).contiguous()
        if part is not None:
            intensities = torch.where(part, intensities, low)
        at_zero = torch.tensor(origin - low * units_per_intensity, device=intensities.device)
        coordinates = torch.add(at_zero, intensities, alpha=units_per_intensity, out=out)
        last_cell = min(1.0 / self.sigma_luma, self.layout.luma_cells - 1.0)
        return coordinates.clamp_(origin, origin + unit * last_cell)

    def keys(self, piece: Piece, part: Tensor | None, first_layer: int) -> Tensor:
        """(slices, rows, I) int32: place of each voxel's cell among those of the layers from one on.

        Where not in `part`, it is the last place of that layer, padding.
        """
        import torch

        slices, rows = piece
        keys = self.luma_coordinates(piece, part, origin=0.5, unit=1.0).to(torch.int32).add_(self._column_keys[rows])
        layers = self._cells_of_voxels[0][slices] - first_layer
        keys += (layers * self.layout.layer_size)[:, None, None]
        return keys if part is None else torch.where(part, keys, self.layout.layer_size - 1)

    @cached_property
    def _cells_of_voxels(self) -> list[Tensor]:
        """The number of each voxel's cell along K, J and I, int32."""
        import torch

        return [
            torch.arange(before, before + n, dtype=torch.int32, device=self.intensities.device) // edge
            for n, before, edge in zip(self.layout.voxels, self.layout.before, self.layout.cell_voxels, strict=True)
        ]

    @cached_property
    def _column_keys(self) -> Tensor:
        """(J, I) int32: the place within a layer of the first of the luma cells that a voxel may lie in."""
        _, rows, columns = self._cells_of_voxels
        return rows[:, None] * self.layout.strides[0] + columns * self.layout.strides[1]
