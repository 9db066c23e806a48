"""Similarity learned from the clicks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.features.whitening import NormalisedFeatures, normalised_features
from ViTTransferFunction.Logic.similarity import kernel_rows, point_reach
from ViTTransferFunction.Logic.similarity.cell_intensities import CellIntensities
from ViTTransferFunction.Logic.similarity.connectedness import Connectedness
from ViTTransferFunction.Logic.similarity.iso_value import prior_iso
from ViTTransferFunction.Logic.similarity.kernel_ridge import KernelRidge
from ViTTransferFunction.Logic.similarity.ridge_systems import solve_each
from ViTTransferFunction.Logic.similarity.similarity_map import SimilarityMap

CELLS = (12, 12, 12)
LEFT, RIGHT = (slice(2, 6), slice(3, 9), slice(2, 5)), (slice(2, 6), slice(3, 9), slice(8, 11))
ABOVE = (slice(8, 11), slice(3, 9), slice(3, 10))


def blocks_in_noise(deviation: float) -> tuple[NormalisedFeatures, Volume]:
    """Two equal blocks on the left and right, another kind above, in a noisy background; 24³ voxels, 12³ cells."""
    kinds = np.zeros(CELLS, dtype=int)
    kinds[LEFT] = kinds[RIGHT] = 1
    kinds[ABOVE] = 2
    generator = np.random.default_rng(0)
    features = np.eye(3)[kinds] + 0.15 * generator.normal(size=(*CELLS, 3))
    voxels = np.repeat(np.repeat(np.repeat(np.array([0.0, 100.0, 60.0])[kinds], 2, 0), 2, 1), 2, 2)
    noisy = voxels + generator.normal(0, deviation, voxels.shape)
    volume = Volume(noisy, Geometry(voxels.shape, np.diag([2.0, 2.0, 2.0, 1.0])))
    geometry = volume.geometry.resized(CELLS)
    return normalised_features(FeatureVolume(features, geometry, "key"), "whitened"), volume


@pytest.fixture
def blocks() -> tuple[NormalisedFeatures, Volume]:
    return blocks_in_noise(3.0)


@pytest.fixture
def similarity(blocks: tuple[NormalisedFeatures, Volume]) -> KernelRidge:
    return KernelRidge(*blocks)


def at_cell(k: int, j: int, i: int) -> np.ndarray:
    return np.array([[4.0 * i + 1.0, 4.0 * j + 1.0, 4.0 * k + 1.0]])


def maps_of(rule: KernelRidge, classes: Sequence[ClassRequest]) -> list[np.ndarray]:
    return [of_class.array for _, of_class in rule.maps(classes)]


def a_class(name: str, positive: np.ndarray, **fields: object) -> ClassRequest:
    return ClassRequest(name, positive, **fields)  # type: ignore[arg-type]


IN_LEFT, IN_RIGHT, IN_ABOVE = at_cell(4, 6, 3), at_cell(4, 6, 9), at_cell(9, 6, 6)


def test_a_duplicate_has_the_map_of_the_original_and_does_not_alter_it(similarity: KernelRidge) -> None:
    original, other = a_class("a", IN_LEFT, negative=IN_RIGHT), a_class("b", IN_ABOVE)
    alone = maps_of(similarity, [original, other])
    duplicated = maps_of(similarity, [original, a_class("a copy", IN_LEFT, negative=IN_RIGHT), other])
    for index, expected in ((0, alone[0]), (1, alone[0]), (2, alone[1])):
        np.testing.assert_allclose(duplicated[index], expected, atol=0.01)


def test_a_click_can_be_given_up_whenever_systems_are_solved(similarity: KernelRidge, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a hundred structures, each time takes as long as all else."""
    asked, while_solving = [0], list[int]()

    def between() -> None:
        asked[0] += 1

    def counted(*arguments: Any) -> np.ndarray:
        before = asked[0]
        weights = solve_each(*arguments)
        while_solving.append(asked[0] - before)
        return weights

    monkeypatch.setattr("ViTTransferFunction.Logic.similarity.kernel_ridge.solve_each", counted)
    classes = [a_class("a", IN_LEFT, negative=IN_ABOVE), a_class("b", IN_RIGHT, negative=at_cell(0, 0, 0))]
    list(similarity.maps(classes, between))
    assert len(while_solving) > 2, "once, without cells of the background that are inside, and without negatives"
    assert min(while_solving) > 0


