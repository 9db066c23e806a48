"""What clicks need to know of a volume's intensities on its feature cells, whatever the features are, coarser or finer ones."""

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
"""Distance over which intensity differences count as an edge, in cells."""
ISO_CELLS = 100_000
"""The iso value is chosen from at most this many cells, spread evenly: more would only take longer."""


class CellIntensities:
    """Intensities of a volume's cells.

    Args:
        volume: the intensities.
        cells: the feature cells, which fill the volume's box.

    Attributes:
        centres_ras: of all cells, (cells, 3) RAS millimetres.
        drawn: all cells, in a random order that is always the same.
        cdf: of the volume's intensities.
        cdf_of_cells: around each cell, (cells,) float32.
        connected: how annotated points are, by intensities.
        point_places: where annotated points are looked at.
        iso_cells: some cells, (N,), in order.
        edge_strength: of those, (N,) float32.
        components: around annotated points, at those or all.
    """

    def __init__(self, volume: Volume, cells: Geometry) -> None:
        self._cells = cells
        # Looks at all voxels, as the rest does: beside it, where there is a second processor.
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
        """Whether these are the cells."""
        mine = self._cells
        return mine.shape == cells.shape and np.array_equal(mine.ijk_to_ras, cells.ijk_to_ras)


def _in_blocks(volume: Volume, cells: Geometry) -> tuple[IntensityBlocks, ConnectedPoints]:
    make = partial(IntensityBlocks, volume, cells, display_window(volume))
    blocks = make()
    return blocks, ConnectedPoints(blocks, partial(make, 1))


def _cells_of_body(blocks: IntensityBlocks, volume: Volume) -> int:
    """How many cells hold more than the background around the body, by their mean intensities."""
    means = blocks.cell_means()
    return int(np.count_nonzero(~background_cells(means, network_channels(volume).background, means.shape)))


def _drawn(cells: Geometry) -> np.ndarray:
    """All cells (cells,) in a random order: the same cells also where the scan is stored another way, for the same maps."""
    indices = np.arange(int(np.prod(cells.shape))).reshape(cells.shape)
    indices = canonical_orientation(cells).to_canonical(indices)
    drawn: np.ndarray = np.random.default_rng(0).permutation(indices.ravel())
    return drawn
