"""Regular voxel grids in patient space, and conversions of points between voxel and world coordinates.

Conventions: world coordinates are RAS millimetres, voxel coordinates are continuous (i, j, k) with integers at voxel centres;
arrays are indexed (k, j, i).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LPS_TO_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
"""Converts LPS coordinates to RAS, and RAS to LPS: it mirrors the first two axes."""

FLATTEST_AXES = 1e-6
"""Least volume spanned by unit vectors along the axes; smaller ones are due to rounding to single precision in files."""

SMALL_SCAN_MM = 64.0
"""If the longest edge of a scan is shorter, lengths that suit human bodies are reduced in proportion, since they would be a
large part of what a microscope shows. They stay the same in scans of parts of bodies, such as a breast of 80 mm."""

OFF_BORDERS = 1e-3
"""Distance by which points are moved off borders, in voxels or parts of voxels: larger than rounding when points are saved."""

Box = tuple[slice, slice, slice]
"""A part of a grid: ranges of k, j and i, each with a start and an end."""


@dataclass(frozen=True, eq=False)
class Geometry:
    """A regular voxel grid: oblique, anisotropic and left-handed grids included.

    Attributes:
        shape: number of voxels along (K, J, I).
        ijk_to_ras: (4, 4) float64, homogeneous; maps voxel coordinates to RAS millimetres. For a scan in a scene, these are in
            the scan's own frame, without the scene's transforms.

    Raises:
        ValueError: the matrix has another shape, or is not finite and invertible.
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
        """Edge lengths of the grid's box, to the outer faces of voxels, along (I, J, K), (3,) float64, millimetres."""
        extent: np.ndarray = self.spacing_mm * self.shape[::-1]
        return extent

    @property
    def body_scale(self) -> float:
        """The factor of `body_scale` if this is the grid of a whole scan."""
        return body_scale(float(self.extent_mm.max()))

    @property
    def voxel_volume_mm3(self) -> float:
        """Volume of one voxel in cubic millimetres, also for sheared axes."""
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
        """Indices (K, J, I) of the voxel that contains each world point (N, 3), RAS millimetres, or of the nearest one; (N, 3).

        Args:
            points_ras: points inside or outside the grid.
            parts: number of parts of a voxel along each axis; if more than 1, the indices are those of parts.
        """
        places = np.floor((self.off_borders(points_ras, parts) + 0.5) * parts).astype(int)
        nearest: np.ndarray = np.clip(places, 0, parts * np.array(self.shape) - 1)
        return nearest

    def off_borders(self, points_ras: np.ndarray, parts: int = 1) -> np.ndarray:
        """Continuous voxel coordinates (N, 3) along (K, J, I) of world points (N, 3), each moved slightly off voxel borders.

        If the number of slices is odd, the middle one, which viewers show first, may run along a border of cells. A click there
        belongs to the cell to the right, anterior or superior, so that the choice depends neither on rounding errors nor on the
        order in which the scan is stored.

        Args:
            points_ras: points inside or outside the grid, RAS millimetres.
            parts: number of parts of a voxel along each axis: points are moved off the borders of parts, by a smaller distance.
        """
        moved: np.ndarray = self.ras_to_ijk(points_ras)[:, ::-1] + OFF_BORDERS / parts * self._towards_ras[::-1]
        return moved

    @property
    def _towards_ras(self) -> np.ndarray:
        """For each of the axes (I, J, K): 1 if its main direction is right, anterior or superior, otherwise −1.

        In strongly oblique grids, two axes may have the same main direction, unlike in `canonical_orientation`.
        """
        axes = self.ijk_to_ras[:3, :3]
        signs: np.ndarray = np.sign(np.take_along_axis(axes, np.abs(axes).argmax(axis=0)[None], axis=0)[0])
        return signs

    def resized(self, shape: tuple[int, int, int]) -> Geometry:
        """The grid of `shape` (K, J, I) that fills the same box; outer cell borders lie on the box's faces."""
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
    """The factor for lengths that suit human bodies in a scan with this longest edge: 1, or less in a small scan."""
    return min(longest_edge_mm / SMALL_SCAN_MM, 1.0)


def _are_in_one_plane(axes: np.ndarray) -> bool:
    """Whether three vectors, the columns (3, 3), do not span space, regardless of their lengths."""
    lengths = np.linalg.norm(axes, axis=0)
    return bool(lengths.min() == 0.0 or abs(np.linalg.det(axes / lengths)) < FLATTEST_AXES)


def transform_points(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Apply a homogeneous (4, 4) matrix to points (N, 3)."""
    x, y, z = np.asarray(points, dtype=np.float64).reshape(-1, 3).T
    # A matrix product takes several times as long for such narrow matrices.
    return np.stack([row[0] * x + row[1] * y + row[2] * z + row[3] for row in matrix[:3]], axis=1)
