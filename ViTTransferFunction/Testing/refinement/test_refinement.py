"""From a coarse map to one that follows the image: what intensities add, and what refinement leaves alone."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from ViTTransferFunction.Logic.core.classes.class_map import NEAR_SHARE_OF_ISO
from ViTTransferFunction.Logic.core.system.errors import Cancelled, InputError
from ViTTransferFunction.Logic.core.volumes.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.core.volumes.orientation import Orientation
from ViTTransferFunction.Logic.features.settings import LARGEST_GRID
from ViTTransferFunction.Logic.refinement import bilateral_grid, guided_filter
from ViTTransferFunction.Logic.refinement.bilateral_grid import GridLayout
from ViTTransferFunction.Logic.refinement.guided_filter import GuidedFilterSettings
from ViTTransferFunction.Logic.refinement.intensity_likelihood import LARGEST_LOG_RATIO, TEMPER, weigh_by_intensity
from ViTTransferFunction.Logic.refinement.refinement import (
    REFINEMENT_METHODS,
    SIGMA_SHARE_OF_CELL,
    RefinementMethod,
    class_window,
    refine,
)
from ViTTransferFunction.Testing.support.masks import dice
from ViTTransferFunction.Testing.support.volumes import stored_as, volume_of

WINDOW = IntensityWindow(0.0, 200.0)
LARGEST_FACTOR = np.exp(TEMPER * LARGEST_LOG_RATIO)


def ball_and_its_map(edge: int = 40, radius: float = 9.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A ball of 120 among 60 with noise, its mask, and a map of it that is several voxels too soft."""
    axis = np.arange(edge) - (edge - 1) / 2
    inside = (axis[:, None, None] ** 2 + axis[:, None] ** 2 + axis**2) < radius**2
    intensities = np.where(inside, 120.0, 60.0) + np.random.default_rng(0).normal(0.0, 15.0, inside.shape)
    return intensities.astype(np.float32), inside, ndimage.gaussian_filter(inside.astype(np.float32), 4.0)


def coarse(similarity: np.ndarray, factor: int = 4) -> np.ndarray:
    edge = similarity.shape[0] // factor
    return similarity.reshape(edge, factor, edge, factor, edge, factor).mean(axis=(1, 3, 5))


def refined(array: np.ndarray, similarity: np.ndarray, method: RefinementMethod, iso: float = 0.35) -> np.ndarray:
    centre = np.full((1, 3), (array.shape[0] - 1) / 2)
    return refine(coarse(similarity), volume_of(array), WINDOW, centre, iso, method).array


def weighed_by_intensity(
    similarity: np.ndarray, intensities: np.ndarray, iso: float = 0.35, near: float | None = None
) -> np.ndarray:
    result = similarity.copy()
    weigh_by_intensity(result, intensities, WINDOW, iso, NEAR_SHARE_OF_ISO * iso if near is None else near)
    return result


@pytest.mark.parametrize("stored", [Orientation((0, 1, 2), (True, False, True)), Orientation((2, 0, 1), (False, True, False))])
@pytest.mark.parametrize("method", REFINEMENT_METHODS)
def test_the_same_scan_stored_otherwise_is_refined_alike(method: RefinementMethod, stored: Orientation) -> None:
    """In a length that is no multiple of the grid's cells: they begin at the same end of the patient."""
    array, _, similarity = (each[7:32, 7:32, 7:32] for each in ball_and_its_map())
    cells, volume, centre = coarse(similarity, factor=5), volume_of(array), np.full((1, 3), 12.5)
    expected = refine(cells, volume, WINDOW, centre, 0.35, method).array
    turned = np.ascontiguousarray(stored.to_canonical(cells))
    found = refine(turned, stored_as(volume, stored), WINDOW, centre, 0.35, method).array
    np.testing.assert_allclose(found, stored.to_canonical(expected), atol=1e-3)


def test_voxels_with_the_structures_intensities_gain_and_others_lose() -> None:
    intensities, inside, similarity = ball_and_its_map()
    weighed = weighed_by_intensity(similarity, intensities)
    border = (similarity > 0.25) & (similarity < 0.5)
    assert (weighed[border & inside] > similarity[border & inside]).mean() > 0.9
    assert (weighed[border & ~inside] < similarity[border & ~inside]).mean() > 0.9
    assert dice(weighed > 0.35, inside) > dice(similarity > 0.35, inside) + 0.02


