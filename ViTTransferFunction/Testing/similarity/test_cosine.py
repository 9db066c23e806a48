"""From annotations to low-resolution maps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.volumes.voxel_map import VoxelMap
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.features.whitening import NormalisedFeatures, normalised_features
from ViTTransferFunction.Logic.similarity.cosine import CosineSimilarity, mean_clamped_cosine, mean_cosine
from ViTTransferFunction.Testing.support.turned_cells import TURNED_CELLS, at_turned_cells

Average = Callable[[np.ndarray, np.ndarray], np.ndarray]


@pytest.fixture
def features() -> NormalisedFeatures:
    array = np.random.default_rng(0).normal(size=(4, 5, 6, 8)).astype(np.float32)
    return normalised_features(FeatureVolume(array, TURNED_CELLS, "key"), "centred")


def a_class(positive: np.ndarray, **fields: object) -> ClassRequest:
    return ClassRequest("a", positive, **fields)  # type: ignore[arg-type]


def map_of(features: NormalisedFeatures, request: ClassRequest, average: Average) -> np.ndarray:
    ((_, similarity),) = CosineSimilarity(features, TURNED_CELLS, average).maps([request])
    return similarity.array


def cosine(a: np.ndarray, b: np.ndarray) -> float:
    return float(a @ b / np.linalg.norm(a) / np.linalg.norm(b))


def test_a_map_is_the_mean_cosine_of_equation_1(features: NormalisedFeatures) -> None:
    points = at_turned_cells((1, 2, 3), (5, 4, 0))
    similarity = map_of(features, a_class(points), mean_cosine)
    centred = features.transform.apply(features.source.array)
    for k, j, i in ((0, 0, 0), (3, 2, 1), (2, 4, 5)):
        expected = np.mean([cosine(centred[k, j, i], centred[c, b, a]) for a, b, c in ((1, 2, 3), (5, 4, 0))])
        assert similarity[k, j, i] == pytest.approx(max(expected, 0.0), abs=1e-5)


def test_the_annotated_cell_is_the_most_similar_to_itself(features: NormalisedFeatures) -> None:
    similarity = map_of(features, a_class(at_turned_cells((1, 2, 3))), mean_cosine)
    assert similarity.argmax() == np.ravel_multi_index((3, 2, 1), (4, 5, 6))
    assert similarity.max() == pytest.approx(1.0, abs=1e-5)


def test_the_authors_variant_drops_low_cosines_and_sharpens_the_others() -> None:
    cells = np.array([[1.0, 0.0], [0.6, 0.8], [0.2, np.sqrt(0.96)], [-1.0, 0.0]]).reshape(1, 1, 4, 2)
    similarity = mean_clamped_cosine(cells, np.array([[1.0, 0.0]]))
    np.testing.assert_allclose(similarity.ravel(), [1.0, 0.6**2.5, 0.0, 0.0], atol=1e-6)
    of_two = mean_clamped_cosine(cells, np.array([[1.0, 0.0], [0.0, 1.0]]))
    np.testing.assert_allclose(of_two.ravel(), [0.5, 0.5 * (0.6**2.5 + 0.8**2.5), 0.5 * 0.96**1.25, 0.0], atol=1e-6)


@pytest.mark.parametrize("method", [mean_cosine, mean_clamped_cosine])
def test_maps_stay_between_zero_and_one(features: NormalisedFeatures, method: Average) -> None:
    annotated = a_class(at_turned_cells((1, 2, 3)), negative=at_turned_cells((4, 4, 2)))
    similarity = map_of(features, annotated, method)
    assert similarity.dtype == np.float32
    assert similarity.min() >= 0.0
    assert similarity.max() <= 1.0


@pytest.mark.parametrize("method", [mean_cosine, mean_clamped_cosine])
def test_a_negative_point_lowers_the_map_where_it_lies(features: NormalisedFeatures, method: Average) -> None:
    points = at_turned_cells((1, 2, 3), (4, 4, 2))
    before = map_of(features, a_class(points), method)
    after = map_of(features, a_class(points, negative=points[1:]), method)
    assert before[2, 4, 4] > 0.1
    assert after[2, 4, 4] < 1e-6


def test_a_duplicate_has_the_threshold_of_the_original_and_does_not_alter_it(features: NormalisedFeatures) -> None:
    rule = CosineSimilarity(features, TURNED_CELLS, mean_cosine)
    original, other = a_class(at_turned_cells((1, 2, 3))), ClassRequest("b", at_turned_cells((4, 4, 2)))
    ((_, similarity),) = rule.maps([original])
    duplicated = [original, ClassRequest("a copy", original.positive), other]
    alone = rule.iso(similarity, [original, other], 0)
    at_own, at_other = similarity.array[3, 2, 1], similarity.array[2, 4, 4]
    assert alone.chosen == pytest.approx(0.5 * (at_own + at_other))
    assert rule.refined_iso(VoxelMap.whole(similarity.array), similarity, [original, other], 0) == alone
    assert [rule.iso(similarity, duplicated, index) for index in (0, 1)] == [alone, alone]


def test_the_class_that_is_waited_for_comes_first(features: NormalisedFeatures) -> None:
    classes = [ClassRequest(name, at_turned_cells((1, 2, 3))) for name in "abc"]
    rule = CosineSimilarity(features, TURNED_CELLS, mean_cosine)
    assert [index for index, _ in rule.maps(classes, first=1)] == [1, 0, 2]


def test_the_order_of_points_does_not_matter(features: NormalisedFeatures) -> None:
    points = at_turned_cells((1, 2, 3), (4, 4, 2), (0, 0, 0))
    forward = map_of(features, a_class(points), mean_cosine)
    np.testing.assert_allclose(forward, map_of(features, a_class(points[::-1]), mean_cosine), atol=1e-6)


def test_mean_cosine_costs_one_product_whatever_the_number_of_points() -> None:
    generator = np.random.default_rng(0)
    cells, queries = generator.normal(size=(2, 3, 4, 5)), generator.normal(size=(7, 5))
    np.testing.assert_allclose(mean_cosine(cells, queries), np.mean([cells @ query for query in queries], axis=0))
