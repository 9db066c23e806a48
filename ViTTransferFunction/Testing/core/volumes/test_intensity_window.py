"""Windows of intensities, and which voxels they are chosen by."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes import intensity_window
from ViTTransferFunction.Logic.core.volumes.intensity_window import (
    CT_SOFT_TISSUE,
    IntensityWindow,
    display_window,
    finite_sample,
    looks_like_hounsfield_units,
    percentile_window,
    quantiles,
    telling_decimals,
    without_high_padding,
)
from ViTTransferFunction.Logic.core.volumes.orientation import Orientation
from ViTTransferFunction.Testing.support.volumes import stored_as, volume_of


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
@pytest.mark.parametrize("mirrored", [(False, False, False), (True, True, True), (False, True, False)])
def test_a_scan_is_looked_at_all_over_and_alike_however_it_is_stored(
    order: tuple[int, int, int], mirrored: tuple[bool, bool, bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every n-th voxel of the flattened array would be one of a single plane: each across I has as many as are looked at."""
    monkeypatch.setattr(intensity_window, "SAMPLE_SIZE", 2000)
    scan = volume_of(np.arange(30.0) + np.random.default_rng(0).random((40, 50, 30)))
    sample = finite_sample(scan)
    assert 1000 < len(sample) <= 2000
    np.testing.assert_allclose(np.percentile(sample, (5, 50, 95)), np.percentile(scan.array, (5, 50, 95)), atol=1.0)
    np.testing.assert_array_equal(finite_sample(stored_as(scan, Orientation(order, mirrored))), sample)


@pytest.mark.parametrize(
    ("outside", "inside", "is_ct"),
    [
        (-1000.0, 300.0, True),
        (-3024.0, 3071.0, True),  # Padded, with metal.
        (-1000.0, -600.0, False),
        (-1000.0, 1e5, False),
        (-1e4, 300.0, False),
        (0.0, 300.0, False),
    ],
)
def test_a_ct_is_known_by_air_and_by_what_is_no_air(outside: float, inside: float, is_ct: bool) -> None:
    scan = volume_of(np.where(np.indices((10, 12, 14))[0] < 3, outside, inside))
    assert looks_like_hounsfield_units(scan) == is_ct
    assert (display_window(scan) == CT_SOFT_TISSUE) == is_ct


@pytest.mark.parametrize("padding", [-8192.0, -32768.0])
def test_a_ct_whose_corners_are_padded_with_what_no_scanner_measures_is_one(padding: float) -> None:
    layers = np.indices((10, 12, 14))[0]
    ct = np.where(layers < 5, -1000.0, 300.0)
    assert looks_like_hounsfield_units(volume_of(np.where(layers < 2, padding, ct)))
    mr = np.where(layers < 5, 10.0, 300.0)
    assert not looks_like_hounsfield_units(volume_of(np.where(layers < 2, padding, mr)))
    spread = np.where(layers < 2, padding + np.arange(14.0), ct)
    assert not looks_like_hounsfield_units(volume_of(spread)), "what differs was measured"


HIGH_PADDINGS = [31743.0, 32767.0, 65535.0, 2.0**31, float(np.finfo(np.float32).max)]
"""31743: 32767 after an intercept of -1024."""


@pytest.mark.parametrize("padding", HIGH_PADDINGS)
def test_a_ct_whose_corners_are_padded_with_a_value_far_above_all_else_is_one(padding: float) -> None:
    layers = np.indices((10, 12, 14))[0]
    ct = np.where(layers < 5, -1000.0, 300.0)
    assert looks_like_hounsfield_units(volume_of(np.where(layers < 2, padding, ct)))
    mr = np.where(layers < 5, 10.0, 300.0)
    assert not looks_like_hounsfield_units(volume_of(np.where(layers < 2, padding, mr)))


