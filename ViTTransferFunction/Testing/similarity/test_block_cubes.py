"""Blocks arranged in cubes, and brought back into the volume's order."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.similarity.block_cubes import BLOCKS_OF_CUBE, BlockCubes

SHAPES = [(1, 1, 1), (4, 8, 12), (5, 7, 10), (2, 14, 6)]


@pytest.mark.parametrize("shape", SHAPES)
def test_blocks_come_back_in_the_order_of_the_volume(shape: tuple[int, int, int]) -> None:
    blocks = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
    cubes = BlockCubes(shape)
    arranged = cubes.arranged(blocks, 0)
    np.testing.assert_array_equal(cubes.restored(arranged), blocks)
    np.testing.assert_array_equal(cubes.restored(arranged, 2), blocks[::2, ::2, ::2])


@pytest.mark.parametrize("shape", SHAPES)
def test_each_block_has_its_place_and_all_other_places_are_elsewhere(shape: tuple[int, int, int]) -> None:
    blocks = np.arange(np.prod(shape), dtype=np.int16).reshape(shape)
    cubes = BlockCubes(shape)
    arranged = cubes.arranged(blocks, -1)
    places = [cubes.place((k, j, i)) for k, j, i in np.ndindex(shape)]
    np.testing.assert_array_equal(arranged[places], blocks.ravel())
    assert np.count_nonzero(arranged == -1) == len(arranged) - blocks.size


def test_the_first_and_the_last_cubes_hold_no_block() -> None:
    cubes = BlockCubes((8, 4, 5))
    arranged = cubes.arranged(np.ones((8, 4, 5), dtype=np.uint8), 0).reshape(*cubes.counts, BLOCKS_OF_CUBE)
    inner = arranged[1:-1, 1:-1, 1:-1]
    assert inner.any(axis=-1).all()
    assert arranged.sum() == inner.sum()
