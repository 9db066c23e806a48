"""What the network sees of a volume."""

from __future__ import annotations

import numpy as np

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.network_channels import (
    CT_CHANNELS,
    CT_EVERYTHING,
    NetworkChannels,
    network_channels,
)


def volume_of(array: np.ndarray) -> Volume:
    return Volume(array, Geometry(array.shape, np.eye(4)))


def test_a_ct_is_seen_in_its_own_channels_and_another_scan_in_grey() -> None:
    ct = np.linspace(-1000.0, 1500.0, 1000).reshape(10, 10, 10)
    assert network_channels(volume_of(ct)) == CT_CHANNELS
    mr = network_channels(volume_of(np.linspace(0.0, 800.0, 1000).reshape(10, 10, 10)))
    assert mr == NetworkChannels.grey(mr.background)


def test_a_part_is_seen_as_the_whole_is() -> None:
    for low, high in ((-1000.0, 1500.0), (0.0, 800.0)):
        whole = volume_of(np.linspace(low, high, 1000).reshape(10, 10, 10))
        part = whole.part((slice(6, 10), slice(0, 5), slice(0, 5)))
        assert network_channels(part) == network_channels(whole)


def test_all_of_a_ct_is_told_apart_in_one_channel_and_soft_tissue_best() -> None:
    hounsfield = np.arange(-1000.0, 1001.0)
    shades = CT_EVERYTHING.apply(hounsfield)
    steps = np.diff(shades)
    assert (shades[0], shades[-1]) == (0.0, 1.0)
    assert (steps > 0.0).all()
    soft_tissue = (hounsfield[:-1] >= -160.0) & (hounsfield[:-1] < 240.0)
    assert steps[soft_tissue].min() > 3.0 * steps[~soft_tissue].max()


def test_colors_are_shades_also_of_voxels_that_are_no_numbers() -> None:
    odd = np.array([-np.inf, np.nan, -1e30, -3024.0, 0.0, 3071.0, 1e30, np.inf])
    for color in CT_CHANNELS.colors:
        shades = color.apply(odd)
        assert shades.dtype == np.float32
        assert (shades[[0, 1, 2, 3]] == 0.0).all()
        assert (shades[5:] == 1.0).all()


def test_grey_is_one_window_for_all() -> None:
    window = IntensityWindow(3.0, 9.0)
    grey = NetworkChannels.grey(window)
    assert {*grey.colors, grey.background} == {window}
