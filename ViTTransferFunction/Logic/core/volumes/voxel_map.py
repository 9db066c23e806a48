"""A class's map at a volume's resolution, S_H, of which only the part near the structure is held in memory.

As one array, the map of a large volume would take twice as much memory as the volume, and that of a small one would take longer
to fill than most structures take to refine. Away from the structure, the map is interpolated S_L, which is computed on demand.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from .bounding_box import bounding_box, common_box, common_part, covering_box, whole_box, within
from .geometry import Box, Geometry
from .orientation import Orientation
from .resampling import FixedPlaces, corners_around

ROUNDING = 1e-6
"""Relative rounding error by which an interpolated value may exceed those it was interpolated from."""


@dataclass(frozen=True, eq=False)
class VoxelMap:
    """A map (K, J, I) float32 in [0, 1].

    Attributes:
        shape: shape of the volume, (K, J, I).
        coarse: S_L, (K', J', I') float32, on cells that fill the volume's box.
        interpolated: returns interpolated S_L for a slice k and a range of its rows, (rows, I) float32.
        box: the voxels that are held in memory.
        held: their values, (K, J, I) of the box; all other voxels have interpolated values.
        refined: the part of the box in which values may differ from interpolated ones; None: all of it.
    """

    shape: tuple[int, int, int]
    coarse: np.ndarray
    interpolated: Callable[[int, slice], np.ndarray]
    box: Box
    held: np.ndarray
    refined: Box | None = None

    @classmethod
    def whole(cls, array: np.ndarray) -> VoxelMap:
        """A map all of which is held, from an array (K, J, I) float32."""
        k, j, i = array.shape
        return cls((k, j, i), array, lambda k, rows: array[k, rows], whole_box((k, j, i)), array)

    def placed(self, shape: tuple[int, int, int], box: Box) -> VoxelMap:
        """The same map as a part of a larger volume of `shape` (K, J, I), in which it fills `box`; 0 elsewhere."""
        nothing = np.zeros((1, 1, 1), dtype=np.float32)
        rows = partial(_no_rows, columns=shape[2])
        return VoxelMap(shape, nothing, rows, box, self.array)

    def changed_in(self, box: Box) -> VoxelMap:
        """The same map after its `held` values have been changed in a box, which must be within the held one."""
        return replace(self, refined=common_box([self._refined_box, box]))

    @property
    def _refined_box(self) -> Box:
        return self.box if self.refined is None else self.refined

    @property
    def array(self) -> np.ndarray:
        """The map as one array, (K, J, I) float32. For small volumes only, unless there is no other way."""
        return self.part(whole_box(self.shape))

    def part(self, box: Box) -> np.ndarray:
        """The values in a box, (K, J, I) float32, which must not be changed."""
        inside = common_part(box, self.box)
        if inside == box:
            return self.held[within(box, self.box)]
        k, j, i = box
        part = np.empty([extent.stop - extent.start for extent in box], dtype=np.float32)
        for plane, index in zip(part, range(k.start, k.stop), strict=True):
            plane[...] = self.interpolated(index, j)[:, i]
        if inside is not None:
            part[within(inside, box)] = self.held[within(inside, self.box)]
        return part

    def box_above(self, similarity: float) -> Box | None:
        """A box that contains all voxels of at least `similarity`, though perhaps none; None if there certainly are none."""
        refined = self._refined_box
        boxes = [refined] if all(extent.start < extent.stop for extent in refined) else []
        if refined != whole_box(self.shape):
            # One cell more on every side, since voxels lie between the centres of cells.
            cells = bounding_box(self.coarse >= similarity * (1.0 - ROUNDING), margin=1)
            boxes += [] if cells is None else [covering_box(cells, self.coarse.shape, self.shape)]
        return common_box(boxes) if boxes else None

    def at(self, geometry: Geometry, points_ras: np.ndarray) -> np.ndarray:
        """Trilinear samples at world points (N, 3), RAS millimetres, (N,) float32: those of `sample_at` on the whole array.

        Args:
            geometry: geometry of the volume.
            points_ras: the points; beyond the outermost voxel centres, the map is constant.
        """
        samples = np.zeros(len(points_ras), dtype=np.float64)
        corners = list(corners_around(geometry, points_ras))
        values = self._at_voxels(np.concatenate([index for index, _ in corners])).reshape(len(corners), -1)
        for (_, weight), at_corner in zip(corners, values, strict=True):
            samples += weight * at_corner
        return samples.astype(np.float32)

    def at_cells(self, cells: np.ndarray, centres: FixedPlaces) -> np.ndarray:
        """The map at the centres of cells, (N,) float32: as `at` where it is held, elsewhere S_L itself.

        Args:
            cells: (N,) indices of the flattened cells.
            centres: the centres of these cells in the volume's grid.
        """
        return centres.sample(self.held, self.box, self.coarse.ravel()[cells])

    def spread(self, most: int, orientation: Orientation) -> Iterator[tuple[np.ndarray, float]]:
        """Values spread evenly over the map, and the number of voxels that each value represents.

        These are some of the held voxels (`Orientation.spread`), and the cells elsewhere.

        Args:
            most: the most voxels to use of the held ones.
            orientation: orientation of the volume.

        Yields:
            Values, (N,) float32, and the number of voxels that each of them represents.
        """
        if self.held.size:
            some = orientation.spread(self.held, most).ravel()
            yield some, self.held.size / some.size
        if self.box != whole_box(self.shape):
            elsewhere = np.ones(self.coarse.shape, dtype=bool)
            elsewhere[self._cells_held] = False
            yield self.coarse[elsewhere], math.prod(self.shape) / self.coarse.size

    @property
    def _cells_held(self) -> Box:
        """The cells whose centres lie in the held box."""
        k, j, i = (
            slice(*(min(max(math.ceil(end * cells / voxels - 0.5), 0), cells) for end in (extent.start, extent.stop)))
            for extent, cells, voxels in zip(self.box, self.coarse.shape, self.shape, strict=True)
        )
        return k, j, i

    def _at_voxels(self, kji: np.ndarray) -> np.ndarray:
        """Values of single voxels (N, 3), (N,) float32."""
        values = np.empty(len(kji), dtype=np.float32)
        first, end = np.array([(extent.start, extent.stop) for extent in self.box]).T
        held = ((kji >= first) & (kji < end)).all(axis=1)
        values[held] = self.held[tuple((kji[held] - first).T)]
        _, rows, _ = whole_box(self.shape)
        for k in np.unique(kji[~held, 0]):
            of_slice = ~held & (kji[:, 0] == k)
            values[of_slice] = self.interpolated(int(k), rows)[kji[of_slice, 1], kji[of_slice, 2]]
        return values


def _no_rows(k: int, rows: slice, columns: int) -> np.ndarray:
    """Rows of zeros, (rows, columns) float32, for `interpolated`."""
    return np.zeros((rows.stop - rows.start, columns), dtype=np.float32)
