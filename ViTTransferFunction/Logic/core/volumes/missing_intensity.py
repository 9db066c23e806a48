"""Points where a scan has no intensity: it was masked, say, and nothing can be similar to what is there."""

from __future__ import annotations

import numpy as np

from .geometry import Geometry


def without_intensity(array: np.ndarray, geometry: Geometry, points_ras: np.ndarray) -> int:
    """How many points lie in a voxel that is NaN or infinite.

    Args:
        array: intensities, (K, J, I), any real dtype.
        geometry: of its voxels.
        points_ras: (N, 3) RAS millimetres, in the grid.
    """
    if not np.issubdtype(array.dtype, np.floating):
        return 0
    k, j, i = geometry.nearest_voxels(points_ras).T
    return int(np.count_nonzero(~np.isfinite(array[k, j, i])))


def without_intensity_text(count: int) -> str:
    """What to tell the user of so many points inside a structure; whoever tells it names the structure before."""
    if count == 1:
        return "1 point inside lies where the scan has no intensity (NaN or infinite). Move it onto the structure."
    return f"{count} points inside lie where the scan has no intensity (NaN or infinite). Move them onto the structure."
