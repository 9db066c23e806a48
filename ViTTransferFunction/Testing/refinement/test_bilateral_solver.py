"""The bilateral solver against a dense float64 solution of its energy."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.refinement import workers
from ViTTransferFunction.Logic.refinement.bilateral_solver import (
    BilateralSolverSettings,
    refine_map,
    solve_bilateral,
)
from ViTTransferFunction.Logic.refinement.upsampling import upsampled
from ViTTransferFunction.Testing.support.bilateral_reference import (
    UNIT_SPACING,
    a_noisy_step,
    dense_map,
    dense_system,
    solve_by_cell,
    some_settings,
    with_either_slice,
)
from ViTTransferFunction.Testing.support.torch_threads import torch_threads


@pytest.fixture(autouse=True)
def _one_thread():
    with torch_threads(1):
        yield


# --- The energy


def test_solution_minimises_the_energy():
    target, luma = a_noisy_step()
    options = some_settings()
    solution = solve_by_cell(target, luma, None, UNIT_SPACING, options)
    expected = dense_map(target, luma, torch.ones_like(target), solution, options)
    np.testing.assert_allclose(solution.map, expected, atol=1e-5)


def test_solution_minimises_the_energy_where_confidence_varies():
    target, luma = a_noisy_step()
    confidence = torch.rand(target.shape, generator=torch.Generator().manual_seed(1)) ** 4 * 5.0
    options = some_settings()
    solution = solve_by_cell(target, luma, confidence, UNIT_SPACING, options)
    np.testing.assert_allclose(solution.map, dense_map(target, luma, confidence, solution, options), atol=1e-5)


def test_multilinear_slice_interpolates_the_cells_around_a_voxel():
    target, luma = a_noisy_step()
    options = some_settings()
    solution = solve_bilateral(target, luma, None, UNIT_SPACING, options)
    system = dense_system(target, luma, torch.ones_like(target), solution.cell_voxels, options)
    value_of = {tuple(cell): value for cell, value in zip(system.cells, system.values, strict=True)}

    def value_or_mean_of_values_around(*cell):
        around = itertools.product(*[(c - 1, c, c + 1) for c in cell])
        return value_of[cell] if cell in value_of else np.mean([value_of[c] for c in around if c in value_of])

    last_cell = system.cells.max(axis=0)
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
    solution = solve_bilateral(target, luma, None, UNIT_SPACING, some_settings())
    structure = torch.arange(24).expand(12, 12, 24) >= 12
    assert float(solution.map[structure].min()) > float(solution.map[~structure].max()) + 0.3


def test_result_does_not_depend_on_the_order_of_axes():
    target, luma = a_noisy_step((6, 9, 12))
    options = some_settings(sigma_spatial_mm=3.0)
    straight = solve_bilateral(target, luma, None, (1.0, 1.5, 3.0), options)
    turned = solve_bilateral(target.permute(2, 0, 1), luma.permute(2, 0, 1), None, (3.0, 1.0, 1.5), options)
    np.testing.assert_allclose(turned.map.permute(1, 2, 0), straight.map, atol=1e-5)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_result_does_not_depend_on_the_direction_of_axes(axis):
    target, luma = a_noisy_step((6, 9, 12))
    options = some_settings(sigma_spatial_mm=3.0)
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
    options = some_settings(smoothness=smoothness, sigma_luma=sigma_luma)
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


def test_a_large_map_of_little_that_is_high_is_refined_in_place_without_a_copy_of_it() -> None:
    # A part of a larger array, as a class's map is; what is high lies in two of its corners, so that the part is large.
    part = torch.zeros(210, 170, 170)[5:-5, 5:-5, 5:-5]
    part[:4, :4, :4], part[-4:, -4:, -4:] = 0.9, 0.9
    counts = torch.rand(part.shape, generator=torch.Generator().manual_seed(2)) * 200.0
    expected = refine_map(part.clone(), counts, (0.0, 200.0), UNIT_SPACING, some_settings(), threshold=0.3).map
    with torch.autograd.profiler.profile(profile_memory=True) as profiler:
        refine_map(part, counts, (0.0, 200.0), UNIT_SPACING, some_settings(), threshold=0.3, in_place=True)
    # A byte for each voxel would be a quarter of the map.
    assert max(event.self_cpu_memory_usage for event in profiler.function_events) < 0.2 * part.nbytes
    torch.testing.assert_close(part, expected)


@with_either_slice
def test_far_from_the_threshold_the_target_is_kept(solve):
    target, luma = a_small_bright_region()
    target += 0.1 * torch.rand(target.shape, generator=torch.Generator().manual_seed(5))
    solution = solve(target, luma, None, UNIT_SPACING, some_settings(), threshold=0.5)
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


@with_either_slice
def test_number_of_threads_changes_no_bit(solve, monkeypatch):
    target, luma = a_noisy_step((40, 20, 20))
    one = solve(target, luma, None, UNIT_SPACING, some_settings())
    monkeypatch.setattr(workers, "SHARED_VOXELS", 1)
    with torch_threads(3):
        several = solve(target, luma, None, UNIT_SPACING, some_settings())
    assert torch.equal(one.map, several.map)


@pytest.mark.parametrize(
    ("constant", "value"),
    [
        ("bilateral_energy.CHUNK_CELLS", 7),
        ("bilateral_grid.PIECE_VOXELS", 30),
        ("bilateral_grid.RUN_CELLS", 1),
        ("bilateral_slice.BAND_NUMBERS", 1),
    ],
)
@pytest.mark.parametrize("threshold", [None, 0.5])
def test_working_in_small_pieces_changes_no_bit(constant, value, threshold, monkeypatch):
    target, luma = a_noisy_step((9, 14, 20))
    options = some_settings()
    whole = solve_bilateral(target, luma, None, UNIT_SPACING, options, threshold)
    monkeypatch.setattr(f"ViTTransferFunction.Logic.refinement.{constant}", value)
    pieces = solve_bilateral(target, luma, None, UNIT_SPACING, options, threshold)
    assert torch.equal(pieces.map, whole.map)


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
