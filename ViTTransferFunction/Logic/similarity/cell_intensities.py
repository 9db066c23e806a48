"""Everything that similarity rules need from a volume's intensities; independent of the features, except for their grid."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np

from ..core.volumes.geometry import Geometry
from ..core.volumes.intensity_window import display_window
from ..core.volumes.orientation import canonical_orientation
from ..core.volumes.volume import Volume
from ..features.background_tokens import background_cells
from ..features.network_channels import network_channels
from .connected_points import ConnectedPoints
from .intensity_blocks import IntensityBlocks
from .intensity_cdf import IntensityCdf
from .iso_value import edge_strength_at
from .point_places import PointPlaces
from .stable_components import StableComponents

EDGE_STEP_CELLS = 1 / 3
"""Distance over which intensity differences are taken as edges, in cells."""
ISO_CELLS = 100_000
"""The iso value is chosen from at most this many cells, chosen at random: more would only take longer."""


class CellIntensities:
    """A volume's intensities on the grid of its feature cells.

    Args:
        volume: the volume.
        cells: the grid of the feature cells, which covers the volume's box.

    Attributes:
        cells: the same.
        centres_ras: centres of all cells, (cells, 3) RAS millimetres.
        drawn: indices of all cells in a fixed random order, (cells,).
        cdf: the cumulative distribution of the volume's intensities.
        cdf_of_cells: its value around each cell, (cells,) float32.
        connected: the connectedness of annotated points with all cells, by intensities.
        point_places: where features represent annotated points best.
        iso_cells: indices of the cells from which iso values are chosen, (N,), ascending.
        edge_strength: edge strength at these cells, (N,) float32.
        components: the components around annotated points that intensities suggest, at `iso_cells` or at all cells.
    """

    def __init__(self, volume: Volume, cells: Geometry) -> None:
        self.cells = cells
        # In a second thread, because both this and the rest read all voxels.
        with ThreadPoolExecutor(1) as beside:
            in_blocks = beside.submit(_in_blocks, volume, cells)
            self.centres_ras = cells.voxel_centres_ras()
            self.drawn = _drawn(cells)
            self.cdf = IntensityCdf(volume)
            self.cdf_of_cells = self.cdf.around_cells(cells)
            self.iso_cells = np.sort(self.drawn[:ISO_CELLS])
            axes_ras = cells.ijk_to_ras[:3, :3].T / cells.spacing_mm[:, None]
            steps_ras = EDGE_STEP_CELLS * cells.spacing_mm.min() * axes_ras
            self.edge_strength = edge_strength_at(self.cdf, self.centres_ras[self.iso_cells], steps_ras)
            blocks, self.connected = in_blocks.result()
        self.point_places = PointPlaces(blocks)
        count_body = partial(_cells_of_body, blocks, volume)
        self.components = StableComponents(blocks.cell_units(), cells, self.iso_cells, count_body)

    def are_of(self, cells: Geometry) -> bool:
        """Whether these are intensities on this grid of cells."""
        return self.cells.shape == cells.shape and np.array_equal(self.cells.ijk_to_ras, cells.ijk_to_ras)

    def cells_at(self, points_ras: np.ndarray) -> np.ndarray:
        """Indices of the cells that contain the points (P, 3), or of the nearest ones, (P,)."""
        indices: np.ndarray = np.ravel_multi_index(tuple(self.cells.nearest_voxels(points_ras).T), self.cells.shape)
        return indices


def _in_blocks(volume: Volume, cells: Geometry) -> tuple[IntensityBlocks, ConnectedPoints]:
    make = partial(IntensityBlocks, volume, cells, display_window(volume))
    blocks = make()
    return blocks, ConnectedPoints(blocks, partial(make, 1))


def _cells_of_body(blocks: IntensityBlocks, volume: Volume) -> int:
    """Number of cells that do not belong to the background around the body, by their mean intensities."""
    means = blocks.cell_means()
    return int(np.count_nonzero(~background_cells(means, network_channels(volume).background, means.shape)))


def _drawn(cells: Geometry) -> np.ndarray:
    """All cells (cells,) in a random order, which does not depend on the axis order in which the scan is stored."""
    indices = np.arange(int(np.prod(cells.shape))).reshape(cells.shape)
    indices = canonical_orientation(cells).to_canonical(indices)
    drawn: np.ndarray = np.random.default_rng(0).permutation(indices.ravel())
    return drawn
