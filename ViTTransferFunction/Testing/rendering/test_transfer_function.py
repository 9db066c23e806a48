"""Classes where their maps and the intensities say."""

from __future__ import annotations

import numpy as np

from ViTTransferFunction.Logic.core.volumes.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.rendering.composition import (
    DEPTH,
    SURFACE,
    Composition,
    inside_histograms,
    own_levels,
)
from ViTTransferFunction.Logic.rendering.intensity_levels import gray_levels
from ViTTransferFunction.Logic.rendering.iso_surfaces import similarity_volume
from ViTTransferFunction.Logic.rendering.transfer_function import transfer_function_volume
from ViTTransferFunction.Testing.support.masks import dice
from ViTTransferFunction.Testing.support.views import ball

WINDOW = IntensityWindow(0.0, 200.0)


def inside(composition: Composition) -> np.ndarray:
    return composition.voxels()[..., DEPTH] > SURFACE


def noisy(mean: np.ndarray) -> np.ndarray:
    return (mean + np.random.default_rng(0).normal(0.0, 8.0, mean.shape)).astype(np.int16)


def test_the_transfer_function_follows_intensities_where_the_map_is_coarse() -> None:
    truth = np.zeros((60, 60, 60), dtype=bool)
    truth[15:45, 15:45, 15:45] = True
    intensities = noisy(np.where(truth, 140.0, 60.0))
    coarse = ball((10, 10, 10), (4.5, 4.5, 4.5), 3.0, width=3.0)
    by_map = inside(similarity_volume([coarse], [0.5]))
    by_map = by_map.repeat(2, axis=0).repeat(2, axis=1).repeat(2, axis=2)
    by_intensities = inside(transfer_function_volume(intensities, WINDOW, [coarse], [0.5]))
    assert dice(by_map, truth) < 0.9 < 0.95 < dice(by_intensities, truth)


def test_the_transfer_function_follows_the_map_where_intensities_tell_nothing() -> None:
    intensities = noisy(np.full((60, 60, 60), 100.0))
    similarity = np.rint(255 * ball((60, 60, 60), (29.5, 29.5, 29.5), 18.0)).astype(np.uint8)
    shown = inside(transfer_function_volume(intensities, WINDOW, [similarity], [0.5]))
    assert dice(shown, similarity > 127) > 0.93


def test_the_transfer_function_does_not_make_a_class_where_its_map_denies_it() -> None:
    intensities = noisy(np.where(np.arange(60) % 30 < 15, 140.0, 60.0) * np.ones((60, 60, 1)))
    similarity = np.rint(255 * ball((60, 60, 60), (29.5, 29.5, 7.0), 6.0)).astype(np.uint8)
    found = inside(transfer_function_volume(intensities, WINDOW, [similarity], [0.5]))
    assert found[..., :15].any()
    assert not found[..., 20:].any()


def test_a_structures_own_intensities_are_those_well_inside_it() -> None:
    similarity = np.rint(255 * ball((60, 60, 60), (29.5, 29.5, 29.5), 20.0)).astype(np.uint8)
    intensities: np.ndarray = np.full((60, 60, 60), 200.0)
    intensities[similarity > 127] = 80.0
    intensities[..., :30][similarity[..., :30] > 127] = 120.0
    voxels = similarity_volume([similarity], [0.5], (60, 60, 60)).voxels(
        gray_levels(intensities, np.arange(256.0), (60, 60, 60))
    )
    (histogram,) = inside_histograms(voxels, 1)
    assert np.flatnonzero(histogram).tolist() == [80, 120]
    assert own_levels(voxels, 1).tolist() == [[80.0, 120.0]]
