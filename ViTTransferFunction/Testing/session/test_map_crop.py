"""Boxes of maps."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.volumes.geometry import Box
from ViTTransferFunction.Logic.core.volumes.voxel_map import VoxelMap
from ViTTransferFunction.Logic.session.map_crop import SegmentCrops, crop_map, restricted
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession
from ViTTransferFunction.Testing.support.allocation import peak_bytes
from ViTTransferFunction.Testing.support.spheres import Spheres, requests_of


@pytest.fixture
def ramp() -> np.ndarray:
    """A cone of similarity around voxel (10, 8, 6) of a volume of (20, 16, 12)."""
    k, j, i = np.indices((20, 16, 12))
    return np.clip(1.0 - np.sqrt((k - 10) ** 2 + (j - 8) ** 2 + (i - 6) ** 2) / 8.0, 0.0, 1.0).astype(np.float32)


def test_a_crop_holds_all_of_the_map_that_matters(ramp: np.ndarray) -> None:
    crop = crop_map(VoxelMap.whole(ramp), 0.5)
    whole = np.zeros_like(ramp)
    whole[crop.box] = crop.array / 255.0
    np.testing.assert_allclose(whole[ramp >= 0.25], ramp[ramp >= 0.25], atol=0.5 / 255.0)
    assert crop.box == (slice(2, 19), slice(0, 16), slice(0, 12)), "two voxels around what is at least 0.25"


def test_a_crop_takes_little_more_than_its_bytes() -> None:
    ones = np.ones((64, 128, 128), dtype=np.float32)
    nothing = (slice(0, 0),) * 3
    # Also of a map of which nothing is held, which is interpolated.
    for voxels in (VoxelMap.whole(ones), VoxelMap(ones.shape, ones, lambda k, rows: ones[k, rows], nothing, ones[nothing])):
        assert peak_bytes(lambda: crop_map(voxels, 0.5)) < 3.5 * ones.size  # noqa: B023


def test_a_restricted_crop_takes_little_more_than_its_bytes() -> None:
    crop = crop_map(VoxelMap.whole(np.ones((64, 128, 128), dtype=np.float32)), 0.5)
    labels = np.ones((64, 128, 128), dtype=np.uint8)
    assert peak_bytes(lambda: restricted(crop, labels, 1)) < 1.5 * labels.size


def test_crops_keep_nothing_beyond_their_box_and_those_of_maps_go_one_by_one() -> None:
    k, j, i = np.indices((64, 64, 64))
    ball = (np.hypot(np.hypot(k - 32, j - 32), i - 32) < 16).astype(np.float32)
    labels = ball.astype(np.uint8)
    # All is looked through, since all is held.
    full = SimpleNamespace(voxels=VoxelMap.whole(ball), iso=0.5)
    kept_bytes = crop_map(full.voxels, full.iso).array.size

    def show() -> None:
        crops = SegmentCrops()
        for _ in range(60):
            crops.take(None, full)  # type: ignore[arg-type]
        crops.of(labels)

    assert peak_bytes(show) < 1.5 * 60 * kept_bytes


def test_a_map_of_nothing_still_has_a_box() -> None:
    crop = crop_map(VoxelMap.whole(np.zeros((5, 6, 7), dtype=np.float32)), 0.5)
    assert min(crop.array.shape) >= 2
    assert crop.array.max() == 0


@pytest.mark.parametrize("held", [(slice(0, 0),) * 3, (slice(0, 10), slice(0, 16), slice(0, 12))], ids=["nothing", "a half"])
def test_a_map_of_which_a_part_is_held_has_the_crop_of_the_whole(ramp: np.ndarray, held: Box) -> None:
    crop = crop_map(VoxelMap(ramp.shape, ramp, lambda k, rows: ramp[k, rows], held, ramp[held]), 0.5)
    whole = crop_map(VoxelMap.whole(ramp), 0.5)
    assert crop.box == whole.box
    np.testing.assert_array_equal(crop.array, whole.array)


def test_a_map_of_which_nothing_is_held_and_that_reaches_nowhere_still_has_a_box() -> None:
    nothing = np.zeros((5, 6, 7), dtype=np.float32)
    empty = (slice(0, 0),) * 3
    crop = crop_map(VoxelMap(nothing.shape, nothing, lambda k, rows: nothing[k, rows], empty, nothing[empty]), 0.5)
    assert min(crop.array.shape) >= 2
    assert crop.array.max() == 0


@pytest.mark.parametrize("rounded_down", [False, True])
def test_a_restricted_crop_encloses_just_the_labelled_voxels(ramp: np.ndarray, rounded_down: bool) -> None:
    iso = next(float(value) for value in np.unique(ramp) if value > 0.4 and (0.1 < 255.0 * value % 1.0 < 0.5) == rounded_down)
    crop = crop_map(VoxelMap.whole(ramp), iso)
    labels = np.where(ramp >= np.float32(iso), 2, 0).astype(np.uint16)
    labels[:, :, 6:] = 1
    shown = restricted(crop, labels, 2).array
    np.testing.assert_array_equal(shown / 255.0 >= crop.iso, (labels == 2)[crop.box])
    # Elsewhere the map is as it was: by it the surface is smooth.
    well_below, well_above = ramp[crop.box] < iso - 0.01, (ramp[crop.box] > iso + 0.01) & (labels == 2)[crop.box]
    for as_it_was in (well_below, well_above):
        assert as_it_was.any()
        np.testing.assert_array_equal(shown[as_it_was], crop.array[as_it_was])


def test_a_crop_of_a_threshold_of_0_encloses_just_the_labelled_voxels_too(ramp: np.ndarray) -> None:
    labels = np.zeros(ramp.shape, dtype=np.uint8)
    labels[:, :, 6:] = 1
    shown = restricted(crop_map(VoxelMap.whole(ramp), 0.0), labels, 1)
    np.testing.assert_array_equal(shown.array / 255.0 >= shown.iso, labels[shown.box] == 1)


def test_the_crops_of_a_segmentation_show_its_segments(session: SegmentationSession, spheres: Spheres) -> None:
    first, second, _ = requests_of(spheres)
    # Of two classes that claim the same voxels, the upper one has them.
    requests = [first, second, replace(first, id="the same")]
    crops = SegmentCrops()
    labels = session.segment(requests, on_map=crops.take).labels
    shown = crops.of(labels)
    assert np.unique(labels).tolist() == [0, 1, 2]
    assert len(shown) == len(requests)
    for label, crop in enumerate(shown, start=1):
        on_volume = crop.on(session.volume.geometry)
        whole = np.zeros(labels.shape, dtype=bool)
        whole[crop.box] = on_volume.array / 255.0 >= on_volume.iso
        np.testing.assert_array_equal(whole, labels == label)
        corner = np.array([[extent.start for extent in crop.box[::-1]]], dtype=float)
        np.testing.assert_allclose(
            on_volume.geometry.ijk_to_ras_points(np.zeros((1, 3))), session.volume.geometry.ijk_to_ras_points(corner)
        )
