"""Which blocks can be reached from one of them, compared with the connected components of all."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from ViTTransferFunction.Logic.similarity.block_cubes import EDGE, BlockCubes
from ViTTransferFunction.Logic.similarity.flood_fill import FloodFill

SHAPES = [(8, 10, 12), (1, 1, 200), (3, 90, 64), (20, 6, 2), (12, 14, 130), (33, 31, 32)]

Shape = tuple[int, int, int]


class Flood:
    """A flood fill of blocks in the volume's order."""

    def __init__(self, shape: Shape, start: Shape) -> None:
        self._cubes = BlockCubes(shape)
        self._fill = FloodFill(self._cubes, start)

    def through(self, allowed: np.ndarray) -> None:
        self._fill.through(self._cubes.arranged(allowed.view(np.uint8), 0).view(bool))

    def cells(self, per_cell: int = 1) -> np.ndarray:
        return self._cubes.restored(self._fill.reached(per_cell), per_cell)


def component(allowed: np.ndarray, start: Shape) -> np.ndarray:
    """The blocks that are connected with a start, by another algorithm."""
    components, _ = ndimage.label(allowed)
    of_start: np.ndarray = components == components[start]
    return of_start


@pytest.mark.parametrize("shape", SHAPES)
def test_what_is_reached_is_the_component_of_the_start_however_the_ways_wind(shape: Shape) -> None:
    generator = np.random.default_rng(0)
    # Around the share from which on there is one large component, with the longest ways in it.
    for share in (0.2, 0.3, 0.35, 0.5, 0.9, 1.0):
        allowed = generator.random(shape) < share
        k, j, i = generator.integers(shape).tolist()
        allowed[k, j, i] = True
        flood = Flood(shape, (k, j, i))
        flood.through(allowed)
        np.testing.assert_array_equal(flood.cells(), component(allowed, (k, j, i)))


def test_a_single_way_through_every_second_block_is_followed_to_its_end() -> None:
    shape = (5, 17, 13)
    allowed = np.zeros(shape, dtype=bool)
    # A snake in each plane, from plane to plane at either end: within a cube it goes there and back more often than it spreads.
    allowed[::2, ::2] = True
    for plane in range(0, 5, 2):
        allowed[plane, 1::4, -1] = allowed[plane, 3::4, 0] = True
    allowed[1, -1, -1] = allowed[3, 0, 0] = True
    flood = Flood(shape, (0, 0, 0))
    flood.through(allowed)
    np.testing.assert_array_equal(flood.cells(), allowed)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("start", [(0, 0, 0), (11, 11, 11), (5, 6, 7)])
def test_nothing_passes_from_the_end_of_a_row_to_the_next(axis: int, start: Shape) -> None:
    shape = (12, 12, 12)
    allowed = np.zeros(shape, dtype=bool)
    # Planes that touch nowhere, from one face of the volume to the other.
    np.moveaxis(allowed, axis, 0)[start[axis] % 2 :: 2] = True
    flood = Flood(shape, start)
    flood.through(allowed)
    np.testing.assert_array_equal(flood.cells(), component(allowed, start))


def test_where_more_is_allowed_it_goes_on_from_what_was_reached() -> None:
    generator = np.random.default_rng(1)
    shape, start = (10, 16, 130), (5, 8, 65)
    heights = generator.random(shape)
    heights[start] = 0.0
    flood = Flood(shape, start)
    for height in (0.2, 0.3, 0.4, 0.4, 0.7):
        flood.through(heights <= height)
        np.testing.assert_array_equal(flood.cells(), component(heights <= height, start))


@pytest.mark.parametrize("per_cell", [2, EDGE])
def test_a_cell_is_reached_where_any_of_its_blocks_is(per_cell: int) -> None:
    shape = (4, 12, 68)
    allowed = np.random.default_rng(2).random(shape) < 0.35
    start = (1, 2, 3)
    allowed[start] = True
    flood = Flood(shape, start)
    flood.through(allowed)
    k, j, i = (blocks // per_cell for blocks in shape)
    in_blocks = flood.cells().reshape(k, per_cell, j, per_cell, i, per_cell).max(axis=(1, 3, 5))
    assert 0 < in_blocks.sum() < in_blocks.size
    np.testing.assert_array_equal(flood.cells(per_cell), in_blocks)
