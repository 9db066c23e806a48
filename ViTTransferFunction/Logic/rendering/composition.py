"""All structures in one volume, so that one volume rendering shows any number of them.

A voxel has four numbers: of its structure, how deep it lies in that, the intensity, and how much light reaches it. Nothing of
how structures look is in them: a renderer's shader (`shader`) adds that. Away from all structures, where a voxel has none, it
has instead how many blocks of voxels it is from them: a ray may leap out of the cube that is therefore empty.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import distance_transform_cdt, gaussian_filter

from ..core.system.errors import InputError
from ..core.volumes.bounding_box import bounding_box, whole_box
from ..core.volumes.geometry import Box
from ..core.volumes.resampling import interpolated, planes_between
from .class_membership import Shape

NUMBER, LIGHT, INTENSITY, DEPTH = range(4)
"""What the four numbers of a voxel are: of its structure, from 1, or how far away they are; how much light reaches it; its
intensity; how deep it lies in the structure, last, since VTK finds by the last one what a click in a 3D view meets."""

SURFACE = 127
"""Depth up to which a voxel lies outside: a surface is between this and the next."""

MOST_STRUCTURES = 207
"""How they look is in uniform variables, of which common graphics cards have room for 4096 numbers, and 16 are of each. What is
above this in place of a voxel's number is how many blocks away all surfaces are."""

MOST_BLOCKS_AWAY = 255 - MOST_STRUCTURES

VOXEL_BUDGET = 17_000_000
"""Voxels that the volume has at most: those of 256³, which any graphics card takes."""

MOST_ALONG_AXIS = 2047
"""Graphics cards and OpenGL in software take 2048 along an axis, and Slicer on a Mac divides a volume that has as many."""

COMPOSING = "Preparing the 3D view"
"""The name of this work, for those who watch."""

SHADOW_REACHES = (0.02, 0.05)
"""How far surfaces shade each other, of the volume's longest side."""

SHADOW_STEPS = 64
"""Shadows are soft: a grid of this many voxels along the longest side shows them."""

TYPICAL_DEPTH = 200
"""From here on inwards, a voxel's intensity is taken as the structure's own."""

OWN_SHARE = (3.0, 97.0)
"""Percentiles of its voxels between which a structure's own intensities lie."""

BLOCK_VOXELS = 4
"""Along each edge of the blocks whose distances from surfaces are known: those of single voxels would take seconds."""


