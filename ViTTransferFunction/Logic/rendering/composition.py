"""All structures in one volume, so that one volume rendering shows any number of them.

A voxel has four values: the number of its structure, its depth in that structure, its intensity, and how much light reaches it.
How structures look is not stored; a renderer's shader (`shader`) adds it. A voxel outside all structures has, instead of a
number, its distance to the nearest structure in blocks of voxels, so that rays can skip the empty cube around it.
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
"""The four values of a voxel: the number of its structure, from 1, or the distance to the nearest one; how much light reaches
it; its intensity; its depth in the structure. The depth is last, because VTK uses the last component to pick what a click in a
3D view hits."""

SURFACE = 127
"""Largest depth of voxels outside a structure: its surface lies between this value and the next."""

MOST_STRUCTURES = 207
"""Limited by uniform variables, which hold how structures look: common graphics cards have room for 4096 numbers, and each
structure needs 16. In place of a voxel's number, values above this are distances to the nearest surface, in blocks."""

MOST_BLOCKS_AWAY = 255 - MOST_STRUCTURES

VOXEL_BUDGET = 17_000_000
"""Largest number of voxels, about 256³, which any graphics card supports."""

MOST_ALONG_AXIS = 2047
"""Graphics cards and software OpenGL support 2048 along an axis, but Slicer on macOS splits volumes of that size."""

COMPOSING = "Preparing the 3D view"
"""The name of this work where progress is shown."""

SHADOW_REACHES = (0.02, 0.05)
"""Distances over which surfaces shade each other, as shares of the volume's longest side."""

SHADOW_STEPS = 64
"""Voxels along the longest side of the grid on which shadows are computed; enough, because they are soft."""

TYPICAL_DEPTH = 200
"""From this depth on, a voxel's intensity is regarded as typical of the structure."""

OWN_SHARE = (3.0, 97.0)
"""Percentiles of a structure's typical voxels, between which its own intensities lie."""

BLOCK_VOXELS = 4
"""Edge length, in voxels, of the blocks whose distances to surfaces are computed; for single voxels it would take seconds."""