def test_one_click_finds_its_structure_and_not_the_others(similarity: KernelRidge) -> None:
    annotated = a_class("a", IN_LEFT)
    (found,) = maps_of(similarity, [annotated])
    iso = prior_iso(len(annotated.positive))
    assert (found[LEFT] > iso).mean() > 0.7
    assert (found[ABOVE] > iso).mean() < 0.1
    background = np.ones(CELLS, dtype=bool)
    background[LEFT] = background[RIGHT] = background[ABOVE] = False
    assert (found[background] > iso).mean() < 0.05


@pytest.mark.parametrize(("largest_rim", "least"), [(0.0, 0.91), (point_reach.LARGEST_RIM, 0.88)])
def test_points_that_reach_less_far_are_met_by_the_map_as_nearly_as_others(
    similarity: KernelRidge, monkeypatch: pytest.MonkeyPatch, largest_rim: float, least: float
) -> None:
    """Kernels reach as far in the equations as in the map: else it would miss points, or meet them with nothing to spare.

    The shorter the reach, the lower the map is there: where the point counts as one at a rim, it has 0.89, and would have 0.82
    or 0.96, with 1.00 at its neighbour.
    """
    monkeypatch.setattr(point_reach, "LARGEST_RIM", largest_rim)
    later = [at_cell(4, 6, 6), at_cell(4, 4, 6)]
    (found,) = maps_of(similarity, [a_class("a", np.concatenate([IN_LEFT, *later]))])
    for cell in ((4, 6, 3), (4, 6, 6), (4, 4, 6)):
        assert least < found[cell] < 0.99


def one_click_in_a_large_structure(within: float, around: float) -> tuple[np.ndarray, float, np.ndarray]:
    """The map of a structure of one intensity in surroundings of another, its iso value, and the structure, (K, J, I) bool."""
    cells = (16, 16, 16)
    inside = np.zeros(cells, dtype=bool)
    inside[2:14, 2:14, 2:14] = True
    angle = np.broadcast_to(np.linspace(0.0, 2.2, cells[2]), cells)
    generator = np.random.default_rng(0)
    # Its features turn from one side to the other, as an organ's do.
    features = np.stack([inside * np.cos(angle), inside * np.sin(angle), ~inside], axis=-1)
    features = features + 0.15 * generator.normal(size=features.shape)
    voxels = np.kron(np.where(inside, within, around), np.ones((2, 2, 2)))
    volume = Volume(voxels + generator.normal(0, 3, voxels.shape), Geometry(voxels.shape, np.diag([2.0, 2.0, 2.0, 1.0])))
    geometry = volume.geometry.resized(cells)
    rule = KernelRidge(normalised_features(FeatureVolume(features, geometry, "key"), "whitened"), volume)
    clicked = [a_class("a", at_cell(8, 8, 8))]
    ((_, found),) = rule.maps(clicked)
    return found.array, rule.iso(found, clicked, 0).chosen, inside


def test_one_click_in_a_large_structure_within_walls_takes_much_of_it_where_the_map_fades_long_before() -> None:
    # Alone in the dark, it is all of the body, and its map not raised.
    found, iso, inside = one_click_in_a_large_structure(100.0, 0.0)
    assert (found[inside] > iso).mean() > 0.4 > 2.0 * (found[inside] > prior_iso(1)).mean()
    assert not (found[~inside] > iso).any()


def test_one_click_in_a_large_structure_that_is_closed_takes_most_of_it() -> None:
    found, iso, inside = one_click_in_a_large_structure(0.0, 100.0)
    assert (found[inside] > iso).mean() > 0.6
    assert not (found[~inside] > iso).any()


def test_a_structure_is_more_similar_near_the_click_than_its_twin_far_away(similarity: KernelRidge) -> None:
    (found,) = maps_of(similarity, [a_class("a", IN_LEFT)])
    assert found[LEFT].mean() > 1.2 * found[RIGHT].mean()


def test_what_intensities_join_to_the_click_is_more_similar_than_its_twin_as_near(
    blocks: tuple[NormalisedFeatures, Volume],
) -> None:
    features, volume = blocks
    bridged = volume.array.copy()
    # Right: a bridge of the blocks' own intensity, which the network, knowing two kinds alone, does not see.
    bridged[4:12, 6:18, 10:16] = 100.0
    apart, joined = (KernelRidge(features, Volume(array, volume.geometry)) for array in (volume.array, bridged))
    to_twin = [maps_of(rule, [a_class("a", IN_LEFT)])[0][RIGHT].mean() for rule in (apart, joined)]
    assert to_twin[1] > 1.2 * to_twin[0]


