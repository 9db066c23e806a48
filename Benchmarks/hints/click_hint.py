"""Where a further click would tell most about a class.

A click changes labels around it where the map is close to the iso value, and teaches little next to a place that was clicked
already. So each cell is worth

    v(x) = exp(−ln(S(x) / iso)² / 2w²) · (1 − exp(−d(x)² / 2r²)),

with d its distance from the nearest point of any class. What counts is the region that a click can change, so v is averaged
over neighbouring cells.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from ViTTransferFunction.Logic.core.class_request import ClassRequest
from ViTTransferFunction.Logic.core.geometry import Geometry

UNDECIDED_WIDTH = 0.5
"""w: a map that exceeds its iso value by a factor of e^w is fairly sure."""
TOLD_SHARE = 0.04
"""r, as a share of the volume's longest edge: how far a point tells what is around it."""
REGION_CELLS = 1.5
"""Standard deviation of the average over neighbouring cells."""
_LOWEST = 1e-3


def click_hint(similarity: np.ndarray, iso: float, geometry: Geometry, classes: Sequence[ClassRequest]) -> np.ndarray:
    """The place to click next for a class: undecided, large, and away from all that was clicked.

    Args:
        similarity: the class's S_L, (K', J', I') in [0, 1].
        iso: its iso value.
        geometry: of the cells.
        classes: all that is annotated, at least one point.

    Returns:
        (3,) RAS millimetres, a cell's centre.
    """
    undecided = np.exp(-0.5 * (np.log(np.maximum(similarity, _LOWEST) / iso) / UNDECIDED_WIDTH) ** 2)
    points_ras = np.concatenate([points for request in classes for points in (request.positive, request.negative)])
    centres_ras = geometry.voxel_centres_ras()
    distance_mm = cKDTree(points_ras).query(centres_ras)[0].reshape(geometry.shape)
    untold = 1.0 - np.exp(-0.5 * (distance_mm / (TOLD_SHARE * geometry.extent_mm.max())) ** 2)
    worth = ndimage.gaussian_filter(undecided * untold, REGION_CELLS, mode="constant")
    return centres_ras[int(worth.argmax())]
