"""Maps of segments that are masks: smooth, as far as they still select the masks' voxels.

What is drawn is what is saved: a map reaches its iso value, `ISO`, at the voxels of its mask and nowhere else. Between them it
crosses it where a smooth surface would. What only roughens a surface, by no more than a voxel, is evened out: single voxels
that stand out from an organ, or are missing in it, are a scan's noise. What is thin, or stands by itself, is drawn as it is.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_dilation, binary_erosion, correlate1d, distance_transform_edt, gaussian_filter, label

from ..core.volumes.bounding_box import bounding_box

ISO = 0.5
"""The value of every such map at the surface."""

REACH_VOXELS = 2.0
"""Distance from the surface at which maps reach 0 and 1, in voxels along the coarsest axis."""

SMOOTHING_VOXELS = 0.8
SMOOTHING_OF_COARSEST_VOXEL = 0.3
"""How far signed distances are smoothed: in voxels, and at least in sizes of a thick slice, from one to the next of which
borders jump."""

LEAST_HEIGHT, MOST_LIFTED = 0.03, 0.1
"""Heights over the surface, in voxels along the finest axis, to which voxels are lifted that smoothing took below the first:
LEAST_HEIGHT for those just below it, up to MOST_LIFTED for those far below."""

SHOWN_FROM_NEIGHBOURS = (1 / 18, 1 / 9)
"""Weight of each of a voxel's two neighbours along an axis in its interpolated value: at its centre, and half-way to a border.
Renderers sample thick slices near their centres, others half-way to the border."""

LIFTS = 4
LIFT_GAIN = 1.4
"""Number of times that voxels are lifted, and the factor by which each lift exceeds what is missing: neighbours on the other
side pull them down again."""


def mask_map(mask: np.ndarray, spacing_mm: np.ndarray, similarity: np.ndarray | None = None, iso: float = ISO) -> np.ndarray:
    """A map that is at least `ISO` where a mask is True and nowhere else, with as smooth a surface as that leaves room for.

    Signed distances from the mask's border are smoothed. Voxels that this takes to the other side of the surface are put back,
    so far that interpolation leaves them there: thin parts are lost otherwise. Only roughness of the surface is not put back.

    Args:
        mask: (K, J, I) bool.
        spacing_mm: (3,) distance between voxels along I, J, K.
        similarity: (K, J, I), any real numbers; where given, the surface between the voxels is where they cross `iso`, and
            every voxel is on its side.
        iso: for `similarity`.

    Returns:
        (K, J, I) uint8, 255 for 1; at least 128 in the mask, at most 127 elsewhere, but for its surface's roughness.
    """
    result = np.zeros(mask.shape, dtype=np.uint8)
    spacing = np.asarray(spacing_mm, dtype=float)[::-1]
    reach_mm = REACH_VOXELS * float(spacing.max())
    box = bounding_box(mask, np.ceil(reach_mm / spacing).astype(int).tolist())
    if box is None:
        return result
    inside = mask[box]
    heights_mm = _smooth_heights(inside, spacing, reach_mm)
    if similarity is None:
        inside = _evened(inside, heights_mm > 0.0, spacing)
    else:
        by_similarity = _heights_over_iso(similarity[box], iso, inside, spacing)
        # From a voxel's distance on, only the mask says how far away it is: it may leave out a part of the similarity map.
        limit_mm = 3.0 * heights_mm + 2.0 * float(spacing.max())
        heights_mm = np.where(inside, by_similarity, np.minimum(by_similarity, limit_mm))
    kept_mm = _kept_on_their_side(heights_mm, inside, spacing)
    values = np.rint(np.clip(127.5 + 127.5 / reach_mm * kept_mm, 0.0, 255.0))
    result[box] = np.where(inside, np.maximum(values, 128.0), np.minimum(values, 127.0))
    return result


def _smooth_heights(mask: np.ndarray, spacing: np.ndarray, reach_mm: float) -> np.ndarray:
    """Signed distances from the mask's border (negative: outside) in millimetres, at most `reach_mm`, smoothed, float32."""
    if mask.all():
        return np.full(mask.shape, reach_mm, dtype=np.float32)
    distance = distance_transform_edt(mask, sampling=spacing) - distance_transform_edt(~mask, sampling=spacing)
    sigmas = np.maximum(SMOOTHING_VOXELS, SMOOTHING_OF_COARSEST_VOXEL * spacing.max() / spacing)
    smooth: np.ndarray = gaussian_filter(np.clip(distance, -reach_mm, reach_mm).astype(np.float32), sigmas, truncate=3.0)
    return smooth


def _evened(mask: np.ndarray, smooth: np.ndarray, spacing: np.ndarray) -> np.ndarray:
    """A mask where what smoothing takes away or adds is as `smooth` has it, if it lies within a voxel of what stays."""
    steps = np.moveaxis(np.indices((3, 3, 3)), 0, -1) - 1
    # A voxel of the finest spacing: not a thick slice.
    within = np.linalg.norm(steps * spacing, axis=-1) <= 1.01 * np.sqrt(3.0) * spacing.min()
    result: np.ndarray = mask.copy()
    for side in (mask, ~mask):
        same = side & (smooth == mask)
        parts, count = label(side & ~same)
        standing_out = np.zeros(count + 1, dtype=bool)
        standing_out[parts[~binary_dilation(same, within)]] = True
        standing_out[0] = True
        result ^= ~standing_out[parts]
    return result


def _heights_over_iso(similarity: np.ndarray, iso: float, mask: np.ndarray, spacing: np.ndarray) -> np.ndarray:
    """How far similarities are above `iso`, in millimetres at the slope that they typically have at the mask's border."""
    similarity = similarity.astype(np.float32)
    slope = np.sqrt(sum(component**2 for component in np.gradient(similarity, *spacing)))
    typical = float(np.median(slope[mask & ~binary_erosion(mask)]))
    heights: np.ndarray = gaussian_filter((similarity - iso) / max(typical, 1e-6), 0.5)
    return heights


def _kept_on_their_side(heights: np.ndarray, mask: np.ndarray, spacing: np.ndarray) -> np.ndarray:
    """Heights, positive in the mask and negative elsewhere, also after interpolation; all in millimetres."""
    unit = np.float32(spacing.min())
    side = np.where(mask, np.float32(1.0), np.float32(-1.0))
    own = side * heights / unit
    least = np.minimum(2.0 * LEAST_HEIGHT - own, MOST_LIFTED)
    np.maximum(own, least, out=own)
    shares = np.clip(SHOWN_FROM_NEIGHBOURS[1] * unit / spacing, *SHOWN_FROM_NEIGHBOURS)
    for _ in range(LIFTS):
        shown = side * own
        for axis, share in enumerate(shares):
            correlate1d(shown, [share, 1.0 - 2.0 * share, share], axis=axis, output=shown, mode="nearest")
        own += LIFT_GAIN * np.maximum(least - side * shown, 0.0)
    kept: np.ndarray = side * own * unit
    return kept
