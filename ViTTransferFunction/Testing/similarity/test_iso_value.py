"""The intensities' CDF, and iso values chosen where the image has edges."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.iso_proposals import LARGEST_ISO, SMALLEST_ISO
from ViTTransferFunction.Logic.similarity.intensity_cdf import IntensityCdf
from ViTTransferFunction.Logic.similarity.iso_value import (
    choose_iso_by_edges,
    choose_refined_iso,
    edge_strength_at,
    iso_between_points,
    prior_iso,
    proposals_around,
    raised_prior,
    refined_prior,
)
from ViTTransferFunction.Testing.support.volumes import volume_of

SPACING_MM = (2.0, 2.0, 2.0)


def test_the_prior_rises_from_a_fifth_with_the_first_points_and_then_stays() -> None:
    isos = [prior_iso(count) for count in (1, 2, 5, 6)]
    assert isos == sorted(set(isos))
    assert isos[0] == pytest.approx(0.2)
    assert prior_iso(100) == isos[-1] < 0.5


@pytest.mark.parametrize(("at_refined", "share"), [(0.8, 1.0), (0.4, 0.5**0.5), (0.01, 0.3**0.5), (1.0, 1.0)])
def test_the_refined_prior_follows_the_map_half_way_down(at_refined: float, share: float) -> None:
    assert refined_prior(0.2, np.full((3, 1), 0.8), np.full(3, at_refined)) == pytest.approx(0.2 * share)


def test_proposals_are_multiples_of_the_chosen_iso_value() -> None:
    proposals = proposals_around(0.2, np.full(3, 0.9))
    assert (proposals.smaller, proposals.chosen, proposals.larger) == pytest.approx((0.34, 0.2, 0.06))


def test_the_smaller_proposal_keeps_the_points_and_no_step_is_empty() -> None:
    proposals = proposals_around(0.4, np.array([0.5, 0.5, 0.9]))
    assert proposals.smaller == pytest.approx(0.475)
    tight = proposals_around(0.5, np.array([0.5]))
    assert tight.larger < tight.chosen < tight.smaller


@pytest.mark.parametrize("iso", [SMALLEST_ISO, 0.5, 0.94, LARGEST_ISO])
def test_all_proposals_are_iso_values(iso: float) -> None:
    proposals = proposals_around(iso, np.ones(2))
    assert 0.0 < proposals.larger <= proposals.chosen <= proposals.smaller < 1.0


@pytest.mark.parametrize("level", [0.2, 0.3, 0.45])
def test_the_iso_value_is_drawn_to_the_level_where_the_image_has_an_edge(level: float) -> None:
    similarity = np.linspace(0.0, 1.0, 20_000)
    edges = np.where(np.abs(np.log(np.maximum(similarity, 1e-6) / level)) < 0.15, 6.0, 0.5)
    flat = choose_iso_by_edges(similarity, np.ones_like(similarity), np.array([0.95]), prior_iso(3))
    drawn = choose_iso_by_edges(similarity, edges, np.array([0.95]), prior_iso(3))
    assert flat == pytest.approx(prior_iso(3), rel=0.1)
    assert drawn == pytest.approx(level, rel=0.15)


def test_the_iso_value_stays_below_half_of_the_map_at_the_positive_points() -> None:
    similarity = np.linspace(0.0, 1.0, 20_000)
    edges = np.where(similarity > 0.6, 5.0, 0.1)
    assert choose_iso_by_edges(similarity, edges, np.array([0.4]), 0.5) == pytest.approx(0.2)


@pytest.mark.parametrize(("at_points", "highest"), [([0.3, 0.9], 0.15), ([0.2, 0.4, 0.9], 0.2), ([0.2, 0.4, 0.8, 0.9], 0.2)])
def test_most_points_are_selected_and_of_two_both(at_points: list[float], highest: float) -> None:
    similarity = np.linspace(0.0, 1.0, 20_000)
    edges = np.where(similarity > 0.6, 5.0, 0.1)
    assert choose_iso_by_edges(similarity, edges, np.array(at_points), 0.5) == pytest.approx(highest)
    assert choose_refined_iso([(similarity, 1.0)], similarity, edges, np.array(at_points), 0.5) <= highest


def test_a_smaller_structure_still_holds_both_of_two_points() -> None:
    assert proposals_around(0.15, np.array([[0.2], [0.9]])).smaller == pytest.approx(0.19)


def test_an_empty_map_has_a_defined_iso_value() -> None:
    assert 0.0 < choose_iso_by_edges(np.zeros(10), np.ones(10), np.array([0.0]), 0.3) < 1.0


def test_negative_points_raise_a_prior_where_the_map_around_them_is_high() -> None:
    assert raised_prior(0.2, np.empty(0), 1) == 0.2
    assert raised_prior(0.2, np.array([0.05, 0.0]), 1) == 0.2
    assert raised_prior(0.2, np.array([0.15]), 1) == pytest.approx(0.3)
    # One of two such points says half as much, on a logarithmic scale, and so does one beside two positive points.
    assert raised_prior(0.2, np.array([0.0, 0.15]), 1) == pytest.approx(0.2 * np.sqrt(1.5))
    assert raised_prior(0.2, np.array([0.15]), 2) == pytest.approx(0.2 * np.sqrt(1.5))


@pytest.mark.parametrize(("negative", "positive"), [(1, 1), (3, 1), (1, 4)])
def test_a_prior_is_raised_by_no_more_than_the_negative_points_share(negative: int, positive: int) -> None:
    raised = raised_prior(0.2, np.full(negative, 1.0), positive)
    assert 0.2 < raised <= 0.2 * (1.0 + negative / positive) + 1e-12


def ball_map(radius: float = 10.0, softness: float = 0.4, inside: float = 0.7, outside: float = 0.15) -> np.ndarray:
    """A refined map of a ball: a plateau, a steep edge at the radius, and a slope around it that reaches zero; 48³ voxels."""
    axis = np.arange(48) - 23.5
    distance = np.sqrt(axis[:, None, None] ** 2 + axis[:, None] ** 2 + axis**2)
    slope = np.clip(outside * (1.0 - (distance - radius) / 14.0), 0.0, outside)
    edge = 1.0 / (1.0 + np.exp((distance - radius) / softness))
    return (slope + edge * (inside - 0.02 * distance - slope)).astype(np.float32)


def refined_iso(refined: np.ndarray, at_positive: float, prior: float) -> float:
    """Where the image has the same edge strength everywhere: stability decides."""
    sample = refined.ravel()[::7]
    return choose_refined_iso([(refined, 1.0)], sample, np.ones_like(sample), np.array([at_positive]), prior)


@pytest.mark.parametrize(("inside", "outside"), [(0.7, 0.15), (0.9, 0.05), (0.6, 0.2), (0.9, 0.25)])
@pytest.mark.parametrize("prior", [0.2, 0.35])
def test_the_iso_value_of_a_refined_map_lies_on_its_steep_edge(inside: float, outside: float, prior: float) -> None:
    iso = refined_iso(ball_map(inside=inside, outside=outside), inside, prior)
    assert outside < iso < inside - 0.2
    volume = np.count_nonzero(ball_map(inside=inside, outside=outside) > iso)
    assert volume == pytest.approx(4 / 3 * np.pi * 10.0**3, rel=0.2)


def test_a_refined_map_that_fades_inside_a_structure_is_cut_at_the_structures_edge() -> None:
    # Similar near the click alone, as in a large phantom without noise: nothing but the image says how far it reaches.
    axis = np.arange(48) - 23.5
    distance = np.sqrt(axis[:, None, None] ** 2 + axis[:, None] ** 2 + axis**2)
    refined = np.where(distance < 15.0, np.exp(-distance / 5.0), 0.0).astype(np.float32)
    edges = np.where(np.abs(distance - 15.0) < 1.0, 12.0, 0.3)
    iso = choose_refined_iso([(refined, 1.0)], refined.ravel(), edges.ravel(), np.array([1.0]), prior_iso(2))
    assert np.count_nonzero(refined > iso) > 0.9 * np.count_nonzero(distance < 15.0)


def test_the_iso_value_of_a_refined_map_does_not_depend_on_how_finely_it_is_sampled() -> None:
    fine = np.repeat(np.repeat(np.repeat(ball_map(), 3, 0), 3, 1), 3, 2)
    assert refined_iso(fine, 0.7, 0.25) == pytest.approx(refined_iso(ball_map(), 0.7, 0.25), rel=0.02)


def test_values_count_as_often_as_they_stand_for_voxels() -> None:
    refined = ball_map()
    sample, edges = refined.ravel()[::7], np.ones_like(refined.ravel()[::7])
    inner, outer = refined[8:40, 8:40, 8:40], refined.copy()
    outer[8:40, 8:40, 8:40] = 0.0
    whole = choose_refined_iso([(refined, 1.0)], sample, edges, np.array([0.7]), 0.25)
    assert choose_refined_iso([(inner, 1.0), (outer, 1.0)], sample, edges, np.array([0.7]), 0.25) == pytest.approx(whole)
    thinned = [(inner, 1.0), (outer[::2, ::2, ::2], 8.0)]
    assert choose_refined_iso(thinned, sample, edges, np.array([0.7]), 0.25) == pytest.approx(whole, rel=0.02)


def test_the_iso_value_of_a_refined_map_keeps_positive_points_inside_and_is_defined_for_flat_maps() -> None:
    assert refined_iso(ball_map(), 0.2, 0.4) <= 0.16 + 1e-9
    for level in (0.0, 0.005, 0.3, 1.0):
        assert 0.0 < refined_iso(np.full((8, 8, 8), level), level, 0.3) < 1.0


def test_ranks_are_shares_of_darker_voxels_whatever_the_scale() -> None:
    array = np.random.default_rng(0).gamma(2.0, 100.0, (20, 20, 20))
    points = volume_of(array, SPACING_MM).geometry.voxel_centres_ras()
    rank = IntensityCdf(volume_of(array, SPACING_MM)).at(points)
    expected = array.ravel().argsort().argsort() / array.size
    np.testing.assert_allclose(rank, expected, atol=0.005)
    np.testing.assert_allclose(IntensityCdf(volume_of(array**3, SPACING_MM)).at(points), rank, atol=0.005)


def test_ranks_of_a_neighbourhood_pass_over_voxels_that_are_not_finite() -> None:
    array = np.random.default_rng(0).normal(0.0, 1.0, (9, 9, 9))
    array[4, 4, 4] = np.nan
    array[:3, :3, :3] = np.nan
    volume = volume_of(array, SPACING_MM)
    rank, cells = IntensityCdf(volume), volume.geometry.resized((3, 3, 3))
    around = rank.around(np.array([[8.0, 8.0, 8.0], [0.0, 0.0, 0.0]]), cells)
    assert 0.2 < around[0] < 0.8
    assert around[1] == 0.0


def test_edge_strength_is_large_where_intensities_change() -> None:
    array = np.random.default_rng(0).normal(0.0, 1.0, (20, 20, 20))
    array[:, :, 10:] += 100.0
    volume = volume_of(array, SPACING_MM)
    points = volume.geometry.voxel_centres_ras()
    strength = edge_strength_at(IntensityCdf(volume), points, 2.0 * np.eye(3)).reshape(20, 20, 20)
    assert strength[:, :, 9:11].mean() > strength[:, :, :8].mean() * 1.3
    assert strength.mean() == pytest.approx(1.0, rel=1e-3)


def test_the_iso_value_lies_between_positives_and_negatives() -> None:
    iso = iso_between_points(np.array([0.8, 0.9]), np.array([0.5, 0.6]))
    assert 0.6 < iso < 0.8


def test_without_negatives_the_iso_value_is_half_of_the_positives() -> None:
    assert iso_between_points(np.array([0.8]), np.array([])) == pytest.approx(0.4)


@pytest.mark.parametrize("values", [0.0, 1.0])
def test_the_iso_value_never_selects_everything_or_nothing(values: float) -> None:
    assert 0.0 < iso_between_points(np.array([values]), np.array([values])) < 1.0