def test_a_negative_click_takes_the_twin_away(similarity: KernelRidge) -> None:
    annotated = a_class("a", IN_LEFT, negative=IN_RIGHT)
    (found,) = maps_of(similarity, [annotated])
    assert (found[RIGHT] > prior_iso(len(annotated.positive))).mean() < 0.15
    assert (found[LEFT] > prior_iso(len(annotated.positive))).mean() > 0.65


def test_a_negative_click_well_within_a_surplus_makes_all_of_the_structure_end_earlier(similarity: KernelRidge) -> None:
    priors = {}
    for name, negative in (("none", np.empty((0, 3))), ("rim", at_cell(4, 6, 5)), ("twin", IN_RIGHT)):
        annotated = [a_class("a", IN_LEFT, negative=negative)]
        ((_, found),) = similarity.maps(annotated)
        assert found.prior is not None
        priors[name] = found.prior
        # The same map, had no negative point been counted.
        uncounted = similarity.iso(SimilarityMap(found.array, prior_iso(1)), annotated, 0).chosen
        assert similarity.iso(found, annotated, 0).chosen >= uncounted * (1.05 if name == "twin" else 1.0)
    assert priors["none"] == priors["rim"] == prior_iso(1)
    assert 1.2 * prior_iso(1) < priors["twin"] <= 2.0 * prior_iso(1)


def test_the_clicks_of_one_class_are_negatives_of_the_others(similarity: KernelRidge) -> None:
    alone = maps_of(similarity, [a_class("a", IN_LEFT)])[0]
    first, second = maps_of(similarity, [a_class("a", IN_LEFT), a_class("b", IN_RIGHT)])
    assert first[RIGHT].mean() < 0.5 * alone[RIGHT].mean()
    assert second[RIGHT].mean() > second[LEFT].mean()


def test_a_class_elsewhere_leaves_a_structure_as_large_as_it_is(similarity: KernelRidge) -> None:
    annotated = a_class("a", IN_LEFT)
    (alone,) = maps_of(similarity, [annotated])
    beside, _ = maps_of(similarity, [annotated, a_class("b", IN_ABOVE)])
    assert beside[LEFT].mean() == pytest.approx(alone[LEFT].mean(), rel=0.02)


def test_maps_do_not_depend_on_what_was_clicked_and_removed_before(similarity: KernelRidge) -> None:
    before = maps_of(similarity, [a_class("a", IN_LEFT)])
    maps_of(similarity, [a_class("a", np.concatenate([IN_RIGHT, IN_LEFT, IN_ABOVE]))])
    np.testing.assert_array_equal(maps_of(similarity, [a_class("a", IN_LEFT)]), before)


def test_the_order_of_classes_and_of_negative_points_does_not_matter(similarity: KernelRidge) -> None:
    negative = np.concatenate([IN_RIGHT, at_cell(1, 1, 1)])
    a, b = a_class("a", IN_LEFT, negative=negative), a_class("b", IN_ABOVE)
    a_reversed = a_class("a", IN_LEFT, negative=negative[::-1])
    np.testing.assert_allclose(maps_of(similarity, [a, b]), maps_of(similarity, [b, a_reversed])[::-1], atol=1e-5)


def test_a_second_click_on_what_looks_like_the_background_raises_little_of_that(
    blocks: tuple[NormalisedFeatures, Volume],
) -> None:
    beside, far = at_cell(4, 6, 6), (slice(0, 2), slice(0, 12), slice(0, 12))
    clicked = [a_class("a", np.concatenate([IN_LEFT, beside]))]
    ((_, found),) = KernelRidge(*blocks).maps(clicked)
    background_first = [a_class("a", np.concatenate([beside, IN_LEFT]))]
    ((_, without_an_end),) = KernelRidge(*blocks).maps(background_first)
    # Clicked first, the background is what is meant.
    assert found.array[far].mean() < 0.7 * without_an_end.array[far].mean()
    assert found.array[4, 6, 6] > 0.7 * without_an_end.array[4, 6, 6]
    assert (found.array[LEFT] > prior_iso(2)).mean() > 0.6


@pytest.mark.parametrize("then", [(1, 2), (0, 2), (2, 1, 0), (0,)], ids=str)
def test_points_that_are_removed_or_placed_anew_leave_nothing_behind(
    blocks: tuple[NormalisedFeatures, Volume], then: tuple[int, ...]
) -> None:
    points, rule = np.concatenate([IN_LEFT, at_cell(4, 6, 6), IN_ABOVE]), KernelRidge(*blocks)
    maps_of(rule, [a_class("a", points)])
    wanted = maps_of(KernelRidge(*blocks), [a_class("a", points[list(then)])])
    np.testing.assert_allclose(maps_of(rule, [a_class("a", points[list(then)])]), wanted, atol=1e-6)


