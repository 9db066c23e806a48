"""Histograms of balls whose intensities, and those around them, are known."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.geometry import Geometry
from ViTTransferFunction.Logic.rendering.composition import DEPTH, INTENSITY, NUMBER
from ViTTransferFunction.Logic.rendering.intensity_histogram import (
    NEIGHBOURHOOD_MM,
    SAMPLED_VOXELS,
    IntensityHistogram,
    intensity_histogram,
)
from ViTTransferFunction.Logic.rendering.structure_volume import StructureVolume

LEVELS = np.linspace(-1000.0, 1550.0, 256)
FAT, LIVER, VESSEL, AIR = 90, 105, 140, 0
"""Grey levels; the intensities are −100, 50, 400 and −1000."""


def volume(shape: tuple[int, int, int], spacing_mm: float, reach_mm: float = 5.0) -> StructureVolume:
    """A ball of liver with a vessel in its middle, number 2, in a cube of fat that ends `reach_mm` around it, in air."""
    middle = (np.array(shape) - 1) / 2
    kji = np.indices(shape) - middle[:, None, None, None]
    radius = min(shape) / 4
    ball, vessel = np.linalg.norm(kji, axis=0) <= radius, np.linalg.norm(kji[1:], axis=0) <= radius / 4
    fat = (abs(kji) <= radius + reach_mm / spacing_mm).all(axis=0)
    voxels = np.zeros((*shape, 4), np.uint8)
    voxels[..., INTENSITY] = np.select([ball & vessel, ball, fat], [VESSEL, LIVER, FAT], AIR)
    voxels[..., NUMBER] = np.where(ball, 2, 1)
    voxels[..., DEPTH] = np.where(ball, 255, 100)
    geometry = Geometry(shape, np.diag([spacing_mm, spacing_mm, spacing_mm, 1.0]))
    return StructureVolume(voxels, np.zeros((2, 2)), LEVELS, True, 1.0, geometry)


def share(histogram: IntensityHistogram, of: str, level: int, within: float = 30.0) -> float:
    """What lies about the intensity of a grey level."""
    middles = 0.5 * (histogram.edges[1:] + histogram.edges[:-1])
    return float(getattr(histogram, of)[abs(middles - LEVELS[level]) < within].sum())


@pytest.mark.parametrize("shape", [(30, 36, 40), (150, 150, 150)])
def test_a_structure_has_its_own_intensities_and_those_around_it_are_told_apart(shape: tuple[int, int, int]) -> None:
    shown = volume(shape, 1.0, reach_mm=NEIGHBOURHOOD_MM + 2.0)
    inside = shown.voxels[..., NUMBER] == 2
    vessel = float((shown.voxels[inside][:, INTENSITY] == VESSEL).mean())
    histogram = intensity_histogram(shown, 1)
    assert share(histogram, "inside", VESSEL) == pytest.approx(vessel, abs=0.02)
    assert share(histogram, "inside", LIVER) == pytest.approx(1.0 - vessel, abs=0.02)
    assert share(histogram, "inside", FAT) == 0.0
    assert share(histogram, "outside", FAT) == pytest.approx(1.0, abs=0.01)
    assert share(histogram, "outside", LIVER) == 0.0


def test_only_what_is_near_counts_as_around_in_millimetres() -> None:
    near, far = (intensity_histogram(volume((60, 60, 60), spacing_mm), 1) for spacing_mm in (1.0, 4.0))
    assert 0.3 < share(near, "outside", AIR) < 0.9
    # The fat ends as far from the ball, and a smaller part of what is around reaches beyond it.
    assert share(far, "outside", FAT) == pytest.approx(0.5, abs=0.35)
    assert near.edges[0] < LEVELS[AIR] < near.edges[-1]


def test_what_is_seen_begins_and_ends_where_intensities_do() -> None:
    histogram = intensity_histogram(volume((40, 40, 40), 1.0, reach_mm=50.0), 1)
    assert LEVELS[FAT] - 100.0 < histogram.edges[0] < LEVELS[FAT]
    assert LEVELS[VESSEL] < histogram.edges[-1] < LEVELS[VESSEL] + 100.0


def test_a_structure_that_is_finer_than_the_sample_is_found() -> None:
    shown = volume((220, 220, 220), 1.0)
    assert shown.voxels[..., 0].size > 8 * SAMPLED_VOXELS
    shown.voxels[..., NUMBER] = 1
    shown.voxels[101, 101:103, 101, NUMBER] = 2
    shown.voxels[101, 101:103, 101, INTENSITY] = VESSEL
    histogram = intensity_histogram(shown, 1)
    assert share(histogram, "inside", VESSEL) == pytest.approx(1.0, abs=0.01)
    assert share(histogram, "outside", LIVER) > 0.5


def test_a_structure_without_voxels_has_an_empty_histogram() -> None:
    shown = volume((20, 20, 20), 1.0)
    shown.voxels[..., DEPTH] = 0
    histogram = intensity_histogram(shown, 1)
    assert (histogram.edges[0], histogram.edges[-1]) == (LEVELS[0], LEVELS[-1])
    assert not histogram.inside.any()
    assert not histogram.outside.any()