@pytest.mark.parametrize("low", [-2000.0, -8192.0, -32768.0, -1e5])
@pytest.mark.parametrize("high", [32767.0, 65535.0])
def test_a_scan_that_is_padded_at_both_ends_is_seen_as_if_it_were_not_padded(low: float, high: float) -> None:
    """As where a CT with empty corners is put into a larger grid."""
    measured = np.random.default_rng(0).uniform(-1000.0, 1200.0, (30, 30, 30))
    ct, mr = measured.copy(), np.abs(measured)
    for scan in (ct, mr):
        scan[:4], scan[4:8] = high, low
    assert looks_like_hounsfield_units(volume_of(ct))
    assert without_high_padding(volume_of(ct)).array.max() == ct[8:].max()
    if low < intensity_window.LOWEST_CT:
        assert not looks_like_hounsfield_units(volume_of(mr))
        assert percentile_window(volume_of(mr)) == percentile_window(volume_of(mr[8:]))


@pytest.mark.parametrize("padding", HIGH_PADDINGS)
@pytest.mark.parametrize("outside_percent", [0.5, 0.02])
def test_what_is_padded_with_a_value_far_above_all_else_has_the_window_of_what_was_measured(
    padding: float, outside_percent: float
) -> None:
    mr = np.random.default_rng(0).uniform(10.0, 1200.0, (30, 30, 30))
    measured = percentile_window(volume_of(mr[8:]), outside_percent)
    mr[:8] = padding
    assert percentile_window(volume_of(mr), outside_percent) == measured


@pytest.mark.parametrize("padding", HIGH_PADDINGS)
def test_high_padding_is_drawn_as_the_lowest_intensity(padding: float) -> None:
    measured = np.random.default_rng(0).uniform(10.0, 1200.0, (30, 30, 30))
    assert without_high_padding(volume_of(measured)).array is measured
    padded = measured.copy()
    padded[:8] = padding
    drawn = without_high_padding(volume_of(padded))
    assert (drawn.array[:8] == measured[8:].min()).all()
    np.testing.assert_array_equal(drawn.array[8:], measured[8:])
    assert drawn.array.dtype == padded.dtype


def test_high_padding_of_whole_numbers_is_left_out_as_well() -> None:
    mr = np.random.default_rng(0).integers(10, 1200, (30, 30, 30)).astype(np.uint16)
    measured = percentile_window(volume_of(mr[8:]))
    mr[:8] = 65535
    assert percentile_window(volume_of(mr)) == measured


@pytest.mark.parametrize(
    ("highest", "within", "gap"),
    [(4095.0, False, True), (65535.0, True, True), (65535.0, False, False)],
    ids=["as scanners measure", "in the middle", "no gap below"],
)
def test_what_was_measured_belongs_to_the_window_however_high_it_is(highest: float, within: bool, gap: bool) -> None:
    """Metal and burnt-in marks lie within the scan, and what is clipped has neighbours of nearly its value."""
    scan = np.random.default_rng(0).uniform(500.0, 1200.0 if gap else highest, (30, 30, 30))
    place = (slice(8, 16),) * 3 if within else slice(8)
    scan[place] = highest
    assert percentile_window(volume_of(scan)).high == highest


def test_where_nearly_all_voxels_are_equal_the_others_are_seen() -> None:
    array = np.zeros((10, 12, 14))
    array[5, 6, 7] = 7.0
    assert display_window(volume_of(array)) == IntensityWindow(0.0, 7.0)


@pytest.mark.parametrize("padding", [-8192.0, -32768.0, -1e10, float(np.finfo(np.float32).min)])
def test_what_is_padded_with_what_no_scanner_measures_has_the_window_of_what_was_measured(padding: float) -> None:
    mr = np.random.default_rng(0).uniform(10.0, 1200.0, (30, 30, 30))
    measured = percentile_window(volume_of(mr[8:]))
    mr[:8] = padding
    assert percentile_window(volume_of(mr)) == measured


@pytest.mark.parametrize("lowest", [0.0, -1024.0, -32768.0])
def test_what_was_measured_belongs_to_the_window_however_low_it_is(lowest: float) -> None:
    """A background of one value, close below all else or where scanners measure, is as dark as it is."""
    scan = lowest + np.random.default_rng(0).uniform(500.0, 1200.0, (30, 30, 30))
    scan[:8] = lowest
    assert percentile_window(volume_of(scan)).low == lowest