class Composition:
    """A volume to which structures are added one by one. Where two overlap, a voxel belongs to the one in which it lies deeper.

    Args:
        shape: of the volume, (K, J, I).
        structures: number of structures that will be added.

    Raises:
        InputError: there are more than `MOST_STRUCTURES`.
    """

    def __init__(self, shape: Shape, structures: int) -> None:
        if structures > MOST_STRUCTURES:
            raise InputError(
                f"A 3D rendering shows up to {MOST_STRUCTURES} structures, and there are {structures}. Show fewer of them."
            )
        self.shape = shape
        # In separate arrays until the volume is made, because operations on contiguous arrays are vectorised.
        self._numbers, self._depths = np.zeros(shape, dtype=np.uint8), np.zeros(shape, dtype=np.uint8)
        self._filled_blocks = np.zeros([-(-size // BLOCK_VOXELS) for size in shape], dtype=bool)

    def add(self, box: Box, index: int, depths: np.ndarray) -> None:
        """Add a structure.

        Args:
            box: the part of the volume that contains it.
            index: of the structure, from 0.
            depths: depths of the box's voxels in it, (k, j, i) uint8.
        """
        part = self._depths[box]
        np.copyto(self._numbers[box], np.uint8(index + 1), where=depths > part)
        np.maximum(part, depths, out=part)
        if depths.size:
            self._fill_blocks(box, depths)

    def crop(self) -> Box:
        """Crop the volume to the structures, in whole blocks and with a margin of one; returns the box that is kept."""
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
            gray: intensities, (K, J, I) uint8; None: all 0.
            casting: for each structure, whether it casts shadows; None: all do.
        """
        voxels = np.empty((*self.shape, 4), dtype=np.uint8)
        voxels[..., DEPTH] = self._depths
        voxels[..., INTENSITY] = 0 if gray is None else gray
        _write_ambient_light(voxels[..., LIGHT], self._numbers, self._depths, casting)
        self._write_numbers(voxels[..., NUMBER])
        return voxels

    def _fill_blocks(self, box: Box, depths: np.ndarray) -> None:
        """Mark the blocks in which a ray may hit the structure: those with voxels of it, or with neighbours of such voxels."""
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
        """Write the voxels' numbers; in empty blocks, the chessboard distance to the nearest block that is not empty."""
        if self._filled_blocks.any():
            blocks_away = np.minimum(distance_transform_cdt(~self._filled_blocks, "chessboard"), MOST_BLOCKS_AWAY)
        else:
            blocks_away = np.full(self._filled_blocks.shape, MOST_BLOCKS_AWAY)
        marks = np.where(blocks_away > 0, MOST_STRUCTURES + blocks_away, 0).astype(np.uint8)
        _, rows, columns = self.shape
        for index, of_blocks in enumerate(marks):
            of_voxels = of_blocks.repeat(BLOCK_VOXELS, axis=0).repeat(BLOCK_VOXELS, axis=1)[:rows, :columns]
            slices = slice(index * BLOCK_VOXELS, (index + 1) * BLOCK_VOXELS)
            # Marks are larger than all structures' numbers.
            numbers[slices] = np.maximum(self._numbers[slices], of_voxels)


def shape_within_budget(shape: Shape, budget: int = VOXEL_BUDGET) -> Shape:
    """`shape` with its longest axes reduced to at most `MOST_ALONG_AXIS` voxels each, and at most `budget` voxels in total."""
    limit = min(max(shape), MOST_ALONG_AXIS)
    while np.prod(np.minimum(shape, limit)) > budget:
        limit -= 1
    k, j, i = np.minimum(shape, limit).tolist()
    return k, j, i


def own_levels(voxels: np.ndarray, structures: int) -> np.ndarray:
    """The range of grey levels of each structure's typical voxels, (structures, 2) float64; 0 to 255 if it has none."""
    histograms = inside_histograms(voxels, structures)
    found = np.tile([0.0, 255.0], (structures, 1))
    for index, counts in enumerate(histograms):
        if counts.sum():
            share = 100.0 * np.cumsum(counts) / counts.sum()
            low, high = (float(np.searchsorted(share, bound)) for bound in OWN_SHARE)
            found[index] = low, max(high, low + 1.0)
    return found


def inside_histograms(voxels: np.ndarray, structures: int) -> np.ndarray:
    """Histograms of the grey levels well inside each structure, (structures, 256) int; large volumes are sampled."""
    step = max(1, int(np.cbrt(voxels[..., 0].size / 2_000_000)))
    sample = voxels[::step, ::step, ::step].reshape(-1, 4)
    # The four values as one integer, of which the depth is the most significant byte.
    packed = sample.view("<u4")[:, 0]
    inside = packed[packed >= np.uint32(TYPICAL_DEPTH << 8 * DEPTH)]
    keys = (inside >> 8 * NUMBER & 255) << 8 | inside >> 8 * INTENSITY & 255
    return np.bincount(keys, minlength=256 * (structures + 1))[256 : 256 * (structures + 1)].reshape(structures, 256)


def _write_ambient_light(light: np.ndarray, numbers: np.ndarray, depths: np.ndarray, casting: Sequence[bool] | None) -> None:
    """Write how much ambient light reaches each voxel, (K, J, I) uint8: soft shadows at no rendering cost."""
    step = max(1, round(max(light.shape) / SHADOW_STEPS))
    coarse = (slice(None, None, step),) * 3
    matter = np.maximum(depths[coarse], SURFACE) - np.float32(SURFACE)
    matter /= 255.0 - SURFACE
    if casting is not None:
        casts = np.zeros(256, dtype=bool)
        casts[1 : len(casting) + 1] = casting
        matter *= casts[numbers[coarse]]
    sigmas = [reach * max(matter.shape) for reach in SHADOW_REACHES]
    # At a flat surface, half of the surroundings is matter.
    occlusion = sum(gaussian_filter(matter, sigma, mode="constant", truncate=2.5) for sigma in sigmas) / len(sigmas)
    _write_refined(light, 255.0 * np.clip(1.45 - 0.95 * occlusion, 0.4, 1.0), step)


def _write_refined(light: np.ndarray, values: np.ndarray, step: int) -> None:
    """Interpolate values given at every `step`-th voxel along each axis, and write them to all voxels, (K, J, I) uint8."""
    planes = interpolated(values, [np.arange(len(values)), *(np.arange(count) / step for count in light.shape[1:])])
    places = ((k // step, k % step / step) for k in range(len(light)))
    for plane, between in zip(light, planes_between(planes, places), strict=True):
        np.copyto(plane, between, casting="unsafe")
