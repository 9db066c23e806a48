"""Which blocks can be reached from one of them, compared with the connected components of all."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from ViTTransferFunction.Logic.similarity.flood_fill import WORD_BITS, FloodFill

SHAPES = [(8, 10, 12), (1, 1, 200), (3, 90, 64), (20, 6, 2), (12, 14, 2 * WORD_BITS + 2)]


@pytest.mark.parametrize("shape", SHAPES)
def test_what_is_reached_is_the_component_of_the_start_however_the_ways_wind(shape: tuple[int, int, int]) -> None:
    generator = np.random.default_rng(0)
    # Around the share from which on there is one large component, with the longest ways in it.
    for share in (0.2, 0.3, 0.35, 0.5, 0.9, 1.0):
        allowed = generator.random(shape) < share
        start = tuple(generator.integers(shape).tolist())
        allowed[start] = True
        flood = FloodFill(shape, start)
        flood.through(allowed)
        components, _ = ndimage.label(allowed)
        np.testing.assert_array_equal(flood.cells(1), components == components[start])


def test_where_more_is_allowed_it_goes_on_from_what_was_reached() -> None:
    generator = np.random.default_rng(1)
    shape, start = (10, 16, 130), (5, 8, 65)
    heights = generator.random(shape)
    heights[start] = 0.0
    flood = FloodFill(shape, start)
    for height in (0.2, 0.3, 0.4, 0.4, 0.7):
        flood.through(heights <= height)
        components, _ = ndimage.label(heights <= height)
        np.testing.assert_array_equal(flood.cells(1), components == components[start])


def test_a_cell_is_reached_where_any_of_its_blocks_is() -> None:
    shape = (4, 6, 2 * (WORD_BITS // 2 + 3))
    allowed = np.random.default_rng(2).random(shape) < 0.4
    start = (1, 2, 3)
    allowed[start] = True
    flood = FloodFill(shape, start)
    flood.through(allowed)
    k, j, i = (blocks // 2 for blocks in shape)
    in_blocks = flood.cells(1).reshape(k, 2, j, 2, i, 2).max(axis=(1, 3, 5))
    assert 0 < in_blocks.sum() < in_blocks.size
    np.testing.assert_array_equal(flood.cells(2), in_blocks)