@pytest.mark.parametrize("distinct", [False, True])
def test_the_ratio_is_bounded_and_far_voxels_are_left_as_they_are(distinct: bool) -> None:
    intensities, inside, similarity = ball_and_its_map()
    if distinct:
        intensities, similarity = np.where(inside, 180.0, 20.0), ndimage.gaussian_filter(inside.astype(np.float32), 0.7)
    weighed = weighed_by_intensity(similarity, intensities)
    factor = weighed[similarity > 0.175] / similarity[similarity > 0.175]
    assert factor.max() <= LARGEST_FACTOR * 1.0001
    assert factor.min() >= 1.0 / LARGEST_FACTOR * 0.9999
    assert (factor.min() <= 1.0 / LARGEST_FACTOR * 1.0001) == distinct
    np.testing.assert_array_equal(weighed[similarity <= 0.175], similarity[similarity <= 0.175])


def test_what_is_farther_from_the_structure_is_weighed_where_it_is_asked_for_and_alters_nothing_nearer() -> None:
    intensities, _, similarity = ball_and_its_map()
    usual, wide = (weighed_by_intensity(similarity, intensities, near=near) for near in (0.175, 0.05))
    np.testing.assert_array_equal(wide[similarity > 0.175], usual[similarity > 0.175])
    farther = (similarity > 0.05) & (similarity <= 0.175)
    assert (wide[farther] != similarity[farther]).mean() > 0.9
    np.testing.assert_array_equal(wide[similarity <= 0.05], similarity[similarity <= 0.05])


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_voxels_without_a_finite_intensity_keep_their_map_and_change_no_other(value: float) -> None:
    intensities, _, similarity = ball_and_its_map()
    damaged = intensities.copy()
    damaged[18:22] = value
    weighed = weighed_by_intensity(similarity, damaged)
    np.testing.assert_array_equal(weighed[18:22], similarity[18:22])
    np.testing.assert_allclose(weighed[10], weighed_by_intensity(similarity, intensities)[10], atol=0.05)


@pytest.mark.parametrize("iso", [0.0, 1e-30])
def test_the_least_iso_value_that_a_user_may_fix_gives_a_map(iso: float) -> None:
    intensities, _, similarity = ball_and_its_map()
    # Single precision has no squares of such values.
    similarity[:2] = 1e-30
    weighed = weighed_by_intensity(similarity.astype(np.float32), intensities, iso)
    assert weighed.min() >= 0.0
    assert weighed.max() <= 1.0


@pytest.mark.parametrize("similarity", [0.0, 0.35, 1.0])
def test_constant_maps_and_constant_volumes_have_a_defined_answer(similarity: float) -> None:
    flat = np.full((6, 6, 6), similarity, dtype=np.float32)
    weighed = weighed_by_intensity(flat, np.zeros(flat.shape, dtype=np.int16))
    # One intensity alone distinguishes nothing.
    np.testing.assert_allclose(weighed, flat, atol=1e-6)
    assert np.isfinite(weighed_by_intensity(flat, np.full(flat.shape, np.nan))).all()


@pytest.mark.parametrize("method", ["bilateral", "guided"])
def test_refinement_brings_the_surface_to_the_images_edge(method: RefinementMethod) -> None:
    intensities, inside, similarity = ball_and_its_map()
    unrefined = dice(refined(intensities, similarity, "none") > 0.35, inside)
    assert dice(refined(intensities, similarity, method) > 0.35, inside) > max(unrefined + 0.03, 0.93)


def test_a_structure_whose_grid_would_be_too_fine_to_hold_is_smoothed_over_more(monkeypatch: pytest.MonkeyPatch) -> None:
    intensities, inside, similarity = ball_and_its_map()
    monkeypatch.setattr(bilateral_grid, "MAX_DENSE_CELLS", 100_000)
    assert dice(refined(intensities, similarity, "bilateral") > 0.35, inside) > 0.93


def test_the_grid_of_the_largest_volume_in_the_finest_cells_can_be_held() -> None:
    for edge in (350, 512, 533, 1024):
        spacing = (1.0, 1.0, 1.0)
        wanted = max(SIGMA_SHARE_OF_CELL * edge / LARGEST_GRID, 2.0)
        fits = GridLayout.sigma_that_fits_mm((edge,) * 3, spacing, wanted, 10 / 255)
        assert wanted < fits < 1.5 * wanted
        GridLayout.of_sigmas((edge,) * 3, spacing, fits, 10 / 255)
    assert GridLayout.sigma_that_fits_mm((256,) * 3, (1.0, 1.0, 1.0), 2.4, 10 / 255) == 2.4


