"""The volume itself through a transfer function for each class, as a volume of colours."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter1d

from ..core.colors import Color
from ..core.intensity_window import IntensityWindow
from ..core.progress import Progress, no_progress
from .class_membership import finest_shape, memberships, nearest_voxels
from .codes import binomial, class_codes
from .composition import COMPOSING, Composition, shape_within_budget

CERTAIN, DOUBTFUL = 200, 55
"""Memberships from which on, and up to which, a voxel's intensity is taken as typical of the class and of what surrounds it."""

DARKEST = 0.7
"""What a class's colour is multiplied with where the volume is darkest within the class; where it is brightest, it stays."""


def transfer_function_rgba(
    intensities: np.ndarray,
    window: IntensityWindow,
    maps: Sequence[np.ndarray],
    isos: Sequence[float],
    colors: Sequence[Color],
    opacities: Sequence[float],
    progress: Progress = no_progress,
) -> np.ndarray:
    """The volume itself, every class through a transfer function of its own; what belongs to no class is transparent.

    A class's map says roughly where it is. How much more frequent an intensity is within it than around it then decides, voxel
    by voxel (Bayes' theorem): surfaces follow the intensities where these tell the class from its surroundings, and the map
    where they do not. Within a class, its colour is brighter where the volume is.

    Args:
        intensities: (K, J, I), the volume's voxels, of any real dtype.
        window: intensities outside it are not told apart.
        maps: as for `similarity_rgba`; they fill the volume's box.
        isos: for each map, the value at its surface, in (0, 1).
        colors: of the classes.
        opacities: of the classes, in [0, 1].
        progress: called with classes done; may raise `Cancelled`.

    Returns:
        (K', J', I', 4) uint8, colours and codes; fills the box of the volume.
    """
    shape = shape_within_budget(intensities.shape)
    gray = _gray(nearest_voxels(intensities, shape), window)
    even_gray = (binomial(np.pad(gray, 1, mode="edge"), passes=1) >> np.uint16(4)).astype(np.uint8)
    composition = Composition(shape, len(maps))
    # Wide enough for intensities to have a say, also where cells are large.
    cell_voxels = max(n / cells for n, cells in zip(shape, finest_shape(maps), strict=True))
    softness = [2.0 * max(cell_voxels, 1.0)] * len(maps)
    for done, (index, membership) in enumerate(memberships(maps, isos, opacities, shape, softness)):
        progress(done, len(maps), COMPOSING)
        if opacities[index] == 0.0:
            continue
        posterior = _posterior(membership.values, even_gray[membership.box])
        tone = _tone(gray[membership.box], posterior)
        composition.add(membership.box, index, class_codes(posterior, opacities[index], passes=1), tone)
    return composition.rgba(colors)


def _gray(intensities: np.ndarray, window: IntensityWindow) -> np.ndarray:
    """Intensities as gray levels, (K, J, I) uint8."""
    if intensities.dtype in (np.int16, np.uint16):
        # Each of the values once, not each of the voxels.
        values = np.arange(65536, dtype=np.uint16).view(intensities.dtype)
        return np.rint(255.0 * window.apply(values)).astype(np.uint8)[intensities.view(np.uint16)]
    return np.rint(255.0 * window.apply(intensities)).astype(np.uint8)


def _posterior(prior: np.ndarray, gray: np.ndarray) -> np.ndarray:
    """Memberships (k, j, i) uint8 after a look at the intensities, from those before and gray levels, uint8 both."""
    likelihood = np.log(_frequencies(gray[prior >= CERTAIN]) / _frequencies(gray[prior <= DOUBTFUL]))
    share = np.clip(np.arange(256) / 255.0, 0.004, 0.996)
    odds = np.log(share / (1.0 - share))
    # Where the map denies the class, intensities alone do not make it.
    possible = np.minimum(np.arange(256) / 26.0, 1.0)
    table = 255.0 * possible[:, None] / (1.0 + np.exp(-odds[:, None] - np.clip(likelihood, -4.0, 4.0)))
    posterior: np.ndarray = np.rint(table).astype(np.uint8).ravel()[(prior.astype(np.uint16) << np.uint16(8)) | gray]
    return posterior


def _frequencies(gray: np.ndarray) -> np.ndarray:
    """How frequent each gray level is, (256,), evened out so that few voxels will do."""
    counts = gaussian_filter1d(np.bincount(gray, minlength=256).astype(float), sigma=5.0)
    frequencies: np.ndarray = counts / max(counts.sum(), 1.0) + 2e-4
    return frequencies


def _tone(gray: np.ndarray, membership: np.ndarray) -> np.ndarray:
    """How bright a class's colour is at each voxel, for where the voxel lies in the class's own range, (k, j, i) uint8.

    Averaged over neighbours that belong to the class: a voxel that the surface cuts would show what lies beyond it.
    """
    weight = binomial(np.pad(membership, 1), passes=1)
    product = (gray.astype(np.uint16) * membership) >> np.uint16(8)
    mean = 256.0 * binomial(np.pad(product.astype(np.uint8), 1), passes=1) / np.maximum(weight, 1).astype(np.float32)
    typical = gray[membership >= CERTAIN]
    low, high = np.percentile(typical[:: max(1, typical.size // 100_000)], (3.0, 97.0)) if typical.size else (0.0, 255.0)
    tone = DARKEST + (1.0 - DARKEST) * (mean - low) / max(high - low, 16.0)
    brightness: np.ndarray = np.clip(255.0 * tone, 255.0 * DARKEST, 255.0).astype(np.uint8)
    return brightness