@pytest.mark.parametrize(
    "classes",
    [
        [a_class("same point twice", np.concatenate([IN_LEFT, IN_LEFT]))],
        [a_class("contradiction", IN_LEFT, negative=IN_LEFT)],
        [a_class("a", IN_LEFT), a_class("same point in two classes", IN_LEFT)],
        [a_class("many", np.repeat(IN_LEFT, 60, axis=0) + np.random.default_rng(0).normal(0, 1e-7, (60, 3)))],
    ],
    ids=lambda classes: classes[-1].name,
)
def test_degenerate_clicks_give_finite_maps_between_zero_and_one(similarity: KernelRidge, classes: list[ClassRequest]) -> None:
    maps = np.stack(maps_of(similarity, classes))
    assert maps.shape == (len(classes), *CELLS)
    assert np.isfinite(maps).all()
    assert maps.min() >= 0.0
    assert maps.max() <= 1.0


def test_voxels_that_are_not_finite_do_not_spread(similarity: KernelRidge, blocks: tuple[NormalisedFeatures, Volume]) -> None:
    features, volume = blocks
    damaged = volume.array.copy()
    damaged[0, 0, 0], damaged[12, 12, 12], damaged[20:, 20:, 20:] = np.nan, np.inf, np.nan
    clean = maps_of(similarity, [a_class("a", IN_LEFT)])
    maps = maps_of(KernelRidge(features, Volume(damaged, volume.geometry)), [a_class("a", IN_LEFT)])
    assert np.isfinite(maps).all()
    assert np.abs(maps[0][LEFT] - clean[0][LEFT]).max() < 0.05


def test_a_point_on_the_border_between_cells_is_joined_to_its_own_cell() -> None:
    generator = np.random.default_rng(0)
    # Five voxels for two cells: every fifth voxel centre lies on a border.
    volume = Volume(generator.normal(0.0, 100.0, (20, 20, 20)), Geometry((20, 20, 20), np.eye(4)))
    intensities = CellIntensities(volume, volume.geometry.resized((8, 8, 8)))
    points = np.array([[float(i), float(j), float(k)] for i in (2, 7, 12) for j in (2, 7, 12) for k in (2, 7, 12)])
    own = np.diag(intensities.connected.at(intensities.connected.update(points), intensities.cells_at(points)))
    assert own.min() > 0.9


def test_finer_features_take_over_how_points_are_connected(
    blocks: tuple[NormalisedFeatures, Volume], monkeypatch: pytest.MonkeyPatch
) -> None:
    features, volume = blocks
    intensities = CellIntensities(volume, features.geometry)
    before = maps_of(KernelRidge(features, volume, intensities), [a_class("a", IN_LEFT)])

    def found_out_again(*_: object) -> np.ndarray:
        raise AssertionError

    monkeypatch.setattr(Connectedness, "from_point", found_out_again)
    np.testing.assert_array_equal(maps_of(KernelRidge(features, volume, intensities), [a_class("a", IN_LEFT)]), before)


def test_classes_clicked_in_turns_have_the_maps_of_all_clicks_at_once(blocks: tuple[NormalisedFeatures, Volume]) -> None:
    rule = KernelRidge(*blocks)
    points = {"left": np.concatenate([IN_LEFT, at_cell(3, 5, 4)]), "above": np.concatenate([IN_ABOVE, at_cell(10, 5, 5)])}
    negative = np.concatenate([IN_RIGHT, at_cell(3, 7, 10)])
    # How much connectedness counts changes with each click, in the class that was clicked.
    for left, above, without, first in ((1, 1, 0, 0), (2, 1, 0, 0), (2, 2, 0, 1), (2, 2, 2, 0), (2, 2, 2, 1), (2, 1, 1, 1)):
        clicked = [
            a_class("a", points["left"][:left], negative=negative[:without]),
            a_class("b", points["above"][:above]),
        ]
        of_class = dict(rule.maps(clicked, first=first))
        for index, wanted in KernelRidge(*blocks).maps(clicked):
            np.testing.assert_allclose(of_class[index].array, wanted.array, atol=2e-6)
            assert of_class[index].prior == pytest.approx(wanted.prior, rel=1e-5)