def test_one_metal_voxel_does_not_move_the_window() -> None:
    array = np.random.default_rng(0).uniform(0.0, 100.0, (30, 30, 30))
    before = percentile_window(volume_of(array))
    array[3, 3, 3], array[4, 4, 4] = 30_000.0, np.nan
    after = percentile_window(volume_of(array))
    assert abs(after.high - before.high) < 1.0
    assert abs(after.low - before.low) < 1.0


def test_a_window_maps_to_zero_and_one_also_where_voxels_are_not_finite() -> None:
    window = IntensityWindow(-100.0, 300.0)
    mapped = window.apply(np.array([-1e9, -100.0, 100.0, 300.0, 1e9, np.nan, np.inf, -np.inf]))
    np.testing.assert_allclose(mapped, [0, 0, 0.5, 1, 1, 0, 1, 0])


@pytest.mark.filterwarnings("error")
def test_a_window_narrower_than_1_maps_the_largest_numbers_that_there_are() -> None:
    largest = float(np.finfo(np.float32).max)
    np.testing.assert_array_equal(IntensityWindow(0.0, 0.5).apply(np.array([-largest, 0.25, largest])), [0.0, 0.5, 1.0])


@pytest.mark.parametrize(
    "bounds",
    [
        (1.0, 1.0),
        (2.0, 1.0),
        (0.0, float("nan")),
        (float("-inf"), 0.0),
        (-1e308, 1e308),
        (0.0, 1e39),
        (-3e38, 3e38),
        (0.0, 1e-60),
    ],
)
def test_a_window_needs_two_increasing_bounds(bounds: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="lower first"):
        IntensityWindow(*bounds)


@pytest.mark.parametrize(("span", "decimals"), [(4000.0, 0), (1000.0, 0), (999.0, 1), (1.5, 3), (1e-4, 6), (0.0, 6)])
def test_a_thousandth_of_a_span_is_told_apart(span: float, decimals: int) -> None:
    assert telling_decimals(span) == decimals


def test_the_few_voxels_that_are_finite_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(intensity_window, "SAMPLE_SIZE", 10)
    array = np.full((10, 12, 14), np.nan)
    array[0, 0, 0], array[9, 11, 13] = 1.0, 2.0
    assert sorted(finite_sample(volume_of(array))) == [1.0, 2.0]


@pytest.mark.parametrize("kind", ["int8", "uint8", "int16", "uint16", "int32", "float32"])
def test_percentiles_are_the_same_whatever_kind_of_numbers_voxels_are(kind):
    """Of numbers as far apart as the kind has them: their differences are beyond it."""
    limits = np.iinfo(kind) if kind != "float32" else np.iinfo("int16")
    array = np.where(np.arange(1000).reshape(10, 10, 10) < 500, limits.min, limits.max).astype(kind)
    percents = [0.5, 30.0, 50.0, 99.5]

    np.testing.assert_array_equal(
        np.percentile(finite_sample(volume_of(array)), percents), np.percentile(array.astype(np.float64), percents)
    )


@pytest.mark.parametrize("dtype", [np.int8, np.uint8, np.int16, np.uint16])
@pytest.mark.parametrize("count", [1, 2, 7, 1000, 60_001])
def test_quantiles_of_whole_numbers_are_those_of_numpy_to_the_last_bit(count: int, dtype: type) -> None:
    generator = np.random.default_rng(count)
    limits = np.iinfo(dtype)
    shares = np.concatenate([np.linspace(0.0, 1.0, 513), generator.random(200)])
    for values in (
        generator.integers(limits.min, limits.max, count, dtype=dtype, endpoint=True),
        np.clip(generator.normal(40.0, 20.0, count), limits.min, limits.max).astype(dtype),
        np.full(count, limits.min),
    ):
        sample = values.astype(np.int32)
        np.testing.assert_array_equal(quantiles(sample, shares), np.quantile(sample, shares))
        np.testing.assert_array_equal(quantiles(sample, np.array([0.5, 99.5]) / 100.0), np.percentile(sample, (0.5, 99.5)))


def test_quantiles_of_fractions_are_those_of_numpy() -> None:
    sample = np.random.default_rng(0).normal(size=1001)
    shares = np.linspace(0.0, 1.0, 33)
    np.testing.assert_array_equal(quantiles(sample, shares), np.quantile(sample, shares))
