"""Regular voxel grids in patient space, and the points that lie on them.

One convention everywhere below: world coordinates are RAS millimetres, voxel coordinates are continuous (i, j, k) with integers
at voxel centres, arrays are indexed (k, j, i).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LPS_TO_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
"""Flips the first two axes; its own inverse."""

FLATTEST_AXES = 1e-6
"""Volume between unit vectors along the axes: of less, nothing is left but what matrices lose in files of single precision."""

SMALL_SCAN_MM = 64.0
"""Where the longest edge of a scan is shorter, lengths that are meant for bodies are so, too, in proportion: they would be a
large part of what is imaged by a microscope. Parts of bodies, such as a breast of 80 mm, are to keep them."""

OFF_BORDERS = 1e-3
"""By how much of a voxel, or of a part of one, points are moved off borders: more than they change by being saved and read."""

Box = tuple[slice, slice, slice]
"""A part of a grid: ranges of k, j and i, each with a start and an end."""


@dataclass(frozen=True, eq=False)
class Geometry:
    """A regular voxel grid: oblique, anisotropic and left-handed grids included.

    Attributes:
        shape: number of voxels along (K, J, I).
        ijk_to_ras: (4, 4) float64, homogeneous; maps voxel centres to RAS millimetres. Of a scan in a scene, in
            the scan's own frame: the transforms that it is under there are not in it.

    Raises:
        ValueError: the matrix is not finite and invertible.
    """

    shape: tuple[int, int, int]
    ijk_to_ras: np.ndarray

    def __post_init__(self) -> None:
        matrix = np.array(self.ijk_to_ras, dtype=np.float64)
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all() or _are_in_one_plane(matrix[:3, :3]):
            raise ValueError(f"expected a finite, invertible 4×4 IJK-to-RAS matrix, got\n{matrix}")
        matrix.setflags(write=False)
        object.__setattr__(self, "ijk_to_ras", matrix)
        object.__setattr__(self, "shape", tuple(int(n) for n in self.shape))

    @property
    def spacing_mm(self) -> np.ndarray:
        """Distance between voxel centres along (I, J, K), (3,) float64, millimetres."""
        spacing: np.ndarray = np.linalg.norm(self.ijk_to_ras[:3, :3], axis=0)
        return spacing

    @property
    def extent_mm(self) -> np.ndarray:
        """Edge lengths of the grid's box, voxels' own width included, along (I, J, K), (3,) float64, millimetres."""
        extent: np.ndarray = self.spacing_mm * self.shape[::-1]
        return extent

    @property
    def body_scale(self) -> float:
        """By what lengths that are meant for bodies are multiplied in this grid, all of a scan; see `body_scale`."""
        return body_scale(float(self.extent_mm.max()))

    @property
    def voxel_volume_mm3(self) -> float:
        """Volume of one voxel in cubic millimetres, also where the axes are sheared."""
        return float(abs(np.linalg.det(self.ijk_to_ras[:3, :3])))

    def ras_to_ijk(self, points_ras: np.ndarray) -> np.ndarray:
        """Continuous voxel coordinates (N, 3) as (i, j, k) of world points (N, 3) in RAS millimetres."""
        return transform_points(np.linalg.inv(self.ijk_to_ras), points_ras)

    def ijk_to_ras_points(self, points_ijk: np.ndarray) -> np.ndarray:
        """World points (N, 3) in RAS millimetres of continuous voxel coordinates (N, 3) as (i, j, k)."""
        return transform_points(self.ijk_to_ras, points_ijk)

    def voxel_centres_ras(self) -> np.ndarray:
        """World positions of all voxels, (N, 3) RAS millimetres, in the order of a flattened (K, J, I) array."""
        return self.ijk_to_ras_points(np.indices(self.shape).reshape(3, -1).T[:, ::-1])

    def contains(self, points_ras: np.ndarray) -> np.ndarray:
        """(N,) bool: whether world points lie within the grid's box, the outer half of border voxels included."""
        ijk = self.ras_to_ijk(points_ras)
        # A point that was rounded to the box's face when it was saved is still a point of this volume.
        tolerance = 1e-3
        inside = (ijk >= -0.5 - tolerance) & (ijk <= np.array(self.shape[::-1]) - 0.5 + tolerance)
        contained: np.ndarray = np.all(inside, axis=1)
        return contained

    def nearest_voxels(self, points_ras: np.ndarray, parts: int = 1) -> np.ndarray:
        """The voxel that holds each world point (N, 3) in RAS millimetres, or the nearest: its index along (K, J, I), (N, 3).

        Args:
            points_ras: any, also beyond the grid.
            parts: that each voxel is cut into along each axis; more than 1 gives indices of these instead.
        """
        places = np.floor((self.off_borders(points_ras, parts) + 0.5) * parts).astype(int)
        nearest: np.ndarray = np.clip(places, 0, parts * np.array(self.shape) - 1)
        return nearest

    def off_borders(self, points_ras: np.ndarray, parts: int = 1) -> np.ndarray:
        """Continuous voxel coordinates (N, 3) along (K, J, I) of world points (N, 3), each moved slightly off voxel borders.

        Where the number of slices is odd, the middle one, which viewers show first, may run along a border of cells. Which cell
        a click there belongs to must not depend on rounding errors, nor on the order in which the scan is stored: it is the
        one to the right, anterior or superior.

        Args:
            points_ras: any, also beyond the grid.
            parts: that each voxel is cut into along each axis: points are moved off these parts' borders, and by less.
        """
        moved: np.ndarray = self.ras_to_ijk(points_ras)[:, ::-1] + OFF_BORDERS / parts * self._towards_ras[::-1]
        return moved

    @property
    def _towards_ras(self) -> np.ndarray:
        """For each of the axes (I, J, K): 1 if it runs to the right, anterior or superior, mostly; otherwise −1."""
        axes = self.ijk_to_ras[:3, :3]
        signs: np.ndarray = np.sign(np.take_along_axis(axes, np.abs(axes).argmax(axis=0)[None], axis=0)[0])
        return signs

    def resized(self, shape: tuple[int, int, int]) -> Geometry:
        """The grid of `shape` (K, J, I) that fills the same box: cell borders coincide at the box's faces."""
        scale = np.array(self.shape[::-1], dtype=np.float64) / np.array(shape[::-1], dtype=np.float64)
        # Box corner at voxel coordinate -0.5 on either grid.
        coarse_to_fine = np.diag([*scale, 1.0])
        coarse_to_fine[:3, 3] = 0.5 * scale - 0.5
        return Geometry(shape, self.ijk_to_ras @ coarse_to_fine)

    def part(self, box: Box) -> Geometry:
        """The grid of the voxels within `box`."""
        shift = np.eye(4)
        shift[:3, 3] = [extent.start for extent in reversed(box)]
        k, j, i = (extent.stop - extent.start for extent in box)
        return Geometry((k, j, i), self.ijk_to_ras @ shift)


def body_scale(longest_edge_mm: float) -> float:
    """By what lengths that are meant for bodies are multiplied in a scan with this longest edge: 1, or less in a small one."""
    return min(longest_edge_mm / SMALL_SCAN_MM, 1.0)


def _are_in_one_plane(axes: np.ndarray) -> bool:
    """Whether three vectors, the columns (3, 3), do not span space, however long they are."""
    lengths = np.linalg.norm(axes, axis=0)
    return bool(lengths.min() == 0.0 or abs(np.linalg.det(axes / lengths)) < FLATTEST_AXES)


def transform_points(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Apply a homogeneous (4, 4) matrix to points (N, 3)."""
    x, y, z = np.asarray(points, dtype=np.float64).reshape(-1, 3).T
    # A product of matrices takes several times as long where they are so narrow.
    return np.stack([row[0] * x + row[1] * y + row[2] * z + row[3] for row in matrix[:3]], axis=1)
