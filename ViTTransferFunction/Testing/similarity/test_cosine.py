"""From annotations to low-resolution maps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.annotations import AnnotatedClass
from ViTTransferFunction.Logic.core.geometry import Geometry
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.features.whitening import ComparableFeatures, comparable_features
from ViTTransferFunction.Logic.similarity.cosine import mean_cosine, mean_published_similarity, mean_similarity_map, proximity

Average = Callable[[np.ndarray, np.ndarray], np.ndarray]
GEOMETRY = Geometry((4, 5, 6), np.array([[0.0, -2.0, 0, 50], [3.0, 0, 0, -7], [0, 0, 4.0, 10], [0, 0, 0, 1.0]]))


@pytest.fixture
def features() -> ComparableFeatures:
    array = np.random.default_rng(0).normal(size=(4, 5, 6, 8)).astype(np.float32)
    return comparable_features(FeatureVolume(array, GEOMETRY, "key"), "centred")


def at_cells(*ijk: tuple[int, int, int]) -> np.ndarray:
    return GEOMETRY.ijk_to_ras_points(np.array(ijk))


def a_class(positive: np.ndarray, **fields: object) -> AnnotatedClass:
    return AnnotatedClass("a", (1, 0, 0), positive, **fields)  # type: ignore[arg-type]


def cosine(a: np.ndarray, b: np.ndarray) -> float:
    return float(a @ b / np.linalg.norm(a) / np.linalg.norm(b))


def test_a_map_is_the_mean_cosine_of_equation_1(features: ComparableFeatures) -> None:
    points = at_cells((1, 2, 3), (5, 4, 0))
    similarity = mean_similarity_map(features, a_class(points), mean_cosine)
    centred = features.transform.apply(features.source.array)
    for k, j, i in ((0, 0, 0), (3, 2, 1), (2, 4, 5)):
        expected = np.mean([cosine(centred[k, j, i], centred[c, b, a]) for a, b, c in ((1, 2, 3), (5, 4, 0))])
        assert similarity[k, j, i] == pytest.approx(max(expected, 0.0), abs=1e-5)


def test_the_annotated_cell_is_the_most_similar_to_itself(features: ComparableFeatures) -> None:
    similarity = mean_similarity_map(features, a_class(at_cells((1, 2, 3))), mean_cosine)
    assert similarity.argmax() == np.ravel_multi_index((3, 2, 1), (4, 5, 6))
    assert similarity.max() == pytest.approx(1.0, abs=1e-5)


def test_the_published_variant_drops_low_cosines_and_sharpens_the_others() -> None:
    cells = np.array([[1.0, 0.0], [0.6, 0.8], [0.2, np.sqrt(0.96)], [-1.0, 0.0]]).reshape(1, 1, 4, 2)
    similarity = mean_published_similarity(cells, np.array([[1.0, 0.0]]))
    np.testing.assert_allclose(similarity.ravel(), [1.0, 0.6**2.5, 0.0, 0.0], atol=1e-6)


@pytest.mark.parametrize("method", [mean_cosine, mean_published_similarity])
def test_maps_stay_between_zero_and_one(features: ComparableFeatures, method: Average) -> None:
    annotated = a_class(at_cells((1, 2, 3)), negative=at_cells((4, 4, 2)))
    similarity = mean_similarity_map(features, annotated, method)
    assert similarity.dtype == np.float32
    assert similarity.min() >= 0.0
    assert similarity.max() <= 1.0


@pytest.mark.parametrize("method", [mean_cosine, mean_published_similarity])
def test_a_negative_point_lowers_the_map_where_it_lies(features: ComparableFeatures, method: Average) -> None:
    before = mean_similarity_map(features, a_class(at_cells((1, 2, 3), (4, 4, 2))), method)
    after = mean_similarity_map(features, a_class(at_cells((1, 2, 3)), negative=at_cells((4, 4, 2))), method)
    assert before[2, 4, 4] > 0.1
    assert after[2, 4, 4] < 1e-6


def test_the_order_of_points_does_not_matter(features: ComparableFeatures) -> None:
    points = at_cells((1, 2, 3), (4, 4, 2), (0, 0, 0))
    forward = mean_similarity_map(features, a_class(points), mean_cosine)
    np.testing.assert_allclose(forward, mean_similarity_map(features, a_class(points[::-1]), mean_cosine), atol=1e-6)


def test_mean_cosine_costs_one_product_whatever_the_number_of_points() -> None:
    generator = np.random.default_rng(0)
    cells, queries = generator.normal(size=(2, 3, 4, 5)), generator.normal(size=(7, 5))
    np.testing.assert_allclose(mean_cosine(cells, queries), np.mean([cells @ query for query in queries], axis=0))


def test_proximity_is_measured_in_millimetres_along_oblique_anisotropic_axes() -> None:
    points = at_cells((1, 2, 3))
    weights = proximity(GEOMETRY, points, 0.5)
    ijk = np.array([[4, 0, 1]])
    distance = np.linalg.norm(GEOMETRY.ijk_to_ras_points(ijk) - points)
    assert weights[1, 0, 4] == pytest.approx(np.exp(-10 * 0.5 * distance / GEOMETRY.extent_mm.max()), rel=1e-5)
    assert weights[3, 2, 1] == pytest.approx(1.0)


def test_proximity_goes_by_the_nearest_point() -> None:
    first, second = at_cells((0, 0, 0)), at_cells((5, 4, 3))
    both = proximity(GEOMETRY, np.concatenate([first, second]), 0.7)
    np.testing.assert_allclose(both, np.maximum(proximity(GEOMETRY, first, 0.7), proximity(GEOMETRY, second, 0.7)))