@pytest.mark.parametrize("method", REFINEMENT_METHODS)
def test_refined_maps_stay_between_zero_and_one_and_keep_what_is_far_from_the_structure(method: RefinementMethod) -> None:
    intensities, _, similarity = ball_and_its_map()
    similarity[:12] = 0.0
    result = refined(intensities, similarity, method)
    assert result.dtype == np.float32
    assert 0.0 <= result.min() <= result.max() <= 1.0
    np.testing.assert_array_equal(result[:4], refined(intensities, similarity, "none")[:4])


@pytest.mark.parametrize("method", REFINEMENT_METHODS)
def test_a_scan_that_is_a_mirrored_view_is_refined_as_its_copy(method: RefinementMethod) -> None:
    intensities, _, similarity = ball_and_its_map()
    mirrored = intensities[::-1, :, ::-1]
    np.testing.assert_array_equal(refined(mirrored, similarity, method), refined(mirrored.copy(), similarity, method))


@pytest.mark.parametrize("method", REFINEMENT_METHODS)
def test_a_map_below_its_iso_value_everywhere_is_only_interpolated(method: RefinementMethod) -> None:
    intensities, _, similarity = ball_and_its_map()
    faint = (0.1 * similarity).astype(np.float32)
    np.testing.assert_array_equal(refined(intensities, faint, method), refined(intensities, faint, "none"))


@pytest.mark.parametrize("method", ["bilateral", "guided"])
def test_all_that_reaches_the_threshold_is_refined_also_in_cells_below_it(method: RefinementMethod) -> None:
    intensities, *_ = ball_and_its_map(edge=28)
    cells = np.zeros((7, 7, 7), dtype=np.float32)
    cells[3, 3, 3] = 1.0
    unrefined, voxels = (
        refine(cells, volume_of(intensities), WINDOW, np.full((1, 3), 13.5), 0.1, each) for each in ("none", method)
    )
    reaches = unrefined.array >= 0.1
    assert reaches[13, 13].sum() > 4
    assert voxels.refined is not None
    reaches[voxels.refined] = False
    assert not reaches.any()


@pytest.mark.parametrize("method", REFINEMENT_METHODS)
def test_what_lies_far_from_a_small_structure_need_not_be_looked_at_again(method: RefinementMethod) -> None:
    intensities, _, similarity = ball_and_its_map(radius=5.0)
    voxels = refine(coarse(similarity), volume_of(intensities), WINDOW, np.full((1, 3), 19.5), 0.3, method)
    box = voxels.box_above(0.2)
    assert box is not None
    assert voxels.part(box).size < 0.5 * intensities.size
    outside = voxels.array.copy()
    outside[box] = 0.0
    assert outside.max() < 0.2


@pytest.mark.parametrize("method", REFINEMENT_METHODS)
@pytest.mark.parametrize("scale", [0.1, 1e-3])
def test_what_is_a_millimetre_large_is_refined_as_a_body_of_as_many_voxels(method: RefinementMethod, scale: float) -> None:
    intensities, _, similarity = ball_and_its_map()
    of_body, of_speck = (
        refine(coarse(similarity), volume, WINDOW, volume.geometry.ijk_to_ras_points(np.full((1, 3), 19.5)), 0.35, method)
        for volume in (volume_of(intensities, (edge, edge, edge)) for edge in (5.0, 5.0 * scale))
    )
    np.testing.assert_allclose(of_speck.array, of_body.array, atol=1e-6)


