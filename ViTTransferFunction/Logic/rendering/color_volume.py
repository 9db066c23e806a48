"""All classes in one volume of colours, so that one volume rendering shows any number of them.

A scalar volume takes one transfer function, and renderers show few volumes at once. So the transfer functions are applied here:
every voxel gets the colour of its class and a code, from which a renderer takes opacity (`optical_properties`) and normals.

    code   0 …………… SURFACE ……… SURFACE + (255 - SURFACE) × height ……… SURFACE
    where  a ramp outside   on the surface     a little below it     deep inside

The outer ramp is transparent: it carries normals, and colours to interpolate with. Opacity gathers in a thin layer inside the
surface. A class's opacity sets the height of its ramp. Those of opaque classes are so high that all light is gone half-way up,
where normals are at their best; those of translucent ones fall off again, so that what they enclose is seen.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.ndimage import gaussian_filter, gaussian_filter1d

from ..core.colors import Color
from ..core.geometry import Box
from ..core.intensity_window import IntensityWindow
from ..core.progress import Progress, no_progress
from ..core.resampling import interpolated
from .class_membership import Shape, finest_shape, memberships, nearest_voxels
from .optical_properties import DEEPEST, LAYER_VOXELS, SURFACE

VOXEL_BUDGET = 17_000_000
"""Voxels that a volume of colours has at most: those of 256³, which any graphics card takes."""

VOXELS_FROM_CELLS = 6_000_000
"""Voxels up to which coarse maps are refined: enough for smooth surfaces, and fast enough to follow clicks."""

MOST_VOXELS_PER_CELL = 3
"""Along an axis; refining coarse maps further shows nothing more."""

OPAQUE_RAMP = (0.02, 0.5, 0.93, 1.0)
TRANSLUCENT_RAMP = (0.02, 0.5, 0.8, 0.97)
"""Memberships, of 1, where the code's ramp starts, crosses the surface, is highest, and has fallen off again, if it does."""

SMOOTH_RAMP = (0.02, 0.3, 0.73, 1.0)
"""Of an opaque class whose map is smooth: at a membership of 0.5 it is already opaque, so that it looks as large as it is, and
thin parts are seen."""

TRANSLUCENT_LAYER_VOXELS = 3.0
"""Thickness of a translucent class's layer, up and down: thinner, and it varies with how voxels happen to cut it."""

OPAQUE_SOFTNESS_VOXELS, TRANSLUCENT_SOFTNESS_VOXELS = 1.5, 3.0

SMOOTH_SOFTNESS_VOXELS = 1.9
"""Of maps that are smooth, so that nothing else softens an opaque class."""

CERTAIN, DOUBTFUL = 200, 55
"""Memberships from which on, and up to which, a voxel's intensity is taken as typical of the class and of what surrounds it."""

RENDERING = "Preparing the 3D view"

DARKEST = 0.7
"""What a class's colour is multiplied with where the volume is darkest within the class; where it is brightest, it stays."""

SHADOW_REACHES = (0.02, 0.05)
"""How far surfaces shade each other, of the volume's longest side."""

SHADOW_STEPS = 85
"""Shadows are soft: so many voxels along the longest side show them."""


def similarity_rgba(
    maps: Sequence[np.ndarray],
    isos: Sequence[float],
    colors: Sequence[Color],
    opacities: Sequence[float],
    progress: Progress = no_progress,
) -> np.ndarray:
    """Every class as an iso-surface of its map; where classes overlap, cut as `memberships` says.

    Args:
        maps: (K, J, I) each, float32 in [0, 1] or uint8 with 255 for 1. Where their shapes differ, they fill the same box.
        isos: for each map, the value at its surface, in (0, 1).
        colors: of the surfaces.
        opacities: of the surfaces, in [0, 1]; a class of opacity 0 is not seen but keeps its place.
        progress: called with classes done; may raise `Cancelled`.

    Returns:
        (K', J', I', 4) uint8, colours and codes; fills the box of the maps (`Geometry.resized` says where it lies).
    """
    shape = _refined_shape(shape_within_budget(finest_shape(maps)))
    composition = _Composition(shape, len(maps))
    softness = [OPAQUE_SOFTNESS_VOXELS if opacity == 1.0 else TRANSLUCENT_SOFTNESS_VOXELS for opacity in opacities]
    for done, (index, membership) in enumerate(memberships(maps, isos, opacities, shape, softness)):
        progress(done, len(maps), RENDERING)
        if opacities[index] > 0.0:
            composition.add(membership.box, index, _codes(membership.values, opacities[index], passes=2))
    return composition.rgba(colors)


