"""The volume through a transfer function for each class, as colours and codes."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.rendering.iso_surfaces import similarity_rgba
from ViTTransferFunction.Logic.rendering.optical_properties import SURFACE
from ViTTransferFunction.Logic.rendering.transfer_function import transfer_function_rgba
from ViTTransferFunction.Testing.support.masks import dice
from ViTTransferFunction.Testing.support.views import ball

WINDOW = IntensityWindow(0.0, 200.0)
RED = (1.0, 0.0, 0.0)


def opaque(rgba: np.ndarray) -> np.ndarray:
    return rgba[..., 3] > SURFACE


def noisy(mean: np.ndarray) -> np.ndarray:
    return (mean + np.random.default_rng(0).normal(0.0, 8.0, mean.shape)).astype(np.int16)


def test_the_transfer_function_follows_intensities_where_the_map_is_coarse() -> None:
    truth = np.zeros((60, 60, 60), dtype=bool)
    truth[15:45, 15:45, 15:45] = True
    intensities = noisy(np.where(truth, 140.0, 60.0))
    coarse = ball((10, 10, 10), (4.5, 4.5, 4.5), 3.0, width=3.0)
    by_map = opaque(similarity_rgba([coarse], [0.5], [RED], [1.0]))
    by_map = by_map.repeat(2, axis=0).repeat(2, axis=1).repeat(2, axis=2)
    by_intensities = opaque(transfer_function_rgba(intensities, WINDOW, [coarse], [0.5], [RED], [1.0]))
    assert dice(by_map, truth) < 0.9 < 0.95 < dice(by_intensities, truth)


def test_the_transfer_function_follows_the_map_where_intensities_tell_nothing() -> None:
    intensities = noisy(np.full((60, 60, 60), 100.0))
    similarity = np.rint(255 * ball((60, 60, 60), (29.5, 29.5, 29.5), 18.0)).astype(np.uint8)
    shown = opaque(transfer_function_rgba(intensities, WINDOW, [similarity], [0.5], [RED], [1.0]))
    assert dice(shown, similarity > 127) > 0.93


def test_the_transfer_function_does_not_make_a_class_where_its_map_denies_it() -> None:
    intensities = noisy(np.where(np.arange(60) % 30 < 15, 140.0, 60.0) * np.ones((60, 60, 1)))
    similarity = np.rint(255 * ball((60, 60, 60), (29.5, 29.5, 7.0), 6.0)).astype(np.uint8)
    rgba = transfer_function_rgba(intensities, WINDOW, [similarity], [0.5], [RED], [1.0])
    assert opaque(rgba)[..., :15].any()
    assert not opaque(rgba)[..., 20:].any()


@pytest.mark.parametrize("dtype", [np.int16, np.uint16, np.float32])
def test_the_colour_of_a_class_is_brighter_where_the_volume_is(dtype: type) -> None:
    intensities = np.where(np.arange(60) < 30, 80.0, 160.0) * np.ones((60, 60, 1))
    similarity = np.rint(255 * ball((60, 60, 60), (29.5, 29.5, 29.5), 20.0)).astype(np.uint8)
    rgba = transfer_function_rgba(intensities.astype(dtype), WINDOW, [similarity], [0.5], [(1.0, 0.5, 0.0)], [1.0])
    dark, bright = (rgba[30, 30, i].astype(float) for i in (20, 40))
    assert dark[0] < 0.85 * bright[0]
    for color in (dark, bright):
        assert color[1] / color[0] == pytest.approx(0.5, abs=0.02)
        assert color[2] == 0.0