@pytest.mark.parametrize(("edge_mm", "radius_mm"), [(48.0, 3.0), (96.0, 6.0), (480.0, 6.0)])
def test_in_scans_of_bodies_the_guided_filter_looks_as_far_however_large_they_are(
    edge_mm: float, radius_mm: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    used: list[float] = []

    def guided(target: Any, luma: Any, spacing_mm: Any, settings: GuidedFilterSettings) -> Any:
        used.append(settings.radius_mm)
        return target

    monkeypatch.setattr(guided_filter, "guided_filter", guided)
    intensities, _, similarity = ball_and_its_map()
    volume = volume_of(intensities, (edge_mm / 40,) * 3)
    refine(coarse(similarity), volume, WINDOW, volume.geometry.ijk_to_ras_points(np.full((1, 3), 19.5)), 0.35, "guided")
    assert used == [pytest.approx(radius_mm)]


def test_an_unknown_method_is_refused_by_name() -> None:
    intensities, _, similarity = ball_and_its_map()
    with pytest.raises(InputError, match=r"'sharp'.*bilateral, guided, none"):
        refined(intensities, similarity, "sharp")  # type: ignore[arg-type]


def test_the_window_lies_about_most_of_the_clicked_intensities_not_between_two_kinds() -> None:
    array = np.full((8, 8, 8), 40.0)
    array[:4] = -1000.0
    gas, food = [[3.0, 3.0, 1.0], [4.0, 4.0, 1.0]], [[3.0, 3.0, 6.0], [4.0, 4.0, 6.0], [5.0, 2.0, 6.0]]
    window = class_window(volume_of(array), WINDOW, np.array(gas + food))
    assert (window.low, window.high) == (-60.0, 140.0)


@pytest.mark.parametrize(("low", "shown"), [(0.0, 40.0), (-1100.0, -1000.0), (-700.0, -1000.0), (-500.0, 40.0)])
@pytest.mark.parametrize("order", [1, -1])
def test_of_two_kinds_that_are_clicked_equally_often_the_one_nearer_to_what_the_user_looks_at_is_shown(
    low: float, shown: float, order: int
) -> None:
    array = np.full((8, 8, 8), 40.0)
    array[:4] = -1000.0
    points = np.array([[3.0, 3.0, 1.0], [3.0, 3.0, 6.0]])[::order]
    window = class_window(volume_of(array), IntensityWindow(low, low + 200.0), points)
    assert (window.low, window.high) == (shown - 100.0, shown + 100.0)


@pytest.mark.parametrize("unknown", [np.nan, np.inf])
@pytest.mark.parametrize("point", [[2.0, 2.0, 2.0], [2.3, 2.2, 2.1]])
def test_a_point_beside_a_voxel_without_intensity_counts_by_its_own(unknown: float, point: list[float]) -> None:
    array = np.full((8, 8, 8), 40.0)
    array[:4] = -1000.0
    array[3, 3, 3] = unknown
    with np.errstate(all="raise"):
        window = class_window(volume_of(array), IntensityWindow(-60.0, 140.0), np.array([point]))
    assert (window.low, window.high) == (-1100.0, -900.0)


def test_where_no_point_has_an_intensity_the_window_is_that_which_the_user_looks_at() -> None:
    array = np.random.default_rng(0).uniform(0.0, 200.0, (8, 8, 8))
    array[:4] = np.nan
    array[3, 3, 3] = np.inf
    points = np.array([[2.0, 2.0, 2.0], [3.0, 3.0, 3.0]])
    assert class_window(volume_of(array), WINDOW, points) == WINDOW


def test_a_lower_threshold_widens_what_is_refined_and_leaves_the_rest_nearly_as_it_was() -> None:
    intensities, _, similarity = ball_and_its_map()
    centre = np.full((1, 3), (intensities.shape[0] - 1) / 2)
    usual, wide = (
        refine(coarse(similarity), volume_of(intensities), WINDOW, centre, 0.35, "bilateral", lowest_iso=lowest).array
        for lowest in (None, 0.1)
    )
    unrefined = refine(coarse(similarity), volume_of(intensities), WINDOW, centre, 0.35, "none").array
    between = (unrefined > 0.06) & (unrefined < 0.15)
    assert (wide != unrefined)[between].mean() > 0.99
    assert (usual != unrefined)[between].mean() < 0.8
    assert dice(wide > 0.35, usual > 0.35) > 0.95


def test_a_refinement_is_given_up_between_any_two_of_its_many_steps() -> None:
    intensities, _, similarity = ball_and_its_map()
    centre = np.full((1, 3), (len(intensities) - 1) / 2)

    def steps_until(last: float) -> int:
        """How many steps are taken where the user clicks again at one of them."""
        counted = itertools.count(1)

        def between() -> None:
            if (steps := next(counted)) >= last:
                raise Cancelled(steps)

        refine(coarse(similarity), volume_of(intensities), WINDOW, centre, 0.35, "bilateral", between)
        return next(counted) - 1

    steps = steps_until(np.inf)
    slices = len(intensities)
    assert steps > 3 * slices, "slices are interpolated, looked at, weighed, and read from the solution"
    for last in (1, slices + 1, steps // 2, steps - 1, steps):
        with pytest.raises(Cancelled):
            steps_until(last)
