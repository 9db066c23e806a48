"""The bilateral solver against a dense float64 solution of its energy, and where inputs are extreme."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from ViTTransferFunction.Logic.bilateral_grid import GridLayout
from ViTTransferFunction.Logic.bilateral_solver import (
    BilateralSolution,
    BilateralSolverSettings,
    refine_map,
    solve_bilateral,
)
from ViTTransferFunction.Logic.bilateral_system import BISTOCHASTISATION_STEPS, CONFIDENCE_FLOOR, MAX_SMOOTHNESS
from ViTTransferFunction.Logic.errors import InputError
from ViTTransferFunction.Logic.upsampling import upsampled

UNIT_SPACING = (1.0, 1.0, 1.0)


@pytest.fixture(autouse=True)
def _one_thread():
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def some_settings(**changes) -> BilateralSolverSettings:
    exact = {"sigma_spatial_mm": 3.0, "sigma_luma": 0.1, "smoothness": 8.0, "max_iterations": 2000, "tolerance": 1e-6}
    return BilateralSolverSettings(**{**exact, "slicing": "nearest", **changes})


def a_noisy_step(shape=(8, 9, 10), seed=0):
    """A target that is blurred and noisy, and a luma that steps where the target should."""
    generator = torch.Generator().manual_seed(seed)
    along = torch.arange(shape[2]).expand(shape)
    luma = torch.where(along < shape[2] // 2, 0.3, 0.7) + 0.05 * torch.randn(shape, generator=generator)
    target = torch.sigmoid(along - shape[2] / 2.0) + 0.1 * torch.randn(shape, generator=generator)
    return target.clamp(0, 1), luma.clamp(0, 1)


def dense_solution(target, luma, confidence, cell_voxels, options):
    """Minimise the energy in float64 with a dense matrix; return each voxel's cell (as an index) and the cells' values."""
    target, luma, confidence = (np.asarray(a, np.float64) for a in (target, luma, confidence))
    cells = [np.indices(target.shape)[axis] // cell_voxels[axis] for axis in range(3)]
    cells.append(np.floor(np.clip(luma, 0, 1) / options.sigma_luma + 0.5).astype(int))
    occupied, of_voxel = np.unique(np.stack([c.ravel() for c in cells], 1), axis=0, return_inverse=True)
    of_voxel = of_voxel.ravel()
    count = len(occupied)
    distance = np.abs(occupied[:, None] - occupied[None]).sum(2)
    blur = 8.0 * (distance == 0) + (distance == 1)
    mass = np.bincount(of_voxel, minlength=count).astype(float)
    n = np.sqrt(mass / 16)
    for _ in range(BISTOCHASTISATION_STEPS):
        n = np.sqrt(n * mass / (blur @ n))
    laplacian = np.diag(n * (blur @ n)) - n[:, None] * blur * n
    c = np.bincount(of_voxel, confidence.ravel(), count)
    mean = (confidence * target).sum() / confidence.sum()
    floored = np.maximum(c, CONFIDENCE_FLOOR * (c / mass).max() * mass)
    ct = np.bincount(of_voxel, (confidence * target).ravel(), count) + (floored - c) * mean
    smoothness = min(options.smoothness, MAX_SMOOTHNESS * (c / mass).max())
    return occupied, of_voxel, np.linalg.solve(smoothness * laplacian + np.diag(floored), ct)


def dense_map(target, luma, confidence, solution: BilateralSolution, options):
    _, of_voxel, values = dense_solution(target, luma, confidence, solution.cell_voxels, options)
    return values[of_voxel].reshape(target.shape)


# --- The energy


def test_solution_minimises_the_energy():
    target, luma = a_noisy_step()
    options = some_settings()
    solution = solve_bilateral(target, luma, None, UNIT_SPACING, options)
    expected = dense_map(target, luma, torch.ones_like(target), solution, options)
    np.testing.assert_allclose(solution.map, expected, atol=1e-5)


def test_solution_minimises_the_energy_where_confidence_varies():
    target, luma = a_noisy_step()
    confidence = torch.rand(target.shape, generator=torch.Generator().manual_seed(1)) ** 4 * 5.0
    options = some_settings()
    solution = solve_bilateral(target, luma, confidence, UNIT_SPACING, options)
    np.testing.assert_allclose(solution.map, dense_map(target, luma, confidence, solution, options), atol=1e-5)


def test_multilinear_slice_interpolates_the_cells_around_a_voxel():
    target, luma = a_noisy_step()
    options = some_settings(slicing="multilinear")
    solution = solve_bilateral(target, luma, None, UNIT_SPACING, options)
    occupied, _, values = dense_solution(target, luma, torch.ones_like(target), solution.cell_voxels, options)
    value_of = {tuple(cell): value for cell, value in zip(occupied, values, strict=True)}

    def value_or_mean_of_values_around(*cell):
        around = itertools.product(*[(c - 1, c, c + 1) for c in cell])
        return value_of[cell] if cell in value_of else np.mean([value_of[c] for c in around if c in value_of])

    last_cell = occupied.max(axis=0)
    for voxel in itertools.product(range(0, 8, 3), range(9), range(10)):
        place = [(v - 0.5 * (edge - 1)) / edge for v, edge in zip(voxel, solution.cell_voxels, strict=True)]
        # A voxel beyond the outermost cells' centres lies at theirs.
        place = [*np.clip(place, 0, last_cell[:3]), float(luma[voxel]) / options.sigma_luma]
        expected = 0.0
        for corner in itertools.product(*[(int(np.floor(p)), int(np.floor(p)) + 1) for p in place]):
            weight = np.prod([1 - abs(p - c) for p, c in zip(place, corner, strict=True)])
            expected += weight * value_or_mean_of_values_around(*corner) if weight > 0 else 0.0
        assert float(solution.map[voxel]) == pytest.approx(expected, abs=1e-5)


def test_map_steps_where_the_image_does():
    target, luma = a_noisy_step((12, 12, 24))
    solution = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings(slicing="multilinear"))
    structure = torch.arange(24).expand(12, 12, 24) >= 12
    assert float(solution.map[structure].min()) > float(solution.map[~structure].max()) + 0.3


def test_result_does_not_depend_on_the_order_of_axes():
    target, luma = a_noisy_step((6, 9, 12))
    options = some_settings(sigma_spatial_mm=3.0, slicing="multilinear")
    straight = solve_bilateral(target, luma, None, (1.0, 1.5, 3.0), options)
    turned = solve_bilateral(target.permute(2, 0, 1), luma.permute(2, 0, 1), None, (3.0, 1.0, 1.5), options)
    np.testing.assert_allclose(turned.map.permute(1, 2, 0), straight.map, atol=1e-5)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_result_does_not_depend_on_the_direction_of_axes(axis):
    target, luma = a_noisy_step((6, 9, 12))
    options = some_settings(sigma_spatial_mm=3.0, slicing="multilinear")
    straight = solve_bilateral(target, luma, None, UNIT_SPACING, options)
    mirrored = solve_bilateral(target.flip(axis), luma.flip(axis), None, UNIT_SPACING, options)
    np.testing.assert_allclose(mirrored.map.flip(axis), straight.map, atol=1e-5)


@settings(max_examples=25, deadline=None)
@given(
    shape=st.tuples(*[st.integers(1, 9)] * 3),
    smoothness=st.floats(1e-3, 1e3),
    sigma_luma=st.floats(0.02, 2.0),
    seed=st.integers(0, 100),
)
def test_map_stays_within_the_range_of_its_target(shape, smoothness, sigma_luma, seed):
    target, luma = torch.rand(2, *shape, generator=torch.Generator().manual_seed(seed))
    options = some_settings(smoothness=smoothness, sigma_luma=sigma_luma, slicing="multilinear")
    refined = solve_bilateral(target, luma, None, UNIT_SPACING, options).map
    assert float(refined.min()) >= float(target.min()) - 1e-6
    assert float(refined.max()) <= float(target.max()) + 1e-6


def test_adding_a_constant_to_the_target_adds_it_to_the_map():
    target, luma = a_noisy_step()
    plain = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings())
    raised = solve_bilateral(target + 2.0, luma, None, UNIT_SPACING, some_settings())
    np.testing.assert_allclose(raised.map - 2.0, plain.map, atol=1e-5)


# --- From a coarse map


def test_refining_a_coarse_map_is_solving_for_its_upsampled_target():
    _, luma = a_noisy_step((12, 12, 12))
    coarse = torch.rand(3, 4, 5, generator=torch.Generator().manual_seed(2))
    refined = refine_map(coarse, luma * 400 - 100, (-100.0, 300.0), UNIT_SPACING, some_settings())
    solved = solve_bilateral(upsampled(coarse, luma.shape), luma, None, UNIT_SPACING, some_settings())
    np.testing.assert_allclose(refined.map, solved.map, atol=1e-5)


@pytest.mark.parametrize("shape", [(7, 9, 11), (3, 2, 1), (1, 1, 1)])
def test_upsampling_is_trilinear(shape):
    coarse = torch.rand(4, 3, 2, generator=torch.Generator().manual_seed(3))
    expected = torch.nn.functional.interpolate(coarse[None, None], size=shape, mode="trilinear", align_corners=False)
    torch.testing.assert_close(upsampled(coarse, shape), expected[0, 0])


@pytest.mark.parametrize("dtype", [torch.int16, torch.uint8, torch.int32, torch.float64])
def test_intensities_may_have_any_real_type(dtype):
    target, luma = a_noisy_step()
    counts = (luma * 200).round()
    expected = refine_map(target, counts, (0.0, 200.0), UNIT_SPACING, some_settings())
    np.testing.assert_array_equal(
        refine_map(target, counts.to(dtype), (0.0, 200.0), UNIT_SPACING, some_settings()).map, expected.map
    )


# --- Only where the map exceeds a threshold


def a_small_bright_region(n=30):
    target = torch.zeros(n, n, n)
    target[12:18, 12:18, 12:18] = 1.0
    luma = target * 0.5 + 0.2 + 0.02 * torch.rand(n, n, n, generator=torch.Generator().manual_seed(4))
    return target, luma


@pytest.mark.parametrize("slicing", ["nearest", "multilinear"])
def test_far_from_the_threshold_the_target_is_kept(slicing):
    target, luma = a_small_bright_region()
    target += 0.1 * torch.rand(target.shape, generator=torch.Generator().manual_seed(5))
    solution = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings(slicing=slicing), threshold=0.5)
    changed = solution.map != target
    assert bool(changed[12:18, 12:18, 12:18].all())
    assert not bool(changed[:9].any() | changed[21:].any() | changed[:, :9].any() | changed[:, :, 21:].any())


def test_fewer_cells_are_solved_for_where_a_threshold_is_given():
    target, luma = a_small_bright_region()
    everywhere = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings())
    near = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings(), threshold=0.5)
    assert 0 < near.cells < everywhere.cells / 10


def test_two_far_regions_are_solved_without_what_lies_between():
    luma = torch.full((6, 6, 60), 0.5)
    target = torch.zeros(6, 6, 60)
    target[..., :3] = target[..., -3:] = 1.0
    solution = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings(), threshold=0.5)
    assert solution.cells == 2 * 2 * 4


def test_map_below_the_threshold_everywhere_is_returned_as_it_is():
    target, luma = a_noisy_step()
    solution = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings(), threshold=1.5)
    assert solution.cells == 0
    assert solution.converged
    np.testing.assert_array_equal(solution.map, target)


# --- Extreme inputs


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("slicing", ["nearest", "multilinear"])
def test_voxels_without_intensity_keep_their_target_and_change_no_other(bad, slicing):
    target, luma = a_noisy_step()
    missing = torch.zeros(target.shape, dtype=torch.bool)
    missing[2:4, 3:5, 1:9] = True
    poisoned = torch.where(missing, bad, luma)
    solution = solve_bilateral(target, poisoned, None, UNIT_SPACING, some_settings(slicing=slicing))
    np.testing.assert_array_equal(solution.map[missing], target[missing])
    other_target = torch.where(missing, 0.5, target)
    other = solve_bilateral(other_target, poisoned, None, UNIT_SPACING, some_settings(slicing=slicing))
    np.testing.assert_array_equal(solution.map[~missing], other.map[~missing])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_voxels_without_target_have_no_confidence(bad):
    target, luma = a_noisy_step()
    missing = torch.rand(target.shape, generator=torch.Generator().manual_seed(6)) < 0.2
    solution = solve_bilateral(torch.where(missing, bad, target), luma, None, UNIT_SPACING, some_settings())
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


@pytest.mark.parametrize("slicing", ["nearest", "multilinear"])
def test_constant_map_stays_constant(slicing):
    _, luma = a_noisy_step()
    solution = solve_bilateral(torch.full(luma.shape, 0.3), luma, None, UNIT_SPACING, some_settings(slicing=slicing))
    np.testing.assert_allclose(solution.map, 0.3, atol=1e-6)
    assert solution.converged


@pytest.mark.parametrize("window", [(100.0, 100.0), (0.0, 200.0)])
def test_constant_volume_is_smoothed_in_space_only(window):
    target, luma = a_noisy_step()
    solution = refine_map(target, torch.full(target.shape, 100.0), window, UNIT_SPACING, some_settings())
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
    solution = refine_map(target, whole.to(dtype), (float(low), float(high)), UNIT_SPACING, some_settings())
    rounded_luma = (whole - low) / (high - low)
    expected = dense_map(target, rounded_luma, torch.ones_like(target), solution, some_settings())
    np.testing.assert_allclose(solution.map, expected, atol=1e-5)


@pytest.mark.parametrize("shape", [(1, 1, 1), (1, 9, 10), (8, 1, 10), (8, 9, 1), (1, 1, 10)])
@pytest.mark.parametrize("slicing", ["nearest", "multilinear"])
def test_single_voxels_rows_and_slices_are_solved(shape, slicing):
    target, luma = a_noisy_step(shape)
    solution = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings(slicing=slicing))
    assert solution.converged
    if slicing == "nearest":
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
        alike = torch.isclose(luma, torch.tensor(value))
        np.testing.assert_allclose(solution.map[alike], float(target[alike].mean()), atol=1e-6)


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
    solution = solve_bilateral(target, luma, None, (5.0, 0.5, 0.5), some_settings(sigma_spatial_mm=5.0))
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
def test_600_cells_along_an_axis_are_told_apart(axis):
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
    solution = solve_bilateral(target, luma, confidence, UNIT_SPACING, options)
    assert solution.converged
    np.testing.assert_allclose(solution.map, dense_map(target, luma, confidence, solution, options), atol=1e-4)


def test_smoothness_beyond_the_limit_is_reported_as_capped():
    target, luma = a_noisy_step()
    assert solve_bilateral(target, luma, None, UNIT_SPACING, some_settings(smoothness=1e8)).smoothness == MAX_SMOOTHNESS


def test_scaling_smoothness_and_confidence_alike_changes_nothing():
    target, luma = a_noisy_step()
    plain = solve_bilateral(target, luma, torch.ones_like(target), UNIT_SPACING, some_settings(smoothness=8.0))
    scaled = solve_bilateral(target, luma, torch.full_like(target, 1e-6), UNIT_SPACING, some_settings(smoothness=8e-6))
    np.testing.assert_allclose(scaled.map, plain.map, atol=1e-5)


# --- What is reported


def test_failing_to_converge_is_reported():
    target, luma = a_noisy_step()
    solution = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings(max_iterations=1))
    assert not solution.converged
    assert solution.iterations == 1
    assert solution.residual > 1e-6


def test_stricter_tolerance_takes_more_iterations_and_leaves_less():
    target, luma = a_noisy_step((20, 20, 20))
    loose = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings(tolerance=1e-2))
    strict = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings(tolerance=1e-5))
    assert loose.iterations < strict.iterations
    assert strict.residual <= 1e-5 < loose.residual <= 1e-2


def test_repeated_runs_are_bitwise_equal():
    target, luma = a_noisy_step((20, 20, 20))
    first, second = (solve_bilateral(target, luma, None, UNIT_SPACING) for _ in range(2))
    assert torch.equal(first.map, second.map)


@pytest.mark.parametrize("slicing", ["nearest", "multilinear"])
def test_number_of_threads_changes_no_bit(slicing):
    target, luma = a_noisy_step((40, 20, 20))
    one = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings(slicing=slicing))
    torch.set_num_threads(3)
    several = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings(slicing=slicing))
    assert torch.equal(one.map, several.map)


def test_pytorch_keeps_its_number_of_threads():
    target, luma = a_noisy_step()
    torch.set_num_threads(3)
    solve_bilateral(target, luma, None, UNIT_SPACING)
    assert torch.get_num_threads() == 3


def test_inputs_are_not_changed():
    target, luma = a_noisy_step()
    target[0, 0, 0] = torch.nan
    before = target.clone(), luma.clone()
    solve_bilateral(target, luma, torch.ones_like(target), UNIT_SPACING)
    torch.testing.assert_close(target, before[0], equal_nan=True)
    assert torch.equal(luma, before[1])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sigma_spatial_mm": 0.0}, "sigma_spatial_mm is 0.0"),
        ({"sigma_luma": float("nan")}, "sigma_luma is nan"),
        ({"smoothness": -1.0}, "smoothness is -1.0"),
        ({"tolerance": float("inf")}, "tolerance is inf"),
        ({"max_iterations": 0}, "max_iterations is 0"),
        ({"slicing": "cubic"}, "slicing is 'cubic'; expected one of multilinear, nearest"),
    ],
)
def test_settings_that_cannot_be_used_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        BilateralSolverSettings(**change)


def test_luma_of_another_shape_is_refused():
    with pytest.raises(InputError, match=r"luma has shape \(3, 3, 4\); expected \(3, 3, 3\)"):
        solve_bilateral(torch.zeros(3, 3, 3), torch.zeros(3, 3, 4), None, UNIT_SPACING)


def test_negative_confidence_is_refused():
    with pytest.raises(InputError, match="negative"):
        solve_bilateral(torch.zeros(3, 3, 3), torch.zeros(3, 3, 3), torch.full((3, 3, 3), -1.0), UNIT_SPACING)


@pytest.mark.parametrize("window", [(1.0, 0.0), (float("nan"), 1.0)])
def test_window_that_is_not_ascending_is_refused(window):
    with pytest.raises(InputError, match="ascending"):
        refine_map(torch.zeros(3, 3, 3), torch.zeros(3, 3, 3), window, UNIT_SPACING)


def test_spacing_that_is_not_positive_is_refused():
    with pytest.raises(InputError, match="spacing_mm"):
        solve_bilateral(torch.zeros(3, 3, 3), torch.zeros(3, 3, 3), None, (1.0, 0.0, 1.0))