def smooth_map_rgba(
    maps: Iterable[np.ndarray],
    iso: float,
    colors: Sequence[Color],
    opacities: Sequence[float],
    shape: Shape,
    cell_sizes: Sequence[float],
) -> np.ndarray:
    """Every class as an iso-surface of its map, of maps that are smooth already: thin parts need not be smoothed away.

    Classes do not compete as in `similarity_rgba`: each is all that its map says. Of two that overlap, the more opaque shows.

    Args:
        maps: (K, J, I) each, all of one shape; taken one after the other, so that not all of them need be in memory at once.
        iso: the value at the surface, in (0, 1).
        colors: of the surfaces.
        opacities: of the surfaces, in [0, 1].
        shape: (K', J', I') of the result, of about equally long voxels along all axes, not fewer than there are cells.
        cell_sizes: of the maps along K, J, I, in any unit.

    Returns:
        (K', J', I', 4) uint8, colours and codes; fills the box of the maps.
    """
    composition = _Composition(shape, len(colors))
    for index, (similarity, opacity) in enumerate(zip(maps, opacities, strict=True)):
        softness = SMOOTH_SOFTNESS_VOXELS if opacity == 1.0 else TRANSLUCENT_SOFTNESS_VOXELS
        for _, membership in memberships([similarity], [iso], [opacity], shape, [softness], cell_sizes):
            if opacity > 0.0:
                composition.add(membership.box, index, _codes(membership.values, opacity, passes=0, opaque_ramp=SMOOTH_RAMP))
    return composition.rgba(colors)


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
    even_gray = (_binomial(np.pad(gray, 1, mode="edge"), passes=1) >> np.uint16(4)).astype(np.uint8)
    composition = _Composition(shape, len(maps))
    # Wide enough for intensities to have a say, also where cells are large.
    cell_voxels = max(n / cells for n, cells in zip(shape, finest_shape(maps), strict=True))
    softness = [2.0 * max(cell_voxels, 1.0)] * len(maps)
    for done, (index, membership) in enumerate(memberships(maps, isos, opacities, shape, softness)):
        progress(done, len(maps), RENDERING)
        if opacities[index] == 0.0:
            continue
        posterior = _posterior(membership.values, even_gray[membership.box])
        tone = _tone(gray[membership.box], posterior)
        composition.add(membership.box, index, _codes(posterior, opacities[index], passes=1), tone)
    return composition.rgba(colors)


def shape_within_budget(shape: Shape) -> Shape:
    """`shape` where it has at most VOXEL_BUDGET voxels; else with its longest axes shortened until it does."""
    limit = max(shape)
    while np.prod(np.minimum(shape, limit)) > VOXEL_BUDGET:
        limit -= 1
    k, j, i = np.minimum(shape, limit).tolist()
    return k, j, i


def _refined_shape(shape: Shape) -> Shape:
    """Whole voxels for each cell, more than one if the map is coarse."""
    per_cell = max(1, min(int(np.cbrt(VOXELS_FROM_CELLS / np.prod(shape))), MOST_VOXELS_PER_CELL))
    k, j, i = (per_cell * cells for cells in shape)
    return k, j, i


