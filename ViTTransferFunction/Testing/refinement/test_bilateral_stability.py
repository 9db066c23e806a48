"""The bilateral solver where its inputs are extreme: each has a defined result."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.refinement.bilateral_energy import MAX_SMOOTHNESS
from ViTTransferFunction.Logic.refinement.bilateral_grid import GridLayout
from ViTTransferFunction.Logic.refinement.bilateral_solver import refine_map, solve_bilateral
from ViTTransferFunction.Testing.support.bilateral_reference import (
    UNIT_SPACING,
    a_noisy_step,
    dense_map,
    dense_residual,
    refine_by_cell,
    solve_by_cell,
    some_settings,
    with_either_slice,
)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@with_either_slice
def test_voxels_without_intensity_keep_their_target_and_change_no_other(bad, solve):
    target, luma = a_noisy_step()
    missing = torch.zeros(target.shape, dtype=torch.bool)
    missing[2:4, 3:5, 1:9] = True
    poisoned = torch.where(missing, bad, luma)
    solution = solve(target, poisoned, None, UNIT_SPACING, some_settings())
    np.testing.assert_array_equal(solution.map[missing], target[missing])
    other_target = torch.where(missing, 0.5, target)
    other = solve(other_target, poisoned, None, UNIT_SPACING, some_settings())
    np.testing.assert_array_equal(solution.map[~missing], other.map[~missing])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_voxels_without_target_have_no_confidence(bad):
    target, luma = a_noisy_step()
    missing = torch.rand(target.shape, generator=torch.Generator().manual_seed(6)) < 0.2
    solution = solve_by_cell(torch.where(missing, bad, target), luma, None, UNIT_SPACING, some_settings())
    expected = dense_map(target, luma, (~missing).float(), solution, some_settings())
    np.testing.assert_allclose(solution.map, expected, atol=1e-4)


def test_voxels_with_neither_target_nor_intensity_take_the_lowest_target():
    target, luma = a_noisy_step()
    target[0, 0, 0] = luma[0, 0, 0] = torch.nan
    solution = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings())
    assert float(solution.map[0, 0, 0]) == float(target[torch.isfinite(target)].min())


def test_map_without_any_finite_voxel_is_refused():
    with pytest.raises(InputError, match="no voxel of the map is finite"):
        solve_bilateral(torch.full((3, 3, 3), torch.nan), torch.zeros(3, 3, 3), None, UNIT_SPACING)


def test_volume_without_any_finite_voxel_leaves_the_map_as_it_is():
    target, _ = a_noisy_step()
    solution = solve_bilateral(target, torch.full(target.shape, torch.nan), None, UNIT_SPACING, some_settings())
    assert solution.cells == 0
    np.testing.assert_array_equal(solution.map, target)


@with_either_slice
def test_constant_map_stays_constant(solve):
    _, luma = a_noisy_step()
    solution = solve(torch.full(luma.shape, 0.3), luma, None, UNIT_SPACING, some_settings())
    np.testing.assert_allclose(solution.map, 0.3, atol=1e-6)
    assert solution.converged


@with_either_slice
def test_map_of_zeros_stays_zero(solve):
    _, luma = a_noisy_step()
    assert not bool(solve(torch.zeros(luma.shape), luma, None, UNIT_SPACING, some_settings()).map.any())


@pytest.mark.parametrize("magnitude", [1e-12, 1e12])
def test_tiny_and_huge_targets_are_solved_as_precisely(magnitude):
    target, luma = a_noisy_step()
    plain = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings())
    scaled = solve_bilateral(target * magnitude, luma, None, UNIT_SPACING, some_settings())
    np.testing.assert_allclose(scaled.map / magnitude, plain.map, atol=1e-5)


def test_cells_with_too_many_voxels_to_pack_their_sums_have_the_same_solution(monkeypatch):
    target, luma = a_noisy_step()
    packed = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings())
    monkeypatch.setattr("ViTTransferFunction.Logic.refinement.bilateral_cells.MAX_PACKED_VOXELS", 0)
    separate = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings())
    np.testing.assert_allclose(separate.map, packed.map, atol=1e-6)


@pytest.mark.parametrize("window", [(100.0, 100.0), (0.0, 200.0)])
def test_constant_volume_is_smoothed_in_space_only(window):
    target, luma = a_noisy_step()
    solution = refine_by_cell(target, torch.full(target.shape, 100.0), window, UNIT_SPACING, some_settings())
    expected = dense_map(target, torch.full_like(luma, 0.5), torch.ones_like(target), solution, some_settings())
    np.testing.assert_allclose(solution.map, expected, atol=1e-5)


def test_metal_changes_nothing_beyond_its_own_voxels():
    target, luma = a_noisy_step()
    hounsfield = luma * 400 - 100
    hounsfield[4, 4, 4] = 300.0
    top_of_window = refine_map(target, hounsfield, (-100.0, 300.0), UNIT_SPACING, some_settings())
    hounsfield[4, 4, 4] = 30_000.0
    metal = refine_map(target, hounsfield, (-100.0, 300.0), UNIT_SPACING, some_settings())
    np.testing.assert_array_equal(metal.map, top_of_window.map)


@pytest.mark.parametrize(("dtype", "low", "high"), [(torch.int16, -32768, 32767), (torch.uint16, 0, 65535)])
def test_full_range_of_16_bits_is_used(dtype, low, high):
    target, luma = a_noisy_step()
    whole = (luma.double() * (high - low) + low).round()
    solution = refine_by_cell(target, whole.to(dtype), (float(low), float(high)), UNIT_SPACING, some_settings())
    rounded_luma = (whole - low) / (high - low)
    expected = dense_map(target, rounded_luma, torch.ones_like(target), solution, some_settings())
    np.testing.assert_allclose(solution.map, expected, atol=1e-5)


@pytest.mark.parametrize("shape", [(1, 1, 1), (1, 9, 10), (8, 1, 10), (8, 9, 1), (1, 1, 10)])
@with_either_slice
def test_single_voxels_rows_and_slices_are_solved(shape, solve):
    target, luma = a_noisy_step(shape)
    solution = solve(target, luma, None, UNIT_SPACING, some_settings())
    assert solution.converged
    if solve is solve_by_cell:
        expected = dense_map(target, luma, torch.ones_like(target), solution, some_settings())
        np.testing.assert_allclose(solution.map, expected, atol=1e-5)
    else:
        assert bool(torch.isfinite(solution.map).all())


@pytest.mark.parametrize("shape", [(0, 5, 5), (5, 5), (1, 5, 5, 5)])
def test_volume_without_voxels_or_with_other_axes_is_refused(shape):
    with pytest.raises(InputError, match="expected three axes"):
        solve_bilateral(torch.zeros(shape), torch.zeros(shape), None, UNIT_SPACING)


def test_map_without_confidence_anywhere_is_returned_as_it_is():
    target, luma = a_noisy_step()
    solution = solve_bilateral(target, luma, torch.zeros_like(target), UNIT_SPACING, some_settings())
    assert solution.cells == 0
    np.testing.assert_array_equal(solution.map, target)


def test_region_without_confidence_takes_the_values_of_like_voxels_around_it():
    luma = torch.full((9, 9, 18), 0.2)
    luma[..., 9:] = 0.8
    target = (luma > 0.5).float()
    confidence = torch.ones_like(target)
    target[3:6, 3:6], confidence[3:6, 3:6] = 0.5, 0.0
    solution = solve_bilateral(target, luma, confidence, UNIT_SPACING, some_settings())
    np.testing.assert_allclose(solution.map, (luma > 0.5).float(), atol=0.01)


def test_isolated_cells_keep_their_own_mean():
    luma = torch.rand(3, 3, 3, generator=torch.Generator().manual_seed(7)).round() * 0.8
    target = torch.rand(3, 3, 3, generator=torch.Generator().manual_seed(8))
    solution = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings())
    for value in (0.0, 0.8):
        of_value = torch.isclose(luma, torch.tensor(value))
        np.testing.assert_allclose(solution.map[of_value], float(target[of_value].mean()), atol=1e-6)


def test_isolated_cell_without_confidence_takes_the_mean_of_the_target():
    target, luma = a_noisy_step()
    luma = luma * 0.5
    luma[0, 0, 0] = 1.0
    confidence = torch.ones_like(target)
    confidence[0, 0, 0] = 0.0
    solution = solve_bilateral(target, luma, confidence, UNIT_SPACING, some_settings())
    assert float(solution.map[0, 0, 0]) == pytest.approx(float((confidence * target).sum() / confidence.sum()), abs=1e-4)


def test_cells_are_equally_wide_in_millimetres_on_anisotropic_voxels():
    target, luma = a_noisy_step((4, 20, 20))
    solution = solve_by_cell(target, luma, None, (5.0, 0.5, 0.5), some_settings(sigma_spatial_mm=5.0))
    assert solution.cell_voxels == (1, 10, 10)
    expected = dense_map(target, luma, torch.ones_like(target), solution, some_settings())
    np.testing.assert_allclose(solution.map, expected, atol=1e-5)


def test_huge_sigmas_make_one_cell_of_everything():
    target, luma = a_noisy_step()
    solution = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings(sigma_spatial_mm=1e30, sigma_luma=1e30))
    assert solution.cells == 1
    np.testing.assert_allclose(solution.map, float(target.mean()), atol=1e-6)


def test_tiny_spatial_sigma_makes_a_cell_of_every_voxel():
    target, luma = a_noisy_step()
    solution = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings(sigma_spatial_mm=1e-9))
    assert solution.cells == target.numel()


def test_grid_that_would_not_fit_is_refused_before_it_is_made():
    target, luma = a_noisy_step()
    with pytest.raises(InputError, match="Raise either sigma"):
        solve_bilateral(target, luma, None, UNIT_SPACING, some_settings(sigma_luma=1e-9))


def test_grid_of_a_600_cubed_volume_fits_at_5_voxels_and_not_at_1():
    assert GridLayout.of_sigmas((600, 600, 600), UNIT_SPACING, 5.0, 10 / 255).cells == (120, 120, 120)
    with pytest.raises(InputError, match="expected at most"):
        GridLayout.of_sigmas((600, 600, 600), UNIT_SPACING, 1.0, 10 / 255)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_600_cells_along_an_axis_are_different_cells(axis):
    shape = [3, 3, 3]
    shape[axis] = 600
    target, luma = torch.rand(2, *shape, generator=torch.Generator().manual_seed(9))
    options = some_settings(sigma_spatial_mm=1.0, sigma_luma=1.0)
    solution = solve_bilateral(target, luma, None, UNIT_SPACING, options)
    assert solution.cells == target.numel()
    # A value at one end says nothing about the other.
    target.select(axis, 0).add_(5.0)
    changed = (solve_bilateral(target, luma, None, UNIT_SPACING, options).map - solution.map).abs()
    assert float(changed.select(axis, 0).min()) > 0.1
    assert float(changed.narrow(axis, 300, 300).max()) < 1e-5


@pytest.mark.parametrize("smoothness", [10.0**e for e in range(-6, 9, 2)])
@pytest.mark.parametrize("part_without_confidence", [False, True])
def test_float32_answer_agrees_with_float64_at_any_smoothness(smoothness, part_without_confidence):
    target, luma = a_noisy_step()
    confidence = torch.ones_like(target)
    if part_without_confidence:
        confidence[:, 4:] = 0.0
    options = some_settings(smoothness=smoothness)
    solution = solve_by_cell(target, luma, confidence, UNIT_SPACING, options)
    assert solution.converged
    np.testing.assert_allclose(solution.map, dense_map(target, luma, confidence, solution, options), atol=1e-4)


def test_long_chain_that_little_holds_is_solved_to_five_digits():
    # Half of a long row has no confidence, so that its values come from far away: float32 gets 3 digits right.
    target = (torch.arange(600) > 300).float().expand(1, 1, 600) + 0.1 * torch.rand(
        600, generator=torch.Generator().manual_seed(10)
    )
    confidence = torch.ones(1, 1, 600)
    confidence[..., 50:-50] = 0.0
    luma = torch.full_like(target, 0.5)
    options = some_settings(smoothness=1e3, sigma_spatial_mm=1.0)
    solution = solve_by_cell(target, luma, confidence, UNIT_SPACING, options)
    np.testing.assert_allclose(solution.map, dense_map(target, luma, confidence, solution, options), atol=1e-5)


@pytest.mark.parametrize("iterations", [1, 2])
def test_unconverged_map_stays_within_the_range_of_its_target(iterations):
    target, luma = torch.rand(2, 6, 5, 5, generator=torch.Generator().manual_seed(22)) ** 3
    options = some_settings(smoothness=100.0, sigma_spatial_mm=1.0, max_iterations=iterations)
    refined = solve_bilateral(target, luma, None, UNIT_SPACING, options).map
    assert float(refined.min()) >= float(target.min()) - 1e-6
    assert float(refined.max()) <= float(target.max()) + 1e-6


@pytest.mark.parametrize("seed", range(24))
def test_a_residual_whose_square_is_rounded_to_nothing_ends_the_iteration(seed):
    # In some of these, the curvature is rounded to 0 while there is still a residual.
    magnitude = 3e-18
    target, luma = a_noisy_step(seed=seed)
    plain = solve_by_cell(target, luma, None, UNIT_SPACING, some_settings())
    tiny = solve_by_cell(target * magnitude, luma, None, UNIT_SPACING, some_settings())
    assert tiny.iterations < some_settings().max_iterations
    np.testing.assert_allclose(tiny.map / magnitude, plain.map, atol=1e-4)


@pytest.mark.parametrize("magnitude", [1e-44, 1e-40, 1e-36, 1e-20, 1e20, 1e37])
def test_the_least_and_the_greatest_confidences_give_the_same_map(magnitude):
    target, luma = a_noisy_step()
    confidence = 0.5 + 0.5 * (torch.rand(target.shape, generator=torch.Generator().manual_seed(3)) > 0.5)
    plain = solve_bilateral(target, luma, confidence, UNIT_SPACING, some_settings())
    settings = some_settings(smoothness=some_settings().smoothness * magnitude)
    scaled = solve_bilateral(target, luma, confidence.double() * magnitude, UNIT_SPACING, settings)
    assert scaled.converged
    assert scaled.smoothness == pytest.approx(settings.smoothness)
    np.testing.assert_allclose(scaled.map, plain.map, atol=1e-5)


@pytest.mark.parametrize("max_iterations", [1, 2, 4])
def test_solution_is_better_than_the_residual_says(max_iterations):
    target, luma = a_noisy_step()
    settings = some_settings(max_iterations=max_iterations)
    solution = solve_by_cell(target, luma, None, UNIT_SPACING, settings)
    left = dense_residual(target, luma, torch.ones_like(target), solution, settings)
    assert 0.0 < left < 0.9 * solution.residual


def test_smoothness_beyond_the_limit_is_reported_as_capped():
    target, luma = a_noisy_step()
    assert solve_bilateral(target, luma, None, UNIT_SPACING, some_settings(smoothness=1e8)).smoothness == MAX_SMOOTHNESS


def test_scaling_smoothness_and_confidence_by_the_same_factor_changes_nothing():
    target, luma = a_noisy_step()
    plain = solve_bilateral(target, luma, torch.ones_like(target), UNIT_SPACING, some_settings(smoothness=8.0))
    scaled = solve_bilateral(target, luma, torch.full_like(target, 1e-6), UNIT_SPACING, some_settings(smoothness=8e-6))
    np.testing.assert_allclose(scaled.map, plain.map, atol=1e-5)
