"""The smallest box around voxels, against a list of them all."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from ViTTransferFunction.Logic.core.volumes.bounding_box import bounding_box, covering_box

masks = arrays(np.bool_, array_shapes(min_dims=3, max_dims=3, min_side=0, max_side=7), fill=st.just(False))


@given(masks)
def test_the_box_ends_where_the_outermost_voxels_are(mask: np.ndarray) -> None:
    voxels = np.argwhere(mask)
    if not len(voxels):
        assert bounding_box(mask) is None
        return
    first, end = voxels.min(axis=0), voxels.max(axis=0) + 1
    assert bounding_box(mask) == tuple(slice(*ends) for ends in np.stack([first, end], axis=1).tolist())


@given(masks, st.integers(0, 9))
def test_a_margin_is_added_on_every_side_and_ends_with_the_array(mask: np.ndarray, margin: int) -> None:
    box, wide = bounding_box(mask), bounding_box(mask, margin)
    if box is None:
        assert wide is None
        return
    ends = [(max(s.start - margin, 0), min(s.stop + margin, n)) for s, n in zip(box, mask.shape, strict=True)]
    assert wide == tuple(slice(*of_axis) for of_axis in ends)


def test_an_array_without_true_voxels_has_no_box() -> None:
    assert bounding_box(np.zeros((3, 4, 5), dtype=bool), margin=2) is None
    assert bounding_box(np.zeros((0, 4, 5), dtype=bool)) is None


def test_one_voxel_has_a_box_of_one_voxel() -> None:
    mask = np.zeros((3, 4, 5), dtype=bool)
    mask[2, 0, 4] = True
    assert bounding_box(mask) == (slice(2, 3), slice(0, 1), slice(4, 5))
    assert bounding_box(mask, margin=1) == (slice(1, 3), slice(0, 2), slice(3, 5))


@given(masks, st.tuples(*[st.integers(1, 23)] * 3))
def test_the_covering_box_holds_what_shares_space_with_the_box_and_no_more(
    mask: np.ndarray, shape: tuple[int, int, int]
) -> None:
    box = bounding_box(mask)
    if box is None:
        return
    for extent, covering, count, others in zip(box, covering_box(box, mask.shape, shape), mask.shape, shape, strict=True):
        # In units in which both grids have whole numbers.
        shares = [at for at in range(others) if (at + 1) * count > extent.start * others and at * count < extent.stop * others]
        assert (covering.start, covering.stop) == (shares[0], shares[-1] + 1)