class _Composition:
    """A volume to which classes are added one after the other; of two, the one with the higher code shows.

    Attributes:
        codes: (K, J, I) uint8.
        keys: (K, J, I), 256 times the number of the class, from 1, plus how bright its colour is, of 255.
    """

    def __init__(self, shape: Shape, classes: int) -> None:
        self.codes = np.zeros(shape, dtype=np.uint8)
        self.keys = np.zeros(shape, dtype=np.min_scalar_type(256 * classes + 255))

    def add(self, box: Box, index: int, codes: np.ndarray, brightness: np.ndarray | int = 255) -> None:
        """Write a class's codes and brightness (k, j, i) into a box wherever its codes exceed those that are there."""
        higher = codes > self.codes[box]
        np.copyto(self.codes[box], codes, where=higher)
        np.copyto(self.keys[box], self.keys.dtype.type(256 * (index + 1)) + brightness, where=higher)

    def rgba(self, colors: Sequence[Color]) -> np.ndarray:
        """(K, J, I, 4) uint8, with the classes' colours where they are brightest and in the light."""
        low_byte = self.keys.dtype.type(255)
        brightness = (self.keys & low_byte).astype(np.uint16)
        brightness *= _ambient_light(self.codes)
        self.keys &= ~low_byte
        self.keys |= brightness >> np.uint16(8)
        palette = np.zeros((len(colors) + 1, 256, 4), dtype=np.uint8)
        palette[1:, :, :3] = np.rint(np.asarray(colors)[:, None] * np.arange(256)[:, None])
        # Four bytes at a time.
        voxels = palette.reshape(-1, 4).view("<u4")[:, 0][self.keys]
        voxels |= self.codes.astype("<u4") << np.uint32(24)
        return voxels.view(np.uint8).reshape(*self.codes.shape, 4)


def _ambient_light(codes: np.ndarray) -> np.ndarray:
    """How much of the light around reaches each voxel, (K, J, I) uint8, 255 for all: soft shadows, at no cost to renderers."""
    step = max(1, round(max(codes.shape) / SHADOW_STEPS))
    matter = np.maximum(codes[::step, ::step, ::step], SURFACE) - np.float32(SURFACE)
    matter /= 255.0 - SURFACE
    sigmas = [reach * max(matter.shape) for reach in SHADOW_REACHES]
    # Half of what is around a flat surface is matter.
    occlusion = sum(gaussian_filter(matter, sigma, mode="constant", truncate=2.5) for sigma in sigmas) / len(sigmas)
    light = 255.0 * np.clip(1.45 - 0.95 * occlusion, 0.4, 1.0)
    return interpolated(light, [np.arange(count) / step for count in codes.shape]).astype(np.uint8)


def _codes(
    values: np.ndarray, opacity: float, passes: int, opaque_ramp: tuple[float, float, float, float] = OPAQUE_RAMP
) -> np.ndarray:
    """The codes (k, j, i) uint8 of a class for its memberships, which are smoothed so that normals do not show the voxels."""
    highest, lowest, ramp = 255.0, 255.0, opaque_ramp
    if opacity < 1.0:
        values = (_binomial(np.pad(values, 2), passes=2) >> np.uint16(4)).astype(np.uint8)
        depth = min(-np.log1p(-opacity), DEEPEST)
        height = np.sqrt(depth / DEEPEST * LAYER_VOXELS / TRANSLUCENT_LAYER_VOXELS)
        highest, lowest, ramp = SURFACE + (255 - SURFACE) * height, SURFACE, TRANSLUCENT_RAMP
    smooth = _binomial(np.pad(values, passes), passes)
    codes = np.interp(np.linspace(0.0, 1.0, 255 * 4**passes + 1), ramp, [0, SURFACE, highest, lowest])
    of_class: np.ndarray = np.rint(codes).astype(np.uint8)[smooth]
    return of_class


def _binomial(values: np.ndarray, passes: int) -> np.ndarray:
    """uint8 values smoothed `passes` (0 to 2) times by [1 2 1] along each axis, which shortens it by 2.

    Returns:
        uint16, times 4 to the power of `passes`.
    """
    smooth = values.astype(np.uint16)
    for axis in range(3):
        for _ in range(2 * passes):
            along = np.moveaxis(smooth, axis, 0)
            smooth = np.moveaxis(along[:-1] + along[1:], 0, axis)
        if axis < 2:
            smooth >>= np.uint16(2 * passes)
    return smooth


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
    weight = _binomial(np.pad(membership, 1), passes=1)
    product = (gray.astype(np.uint16) * membership) >> np.uint16(8)
    mean = 256.0 * _binomial(np.pad(product.astype(np.uint8), 1), passes=1) / np.maximum(weight, 1).astype(np.float32)
    typical = gray[membership >= CERTAIN]
    low, high = np.percentile(typical[:: max(1, typical.size // 100_000)], (3.0, 97.0)) if typical.size else (0.0, 255.0)
    tone = DARKEST + (1.0 - DARKEST) * (mean - low) / max(high - low, 16.0)
    brightness: np.ndarray = np.clip(255.0 * tone, 255.0 * DARKEST, 255.0).astype(np.uint8)
    return brightness
