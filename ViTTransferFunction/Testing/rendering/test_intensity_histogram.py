"""Histograms of balls whose intensities, and those around them, are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
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
    fat_alone, with_air = (
        share(intensity_histogram(volume((60, 60, 60), 1.0, reach_mm), 1), "outside", FAT)
        for reach_mm in (NEIGHBOURHOOD_MM + 1.0, 0.5 * NEIGHBOURHOOD_MM)
    )
    assert fat_alone == pytest.approx(1.0, abs=0.01)
    assert 0.2 < with_air < 0.8
    # As many voxels of fat are four times as many millimetres.
    coarse = intensity_histogram(volume((60, 60, 60), 4.0, 4.0 * 0.5 * NEIGHBOURHOOD_MM), 1)
    assert share(coarse, "outside", FAT) == pytest.approx(1.0, abs=0.01)


def test_what_is_drawn_begins_and_ends_where_intensities_do() -> None:
    histogram = intensity_histogram(volume((40, 40, 40), 1.0, reach_mm=50.0), 1)
    assert LEVELS[FAT] - 100.0 < histogram.edges[0] < LEVELS[FAT]
    assert LEVELS[VESSEL] < histogram.edges[-1] < LEVELS[VESSEL] + 100.0


def test_air_around_a_structure_leaves_room_for_its_own_intensities() -> None:
    shown = volume((40, 40, 40), 1.0, reach_mm=2.0)
    shown.voxels[shown.voxels[..., INTENSITY] == VESSEL, INTENSITY] = LIVER + 4
    histogram = intensity_histogram(shown, 1)
    own = LEVELS[LIVER + 4] - LEVELS[LIVER]
    assert histogram.edges[0] < LEVELS[LIVER] < LEVELS[LIVER + 4] < histogram.edges[-1]
    assert histogram.edges[-1] - histogram.edges[0] < 8.0 * own
    assert share(histogram, "outside", AIR) == 0.0


def test_a_structure_that_is_finer_than_the_sample_is_found() -> None:
    shown = volume((220, 220, 220), 1.0)
    assert shown.voxels[..., 0].size > 8 * SAMPLED_VOXELS
    shown.voxels[..., NUMBER] = 1
    shown.voxels[101, 101:103, 101, NUMBER] = 2
    shown.voxels[101, 101:103, 101, INTENSITY] = LIVER + 10
    histogram = intensity_histogram(shown, 1)
    assert share(histogram, "inside", LIVER + 10) == pytest.approx(1.0, abs=0.01)
    assert share(histogram, "outside", LIVER) > 0.5


def test_a_structure_without_voxels_has_an_empty_histogram() -> None:
    shown = volume((20, 20, 20), 1.0)
    shown.voxels[..., DEPTH] = 0
    histogram = intensity_histogram(shown, 1)
    assert (histogram.edges[0], histogram.edges[-1]) == (LEVELS[0], LEVELS[-1])
    assert not histogram.inside.any()
    assert not histogram.outside.any()


def test_around_a_structure_of_a_small_specimen_is_as_much_of_it_as_of_a_body() -> None:
    body, specimen = volume((60, 60, 60), 1.0, 0.5 * NEIGHBOURHOOD_MM), volume((60, 60, 60), 0.1, 0.05 * NEIGHBOURHOOD_MM)
    # A 200th of the scan's longest edge, which is 60 mm and 6 mm.
    of_body, of_specimen = (intensity_histogram(replace(shown, unit_voxels=0.3), 1) for shown in (body, specimen))
    np.testing.assert_array_equal(of_specimen.outside, of_body.outside)
