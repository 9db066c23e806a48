"""Digests of voxels: the same for the same voxels, however they are stored, and different for any others."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.stepped_work import STEP_VOXELS, SteppedWork, finished
from ViTTransferFunction.Logic.core.volumes.voxel_digest import VoxelDigest, label_boxes, voxel_digests

MATRIX = np.array([[0.6, -0.96, 0.0, 11.0], [0.48, 0.36, -2.4, -7.0], [0.64, 0.48, 1.8, 40.0], [0.0, 0.0, 0.0, 1.0]])
MASK = np.zeros((5, 6, 7), dtype=bool)
MASK[1:4, 2:5, 1:6] = np.random.default_rng(0).random((3, 3, 5)) < 0.6


def digest_of(labels: np.ndarray, label: int = 1, ijk_to_ras: np.ndarray = MATRIX) -> VoxelDigest:
    return finished(voxel_digests(labels, Geometry(labels.shape, ijk_to_ras), [label]))[label]


@given(low=st.tuples(*[st.integers(0, 3)] * 3), high=st.tuples(*[st.integers(0, 3)] * 3), label=st.integers(1, 300))
def test_it_does_not_matter_how_voxels_are_stored(low: tuple[int, int, int], high: tuple[int, int, int], label: int) -> None:
    """In a larger image, beside another label, under another label, as another type."""
    stored = np.pad(MASK.astype(np.uint16) * label, list(zip(low, high, strict=True)))
    stored[(stored == 0) & (np.indices(stored.shape).sum(axis=0) % 3 == 0)] = label + 1
    moved = MATRIX.copy()
    moved[:3, 3] -= MATRIX[:3, :3] @ low[::-1]
    assert digest_of(stored, label, moved).is_like(digest_of(MASK.astype(np.uint8)))


@pytest.mark.parametrize(("dtype", "label"), [(np.float32, 1), (np.float64, 7), (np.int8, 1), (np.uint32, 614_454_277)])
def test_labels_may_be_of_any_type_and_size(dtype: type, label: int) -> None:
    stored = MASK.astype(dtype) * dtype(label)
    stored[0, 0, 0] = label + 1
    if dtype in (np.float32, np.float64):
        stored[0, 0, 1:5] = 0.5, np.nan, np.inf, -1.0
    assert digest_of(stored, label).is_like(digest_of(MASK.astype(np.uint8)))
    assert list(finished(label_boxes(stored))) == [label, label + 1]


@pytest.mark.parametrize("place", [(1, 2, 1), (2, 3, 3), (0, 0, 0), (4, 5, 6)])
def test_one_voxel_more_or_less_is_a_difference(place: tuple[int, int, int]) -> None:
    changed = MASK.copy()
    changed[place] ^= True
    assert not digest_of(changed.astype(np.uint8)).is_like(digest_of(MASK.astype(np.uint8)))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_shift_by_a_voxel_or_by_a_part_of_one_is_a_difference(axis: int) -> None:
    before = digest_of(MASK.astype(np.uint8))
    assert not digest_of(np.roll(MASK, 1, axis).astype(np.uint8)).is_like(before)
    shifted = MATRIX.copy()
    shifted[:3, 3] += 0.1 * MATRIX[:3, axis]
    assert not digest_of(MASK.astype(np.uint8), ijk_to_ras=shifted).is_like(before)


def test_another_spacing_is_a_difference() -> None:
    assert not digest_of(MASK.astype(np.uint8), ijk_to_ras=MATRIX @ np.diag([1.1, 1.0, 1.0, 1.0])).is_like(
        digest_of(MASK.astype(np.uint8))
    )


def test_what_a_file_rounds_is_no_difference() -> None:
    rounded = np.round(MATRIX * 1.0001, 4)
    assert digest_of(MASK.astype(np.uint8), ijk_to_ras=rounded).is_like(digest_of(MASK.astype(np.uint8)))


@pytest.mark.parametrize("scale", [1.0, 1e-5, 1e4])
def test_a_digest_survives_as_text_however_small_voxels_are(scale: float) -> None:
    digest = digest_of(MASK.astype(np.uint8), ijk_to_ras=np.diag([scale, scale, scale, 1.0]) @ MATRIX)
    again = VoxelDigest.from_text(digest.to_text())
    assert again is not None
    assert again.is_like(digest)


def test_other_texts_are_no_digests() -> None:
    too_large = ('[[1e400, 1, 1], "a", []]', f'[[1, 1, 1], "a", [1{"0" * 400}]]', "[" * 100_000)
    for text in ("", "{}", "null", "[1, 2, 3]", '[[1, 2], "a", [[0]]]', *too_large):
        assert VoxelDigest.from_text(text) is None


def test_no_voxels_are_equal_to_no_voxels_only() -> None:
    nothing = digest_of(np.zeros((2, 2, 2), dtype=np.uint8))
    assert nothing.is_like(VoxelDigest.of_nothing())
    assert not nothing.is_like(digest_of(MASK.astype(np.uint8)))


def test_voxels_that_fill_several_steps_are_digested_whole() -> None:
    area = STEP_VOXELS // 2
    labels = np.zeros((7, area // 512, 512), dtype=np.uint8)
    labels[1:6, 5:9, 3:7] = 2
    work = SteppedWork(label_boxes(labels))
    assert not work.advance(0.0)
    assert work.done == STEP_VOXELS
    while not work.advance(0.0):
        pass
    assert work.result == {2: (slice(1, 6), slice(5, 9), slice(3, 7))}
    before = digest_of(labels, 2)
    labels[5, 6, 5] = 0
    assert not digest_of(labels, 2).is_like(before)


def test_a_slice_that_is_larger_than_a_step_is_digested_whole() -> None:
    labels = np.zeros((2, 2 * STEP_VOXELS // 1024, 1024), dtype=np.uint8)
    rows = labels.shape[1]
    labels[:, 5 : rows - 5, 3:7] = 1
    work = SteppedWork(label_boxes(labels))
    assert not work.advance(0.0)
    assert work.done == STEP_VOXELS
    assert finished(label_boxes(labels)) == {1: (slice(0, 2), slice(5, rows - 5), slice(3, 7))}
    before = digest_of(labels)
    labels[1, rows - 6, 5] = 0
    assert not digest_of(labels).is_like(before)
