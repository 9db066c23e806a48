"""Classes where their maps and the intensities say, in one volume of structures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter1d

from ..core.system.progress import Progress, no_progress
from ..core.volumes.intensity_window import IntensityWindow
from .class_membership import Map, Shape, finest_shape, memberships, nearest_voxels
from .composition import COMPOSING, Composition, shape_within_budget
from .lookup import looked_up
from .smoothing import binomial, smoothed

CERTAIN, DOUBTFUL = 200, 55
"""Memberships from which on, and up to which, a voxel's intensity is taken as typical of the class and of what surrounds it."""


def transfer_function_volume(
    intensities: np.ndarray,
    window: IntensityWindow,
    maps: Sequence[Map],
    isos: Sequence[float],
    shape: Shape | None = None,
    progress: Progress = no_progress,
) -> Composition:
    """The volume itself: every class where its map and the intensities say.

    A class's map says roughly where it is. How much more frequent an intensity is within it than around it then decides, voxel
    by voxel (Bayes' theorem): surfaces follow the intensities where these tell the class from its surroundings, and the map
    where they do not.

    Args:
        intensities: (K, J, I), the volume's voxels, of any real dtype.
        window: intensities outside it are not told apart.
        maps: as for `similarity_volume`; they fill the volume's box.
        isos: for each map, the value at its surface, in (0, 1).
        shape: (K', J', I') of the result, which fills the box of the volume; None: that of the volume, within budget.
        progress: called with classes done; may raise `Cancelled`.
    """
    shape = shape or shape_within_budget(intensities.shape)
    gray = _gray(nearest_voxels(intensities, shape), window)
    even_gray = (binomial(np.pad(gray, 1, mode="edge"), passes=1) >> np.uint16(4)).astype(np.uint8)
    composition = Composition(shape, len(maps))
    # Wide enough for intensities to have a say, also where cells are large.
    cell_voxels = max(n / cells for n, cells in zip(shape, finest_shape(maps), strict=True))
    softness = [2.0 * max(cell_voxels, 1.0)] * len(maps)
    for done, (index, membership) in enumerate(memberships(maps, isos, shape, softness)):
        progress(done, len(maps), COMPOSING)
        posterior = _posterior(membership.values, even_gray[membership.box])
        composition.add(membership.box, index, smoothed(posterior, passes=1))
    return composition


def _gray(intensities: np.ndarray, window: IntensityWindow) -> np.ndarray:
    """Intensities as gray levels, (K, J, I) uint8."""
    if intensities.dtype in (np.int16, np.uint16):
        # Each of the values once, not each of the voxels.
        values = np.arange(65536, dtype=np.uint16).view(intensities.dtype)
        return looked_up(np.rint(255.0 * window.apply(values)).astype(np.uint8), intensities.view(np.uint16))
    return np.rint(255.0 * window.apply(intensities)).astype(np.uint8)


def _posterior(prior: np.ndarray, gray: np.ndarray) -> np.ndarray:
    """Memberships (k, j, i) uint8 after a look at the intensities, from those before and gray levels, uint8 both."""
    likelihood = np.log(_frequencies(gray[prior >= CERTAIN]) / _frequencies(gray[prior <= DOUBTFUL]))
    share = np.clip(np.arange(256) / 255.0, 0.004, 0.996)
    odds = np.log(share / (1.0 - share))
    # Where the map denies the class, intensities alone do not make it.
    possible = np.minimum(np.arange(256) / 26.0, 1.0)
    table = 255.0 * possible[:, None] / (1.0 + np.exp(-odds[:, None] - np.clip(likelihood, -4.0, 4.0)))
    return looked_up(np.rint(table).astype(np.uint8).ravel(), (prior.astype(np.uint16) << np.uint16(8)) | gray)


def _frequencies(gray: np.ndarray) -> np.ndarray:
    """How frequent each gray level is, (256,), evened out so that few voxels will do."""
    counts = gaussian_filter1d(np.bincount(gray, minlength=256).astype(float), sigma=5.0)
    frequencies: np.ndarray = counts / max(counts.sum(), 1.0) + 2e-4
    return frequencies