def test_the_same_clicks_have_maps_of_the_same_bits(blocks: tuple[NormalisedFeatures, Volume]) -> None:
    clicked = [a_class("a", IN_LEFT, negative=IN_RIGHT), a_class("b", IN_ABOVE)]
    once, again = (
        [of_class.array for first in (0, 1) for _, of_class in rule.maps(clicked, first=first)]
        for rule in (KernelRidge(*blocks), KernelRidge(*blocks))
    )
    np.testing.assert_array_equal(once, again)


def test_points_for_which_there_was_no_room_are_told_apart_as_the_others(
    blocks: tuple[NormalisedFeatures, Volume], monkeypatch: pytest.MonkeyPatch
) -> None:
    inside = np.concatenate([at_cell(4, j, i) for j in range(3, 9) for i in (2, 3, 4)])
    outside = np.concatenate([at_cell(7, j, i) for j in range(12) for i in range(5)])
    wanted = maps_of(KernelRidge(*blocks), [a_class("a", inside, negative=outside)])
    monkeypatch.setattr(kernel_rows, "POINTS_OF_ROOM", 2)
    crowded = KernelRidge(*blocks)
    for count in range(1, len(outside) + 1, 7):
        maps_of(crowded, [a_class("a", inside[:count], negative=outside[:count])])
    np.testing.assert_allclose(maps_of(crowded, [a_class("a", inside, negative=outside)]), wanted, atol=0.01)


def test_a_negative_click_on_what_is_like_the_structure_in_a_cell_that_is_not_takes_little_of_the_structure(
    blocks: tuple[NormalisedFeatures, Volume],
) -> None:
    features, volume = blocks
    # At the rim: as bright as the left block, and the network's patch is of that, but most of the cell is background.
    bumpy, wide = volume.array.copy(), features.source.array.copy()
    bumpy[8, 11:14, 10] = bumpy[7:10, 12, 10] = 100.0
    wide[3:5, 5:7, 5] = wide[3:5, 5:7, 4]
    finer = Volume(np.kron(bumpy, np.ones((3, 3, 3))), volume.geometry.resized((72, 72, 72)))
    rule = KernelRidge(normalised_features(replace(features.source, array=wide), "whitened"), finer)
    on_bump = volume.geometry.ijk_to_ras_points(np.array([[10.0, 12.0, 8.0]]))
    (before,), (after,) = maps_of(rule, [a_class("a", IN_LEFT)]), maps_of(rule, [a_class("a", IN_LEFT, negative=on_bump)])
    assert after[LEFT].mean() > 0.9 * before[LEFT].mean()


@pytest.mark.parametrize("count", [200, 300, 400])
def test_hundreds_of_points_in_one_structure_find_it(count: int) -> None:
    """With connectedness all points and random cells have no kernel together, whose equations had other solutions."""
    features, volume = blocks_in_noise(20.0)
    middle = np.mean([IN_LEFT, at_cell(3, 5, 3)], axis=0)
    points = middle + np.random.default_rng(1).uniform(-5.0, 5.0, (count, 3))

    (found,) = maps_of(KernelRidge(features, volume), [a_class("a", points)])

    inside = np.zeros(CELLS, dtype=bool)
    inside[LEFT] = True
    assert np.median(found[inside]) > 0.5
    assert np.median(found[inside]) > 3.0 * np.quantile(found[~inside], 0.8)


def test_of_hundreds_of_points_those_on_the_rim_do_not_take_all_that_is_like_them() -> None:
    features, volume = blocks_in_noise(3.0)
    middle = np.mean([IN_LEFT, at_cell(3, 5, 3)], axis=0)
    # As far as 8 mm from the middle of a block that ends 6, 8 and 12 mm from it.
    points = middle + np.random.default_rng(1).uniform(-8.0, 8.0, (300, 3))

    (found,) = maps_of(KernelRidge(features, volume), [a_class("a", points)])

    inside = np.zeros(CELLS, dtype=bool)
    inside[LEFT] = True
    assert np.median(found[inside]) > np.quantile(found[~inside], 0.9)


@pytest.mark.parametrize("count", [1, 15])
def test_of_a_few_points_each_is_believed(blocks: tuple[NormalisedFeatures, Volume], count: int) -> None:
    offsets = np.random.default_rng(1).uniform(-1.0, 1.0, (count, 3))
    (found,) = maps_of(KernelRidge(*blocks), [a_class("a", IN_LEFT + offsets, negative=IN_ABOVE + offsets)])
    assert found[4, 6, 3] > 0.8
    assert found[9, 6, 6] < 0.05
