"""A coarse picture of a scan and of where it lies, by which points know the scan that they were placed on.

Scans are compared by what they show: in another format, with other units, smoothed, cropped or resampled, a scan is still the
same, and its points are where they were. Another patient's is not, even if it has the same grid.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass

import numpy as np

from ..system.given_numbers import FARTHEST
from .geometry import Geometry

CELLS = 10
"""Along each edge: of some 4 cm in the trunk of a body, which show neither noise nor a face."""
SAMPLES = 3
"""Of a cell, along each edge: the voxels there, whose mean the cell shows."""
LEAST_CORRELATION = 0.95
"""Of what two scans show, if they are to be the same one. A CT of the trunk, one of the abdomen, an MR of a head, a tooth and a
tree kept 0.99 where they were smoothed by two voxels, clipped, resampled or full of noise, and 0.96 under a bias field of a
fifth either way; the trunk and the abdomen on one grid had 0.69."""
FEWEST_CELLS = 64
"""That two scans need to have in common, to be told apart: those of a part with half the edges."""

_NOTHING = 0
"""Shown by a cell that has no intensity."""


@dataclass(frozen=True, eq=False)
class Thumbnail:
    """What a scan shows, and where.

    Attributes:
        cells: (CELLS, CELLS, CELLS) uint8, along the scan's (K, J, I): from 1, the darkest, to 255; 0 for no intensity.
        geometry: of the cells.
    """

    cells: np.ndarray
    geometry: Geometry

    @staticmethod
    def of(array: np.ndarray, geometry: Geometry) -> Thumbnail:
        """The thumbnail of a scan: voxels (K, J, I), any real dtype, NaN and infinities included."""
        grid = geometry.resized((CELLS, CELLS, CELLS))
        means = _means(array, geometry, grid)
        seen = np.isfinite(means)
        cells = np.full(grid.shape, _NOTHING, dtype=np.uint8)
        if seen.any():
            darkest, range_ = means[seen].min(), np.ptp(means[seen])
            cells[seen] = np.rint(1.0 + 254.0 * (means[seen] - darkest) / (range_ or 1.0))
        return Thumbnail(cells, grid)

    def may_be_of(self, array: np.ndarray, geometry: Geometry) -> bool:
        """Whether this scan shows the same at the same places; also where it shows too little there to say no."""
        means = _means(array, geometry, self.geometry)
        common = np.isfinite(means) & (self.cells != _NOTHING)
        shown, noted = means[common], self.cells[common].astype(np.float64)
        if len(shown) < FEWEST_CELLS or np.ptp(shown) == 0.0 or np.ptp(noted) == 0.0:
            return True
        return bool(np.corrcoef(shown, noted)[0, 1] >= LEAST_CORRELATION)

    def to_text(self) -> str:
        """As one line of ASCII."""
        place = ",".join(f"{number:.9g}" for number in self.geometry.ijk_to_ras[:3].ravel())
        return f"{place} {base64.b64encode(self.cells.tobytes()).decode()}"

    @staticmethod
    def from_text(text: str) -> Thumbnail | None:
        """What `to_text` wrote; None for another text."""
        place, _, cells = text.partition(" ")
        try:
            ijk_to_ras = np.vstack([np.array(place.split(","), dtype=np.float64).reshape(3, 4), np.eye(4)[3:]])
            shape = CELLS, CELLS, CELLS
            array = np.frombuffer(base64.b64decode(cells, validate=True), dtype=np.uint8).reshape(shape)
            # Beyond that, nothing can be computed with it; NaN is refused as well.
            return Thumbnail(array, Geometry(shape, ijk_to_ras)) if np.abs(ijk_to_ras).max() < FARTHEST else None
        except ValueError:
            return None


def _means(array: np.ndarray, geometry: Geometry, grid: Geometry) -> np.ndarray:
    """What a scan shows in the cells of a grid, (CELLS, CELLS, CELLS); NaN in those that it does not fill."""
    samples = grid.resized((CELLS * SAMPLES,) * 3).voxel_centres_ras()
    inside = geometry.contains(samples)
    k, j, i = geometry.nearest_voxels(samples[inside]).T
    values = np.full(len(samples), np.nan)
    values[inside] = array[k, j, i]
    values[~(np.abs(values) <= np.finfo(np.float32).max)] = np.nan
    cells: np.ndarray = values.reshape(CELLS, SAMPLES, CELLS, SAMPLES, CELLS, SAMPLES).mean(axis=(1, 3, 5))
    return cells