class Composition:
    """A volume to which structures are added one after the other; of two, the one in which a voxel lies deeper has it.

    Args:
        shape: of the volume, (K, J, I).
        structures: how many there will be.

    Raises:
        InputError: they are too many.
    """

    def __init__(self, shape: Shape, structures: int) -> None:
        if structures > MOST_STRUCTURES:
            raise InputError(
                f"A 3D rendering shows up to {MOST_STRUCTURES} structures, and there are {structures}. Show fewer of them."
            )
        self.shape = shape
        # Each by itself until the volume is made: numbers that lie beside each other are compared many at a time.
        self._numbers, self._depths = np.zeros(shape, dtype=np.uint8), np.zeros(shape, dtype=np.uint8)
        self._filled_blocks = np.zeros([-(-size // BLOCK_VOXELS) for size in shape], dtype=bool)

    def add(self, box: Box, index: int, depths: np.ndarray) -> None:
        """Add the structure of an index, from 0: how deep voxels lie in it, (k, j, i) uint8 of a box."""
        part = self._depths[box]
        np.copyto(self._numbers[box], np.uint8(index + 1), where=depths > part)
        np.maximum(part, depths, out=part)
        if depths.size:
            self._fill_blocks(box, depths)

    def crop(self) -> Box:
        """Leave out what is around the structures; the box of voxels that stay, in multiples of blocks and with a margin."""
        blocks = bounding_box(self._filled_blocks, margin=1) or whole_box(self._filled_blocks.shape)
        k, j, i = (
            slice(BLOCK_VOXELS * extent.start, min(BLOCK_VOXELS * extent.stop, size))
            for extent, size in zip(blocks, self.shape, strict=True)
        )
        self._filled_blocks = self._filled_blocks[blocks]
        self._numbers, self._depths = self._numbers[k, j, i], self._depths[k, j, i]
        self.shape = k.stop - k.start, j.stop - j.start, i.stop - i.start
        return k, j, i

    def voxels(self, gray: np.ndarray | None = None, casting: Sequence[bool] | None = None) -> np.ndarray:
        """The volume, (K, J, I, 4) uint8.

        Args:
            gray: the intensities, (K, J, I) uint8; None: there are none.
            casting: which structures cast shadows; None: all.
        """
        voxels = np.empty((*self.shape, 4), dtype=np.uint8)
        voxels[..., DEPTH] = self._depths
        voxels[..., INTENSITY] = 0 if gray is None else gray
        _write_ambient_light(voxels[..., LIGHT], self._numbers, self._depths, casting)
        self._write_numbers(voxels[..., NUMBER])
        return voxels

    def _fill_blocks(self, box: Box, depths: np.ndarray) -> None:
        """Note the blocks in which a ray may meet the structure: those that have voxels of it, or voxels beside such."""
        blocks, places = depths, []
        for axis, (extent, count) in enumerate(zip(box, self._filled_blocks.shape, strict=True)):
            first, last = max(extent.start - 1, 0) // BLOCK_VOXELS, min(extent.stop // BLOCK_VOXELS, count - 1)
            along = np.moveaxis(blocks, axis, 0)
            begins = (BLOCK_VOXELS * block - 1 - extent.start for block in range(first, last + 1))
            parts = [along[max(begin, 0) : begin + BLOCK_VOXELS + 2].max(axis=0) for begin in begins]
            blocks = np.stack(parts, axis=axis)
            places.append(slice(first, last + 1))
        self._filled_blocks[tuple(places)] |= blocks > SURFACE

    def _write_numbers(self, numbers: np.ndarray) -> None:
        """Write the voxels' numbers; in empty blocks, how many blocks away, along each axis, all others are."""
        if self._filled_blocks.any():
            blocks_away = np.minimum(distance_transform_cdt(~self._filled_blocks, "chessboard"), MOST_BLOCKS_AWAY)
        else:
            blocks_away = np.full(self._filled_blocks.shape, MOST_BLOCKS_AWAY)
        marks = np.where(blocks_away > 0, MOST_STRUCTURES + blocks_away, 0).astype(np.uint8)
        _, rows, columns = self.shape
        for index, of_blocks in enumerate(marks):
            of_voxels = of_blocks.repeat(BLOCK_VOXELS, axis=0).repeat(BLOCK_VOXELS, axis=1)[:rows, :columns]
            slices = slice(index * BLOCK_VOXELS, (index + 1) * BLOCK_VOXELS)
            # Marks are above all structures' numbers.
            numbers[slices] = np.maximum(self._numbers[slices], of_voxels)


def shape_within_budget(shape: Shape, budget: int = VOXEL_BUDGET) -> Shape:
    """`shape` with its longest axes shortened to MOST_ALONG_AXIS voxels, and until it has at most `budget` voxels."""
    limit = min(max(shape), MOST_ALONG_AXIS)
    while np.prod(np.minimum(shape, limit)) > budget:
        limit -= 1
    k, j, i = np.minimum(shape, limit).tolist()
    return k, j, i


def own_levels(voxels: np.ndarray, structures: int) -> np.ndarray:
    """The grey levels between which most of a structure's own voxels lie, (structures, 2) float64; of one without any, all."""
    histograms = inside_histograms(voxels, structures)
    found = np.tile([0.0, 255.0], (structures, 1))
    for index, counts in enumerate(histograms):
        if counts.sum():
            share = 100.0 * np.cumsum(counts) / counts.sum()
            low, high = (float(np.searchsorted(share, bound)) for bound in OWN_SHARE)
            found[index] = low, max(high, low + 1.0)
    return found


def inside_histograms(voxels: np.ndarray, structures: int) -> np.ndarray:
    """How many voxels well inside each structure have each grey level, (structures, 256) int; a sample of large volumes."""
    step = max(1, int(np.cbrt(voxels[..., 0].size / 2_000_000)))
    sample = voxels[::step, ::step, ::step].reshape(-1, 4)
    # All four at once, of which the depth is the most significant.
    packed = sample.view("<u4")[:, 0]
    inside = packed[packed >= np.uint32(TYPICAL_DEPTH << 8 * DEPTH)]
    keys = (inside >> 8 * NUMBER & 255) << 8 | inside >> 8 * INTENSITY & 255
    return np.bincount(keys, minlength=256 * (structures + 1))[256 : 256 * (structures + 1)].reshape(structures, 256)


def _write_ambient_light(light: np.ndarray, numbers: np.ndarray, depths: np.ndarray, casting: Sequence[bool] | None) -> None:
    """Write how much of the light around reaches each voxel, (K, J, I) uint8, 255 for all: soft shadows, free for renderers."""
    step = max(1, round(max(light.shape) / SHADOW_STEPS))
    coarse = (slice(None, None, step),) * 3
    matter = np.maximum(depths[coarse], SURFACE) - np.float32(SURFACE)
    matter /= 255.0 - SURFACE
    if casting is not None:
        casts = np.zeros(256, dtype=bool)
        casts[1 : len(casting) + 1] = casting
        matter *= casts[numbers[coarse]]
    sigmas = [reach * max(matter.shape) for reach in SHADOW_REACHES]
    # Half of what is around a flat surface is matter.
    occlusion = sum(gaussian_filter(matter, sigma, mode="constant", truncate=2.5) for sigma in sigmas) / len(sigmas)
    _write_refined(light, 255.0 * np.clip(1.45 - 0.95 * occlusion, 0.4, 1.0), step)


def _write_refined(light: np.ndarray, values: np.ndarray, step: int) -> None:
    """Write values of every `step`-th voxel along each axis at all voxels, (K, J, I) uint8."""
    planes = interpolated(values, [np.arange(len(values)), *(np.arange(count) / step for count in light.shape[1:])])
    places = ((k // step, k % step / step) for k in range(len(light)))
    for plane, between in zip(light, planes_between(planes, places), strict=True):
        np.copyto(plane, between, casting="unsafe")
