"""All classes in one volume of colours, so that one volume rendering shows any number of them.

A scalar volume takes one transfer function, and renderers show few volumes at once. So the transfer functions are applied here:
every voxel gets the colour of its class and a code (`codes`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter

from ..core.colors import Color
from ..core.geometry import Box
from ..core.resampling import interpolated
from .class_membership import Shape
from .optical_properties import SURFACE

VOXEL_BUDGET = 17_000_000
"""Voxels that a volume of colours has at most: those of 256³, which any graphics card takes."""

COMPOSING = "Preparing the 3D view"
"""The name of this work, for those who watch."""

SHADOW_REACHES = (0.02, 0.05)
"""How far surfaces shade each other, of the volume's longest side."""

SHADOW_STEPS = 85
"""Shadows are soft: so many voxels along the longest side show them."""


class Composition:
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


def shape_within_budget(shape: Shape) -> Shape:
    """`shape` where it has at most VOXEL_BUDGET voxels; else with its longest axes shortened until it does."""
    limit = max(shape)
    while np.prod(np.minimum(shape, limit)) > VOXEL_BUDGET:
        limit -= 1
    k, j, i = np.minimum(shape, limit).tolist()
    return k, j, i


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
