"""How many patches are run on a volume, whatever its shape and however much of it is air."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.extraction_plan import ExtractionPlan
from ViTTransferFunction.Logic.features.settings import FeatureSettings

MOST = 6_000
SETTINGS = FeatureSettings(grid=64, most_patches=MOST)


def volume_with_body(shape: tuple[int, int, int], filled: float) -> Volume:
    """Noise in the middle part `filled` of each slice's rows, air above and below."""
    array = np.full(shape, -1000, dtype=np.int16)
    rows = shape[1]
    start, stop = round(rows * (1 - filled) / 2), round(rows * (1 + filled) / 2)
    array[:, start:stop] = np.random.default_rng(0).integers(0, 200, (shape[0], stop - start, shape[2]))
    return Volume(array, Geometry(shape, np.eye(4)))


@pytest.mark.parametrize("filled", [1.0, 0.4])
@pytest.mark.parametrize("shape", [(64, 64, 64), (160, 40, 40), (8, 128, 128)], ids=["cube", "rod", "plate"])
def test_patches_stay_within_the_budget_and_use_most_of_it(shape: tuple[int, int, int], filled: float) -> None:
    patches = sum(ExtractionPlan(volume_with_body(shape, filled), SETTINGS).tokens_of_slices())
    assert 0.6 * MOST <= patches <= 1.1 * MOST


def test_where_half_is_air_the_body_is_seen_in_finer_patches() -> None:
    full, half = (ExtractionPlan(volume_with_body((64, 64, 64), filled), SETTINGS).shape for filled in (1.0, 0.4))
    assert half > full


def test_patches_are_never_smaller_than_cells_and_a_few_remain() -> None:
    volume = volume_with_body((64, 64, 64), 1.0)
    assert ExtractionPlan(volume, FeatureSettings(grid=8, most_patches=10**9)).shape == (8, 8, 8)
    assert ExtractionPlan(volume, FeatureSettings(grid=8)).shape == (8, 8, 8)
    assert ExtractionPlan(volume, FeatureSettings(grid=8, most_patches=1)).shape == (4, 4, 4)


def test_without_a_budget_each_cell_of_a_long_volume_has_a_patch() -> None:
    plan = ExtractionPlan(volume_with_body((160, 40, 40), 1.0), FeatureSettings(grid=8, largest_cell_mm=10.0))
    assert plan.shape == (16, 4, 4)


def test_slices_and_layers_that_are_run_count_and_not_cells() -> None:
    volume = volume_with_body((64, 64, 64), 1.0)
    every_layer, every_second, every_slice = (
        ExtractionPlan(volume, FeatureSettings(most_patches=MOST, **of_slices)).shape[0]
        for of_slices in ({}, {"layer_step": 2}, {"every_slice": True})
    )
    assert every_second > every_layer > every_slice


def test_of_a_slice_that_stands_for_layers_of_body_and_of_air_all_is_run() -> None:
    array = volume_with_body((64, 64, 64), 1.0).array.copy()
    array[24:] = -1000
    plan = ExtractionPlan(
        Volume(array, Geometry(array.shape, np.eye(4))), FeatureSettings(grid=8, layer_step=2, canonical=False)
    )
    run = {of_slice.sample.layers[-1][0]: len(of_slice.chosen.places) for of_slice in plan.slices if of_slice.axis == 0}
    # Up to layer 2 there is body. Slices lie in every second layer, and stand for those beside it as well.
    assert (run[1], run[3]) == (64, 64)
    assert run[5] < 64
