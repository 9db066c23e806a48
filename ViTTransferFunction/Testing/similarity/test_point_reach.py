"""How far points reach: positive ones as far as they look like those before them, are as rare, and lie from what these find;
negative ones as far as they look unlike the first positive one, and lie deep in what that one finds."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.similarity import point_reach
from ViTTransferFunction.Logic.similarity.place_kernel import CellKernel, Places, place_kernel
from ViTTransferFunction.Logic.similarity.point_reach import FIRST_POINTS, PointReach, Reach, points_before

CELLS = 60
EDGE = 0.05
GRID = Geometry((CELLS, 1, 1), np.diag([EDGE, EDGE, EDGE, 1.0]))
STRUCTURE, AROUND = (1.0, 0.0), (0.0, 1.0)


def places(at: list[int], looks: list[tuple[float, float]]) -> Places:
    """Places along a line of cells, and what they look like."""
    positions = np.zeros((len(at), 3), dtype=np.float32)
    positions[:, 2] = EDGE * (np.array(at) - 0.5 * (CELLS - 1))
    return Places(np.array(looks, dtype=np.float32), positions, np.zeros(len(at), dtype=np.float32))


@pytest.fixture
def line() -> Places:
    """Ten cells of a structure, and what is around."""
    return places(list(range(CELLS)), [STRUCTURE] * 10 + [AROUND] * (CELLS - 10))


def reached(cells: Places, *points: Places) -> tuple[PointReach, list[np.ndarray]]:
    """The kernels with all cells of points that are placed one after the other, and what is known of them."""
    reach, rows = PointReach(CellKernel(cells, GRID, 1.0), EDGE), []
    for number, point in enumerate(points):
        row = place_kernel(point, cells)[0]
        before = [bytes([each]) for each in range(number)]
        of_before = Places(
            *(
                np.concatenate([getattr(each, what) for each in points[:number] or points[:1]])
                for what in ("features", "positions", "cdf")
            )
        )
        reach.apply_to_positive(bytes([number]), point, before, of_before, row)
        rows.append(row)
    return reach, rows


def test_a_point_that_looks_like_its_surroundings_reaches_about_twice_as_far_as_it_lies_from_what_was_found(
    line: Places,
) -> None:
    first, rim = places([3], [STRUCTURE]), places([13], [AROUND])
    reach, (of_first, of_rim) = reached(line, first, rim)
    np.testing.assert_array_equal(of_first, place_kernel(first, line)[0])
    factors = of_rim / place_kernel(rim, line)[0]
    # The first finds the cells up to the tenth, which is four cells away, and five times as many look like the rim.
    rho = 2.0 * 4 * EDGE
    weight = point_reach.LARGEST_WEIGHT * (1.0 - np.exp(-2.5)) * (1.0 - 0.5 * 10 / 50)
    apart = EDGE * (np.arange(CELLS) - 13)
    np.testing.assert_allclose(factors, 1.0 - weight + weight * np.exp(-0.5 * (apart / rho) ** 2), rtol=1e-4)
    np.testing.assert_allclose(reach.of([b"\x01"]).distance, rho, rtol=1e-5)


def test_the_farther_from_what_was_found_the_farther_it_reaches_but_never_less_than_a_cell_and_a_half(line: Places) -> None:
    first = places([3], [STRUCTURE])
    distances = [reached(line, first, places([at], [AROUND]))[0].of([b"\x01"]).distance[0] for at in (9, 12, 20, 40)]
    assert distances[0] == pytest.approx(1.5 * EDGE)
    assert distances == sorted(distances)
    assert distances[-1] == pytest.approx(2.0 * 31 * EDGE, rel=1e-5)


@pytest.mark.parametrize(
    ("point", "why"),
    [((40, STRUCTURE), "it looks like the first"), ((3, STRUCTURE), "it is the first")],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_point_that_looks_like_one_before_it_reaches_without_an_end(
    line: Places, point: tuple[int, tuple[float, float]], why: str
) -> None:
    later = places([point[0]], [point[1]])
    reach, (_, row) = reached(line, places([3], [STRUCTURE]), later)
    np.testing.assert_array_equal(row, place_kernel(later, line)[0])
    np.testing.assert_array_equal(reach.of([b"\x00", b"\x01", b"never seen"]).weight, 0.0)


def test_a_point_whose_look_is_no_more_common_than_the_first_ones_reaches_without_an_end(line: Places) -> None:
    in_the_rare, in_the_common = places([3], [STRUCTURE]), places([20], [AROUND])
    _, (_, row) = reached(line, in_the_common, in_the_rare)
    np.testing.assert_array_equal(row, place_kernel(in_the_rare, line)[0])


@pytest.mark.parametrize(("at", "near"), [(9, 1.0), (8, 0.5), (7, 0.0), (3, 0.0)])
def test_a_rare_look_is_held_back_where_it_lies_at_the_rim_of_what_was_found(line: Places, at: int, near: float) -> None:
    """The first point finds the fifty cells from the eleventh on, which are five times as many as look like the later one."""
    reach, _ = reached(line, places([20], [AROUND]), places([at], [STRUCTURE]))
    like = np.exp(-2.5)
    expected = point_reach.LARGEST_WEIGHT * (1.0 - like) * point_reach.LARGEST_RIM * near * like / point_reach.RIM_LIKE
    np.testing.assert_allclose(reach.of([b"\x01"]).weight, expected, rtol=1e-4, atol=1e-6)


def test_a_rare_look_that_is_like_nothing_before_it_is_another_part_also_at_the_rim(line: Places) -> None:
    reach, _ = reached(line, places([3], [STRUCTURE]), places([10], [(-1.0, 0.0)]))
    assert reach.of([b"\x01"]).weight.item() < 0.05


def test_where_nothing_is_found_the_points_before_are_what_counts(line: Places) -> None:
    unlike_all = places([3], [(-1.0, 0.0)])
    reach, _ = reached(line, unlike_all, places([13], [AROUND]))
    np.testing.assert_allclose(reach.of([b"\x01"]).distance, 2.0 * 10 * EDGE, rtol=1e-5)


def test_what_is_not_kept_is_forgotten(line: Places) -> None:
    reach, _ = reached(line, places([3], [STRUCTURE]), places([13], [AROUND]))
    assert reach.of([b"\x01"]).weight[0] > 0.5
    reach.keep([b"\x00"])
    assert reach.of([b"\x01"]).weight[0] == 0.0


def test_the_factors_between_points_are_a_kernel_of_one_with_itself() -> None:
    generator = np.random.default_rng(0)
    points = Places(np.zeros((40, 2), np.float32), generator.normal(size=(40, 3)).astype(np.float32), np.zeros(40, np.float32))
    weight = generator.uniform(0.0, 0.8, 40) * (generator.random(40) < 0.7)
    factors = Reach(np.exp(generator.normal(-1.0, 1.0, 40)), weight).factors_between(points)
    np.testing.assert_allclose(np.diag(factors), 1.0)
    np.testing.assert_array_equal(factors, factors.T)
    assert np.linalg.eigvalsh(factors).min() > -1e-9


def test_two_points_of_equal_reach_are_to_each_other_what_either_is_to_a_cell() -> None:
    points = places([0, 3], [STRUCTURE] * 2)
    of_both = Reach(np.full(2, 0.2), np.full(2, 0.6)).factors_between(points)[0, 1]
    to_cell = Reach(np.array([0.2]), np.array([0.6])).factors(places([0], [STRUCTURE]), places([3], [STRUCTURE]))
    assert of_both == pytest.approx(to_cell.item(), rel=1e-6)


def negative(cells: Places, first: Places, point: Places) -> tuple[Reach, np.ndarray]:
    """The reach of a negative point, and what its kernel with all cells is multiplied by."""
    reach, _ = reached(cells, first)
    row = place_kernel(point, cells)[0]
    reach.apply_to_negative(b"negative", point, [b"\x00"], first, row)
    return reach.of([b"negative"]), row / place_kernel(point, cells)[0]


def test_a_negative_point_at_the_rim_of_what_it_looks_like_takes_away_little_of_the_rest(line: Places) -> None:
    of_rim, factors = negative(line, places([3], [STRUCTURE]), places([9], [STRUCTURE]))
    rho = point_reach.NEGATIVES_WIDER * EDGE
    assert of_rim.distance == pytest.approx(rho, rel=1e-3)
    assert of_rim.weight == pytest.approx(point_reach.LARGEST_WEIGHT)
    apart = EDGE * (np.arange(CELLS) - 9)
    weight = point_reach.LARGEST_WEIGHT
    np.testing.assert_allclose(factors, 1.0 - weight + weight * np.exp(-0.5 * (apart / rho) ** 2), rtol=1e-3)


def test_a_negative_point_deep_in_what_was_found_takes_more_of_it_away(line: Places) -> None:
    first = places([3], [STRUCTURE])
    distances = [negative(line, first, places([at], [STRUCTURE]))[0].distance.item() for at in (12, 9, 7, 4)]
    # Beyond what was found, no deeper than at its rim.
    assert distances[0] == pytest.approx(point_reach.NEGATIVES_SHORTEST_CELLS * EDGE)
    np.testing.assert_allclose(distances[1:], point_reach.NEGATIVES_WIDER * EDGE * np.array([1, 3, 6]), rtol=1e-3)


def test_a_negative_point_that_looks_like_something_else_reaches_all_of_that(line: Places) -> None:
    unlike, factors = negative(line, places([3], [STRUCTURE]), places([30], [AROUND]))
    assert unlike.weight == pytest.approx(point_reach.LARGEST_WEIGHT * np.exp(-2.5))
    assert factors.min() > 0.9


def test_where_the_first_point_finds_everything_a_negative_one_reaches_without_an_end() -> None:
    everything = places(list(range(CELLS)), [STRUCTURE] * CELLS)
    of_point, factors = negative(everything, places([3], [STRUCTURE]), places([30], [STRUCTURE]))
    assert of_point.weight == 0.0
    np.testing.assert_array_equal(factors, 1.0)


def test_the_first_few_different_positive_points_of_a_class_are_looked_at_and_all_negative_ones() -> None:
    of_a = [[float(number), 0.0, 0.0] for number in (0, 1, 0, 2, 3, 4, 5, 6, 7)]
    points = np.array([*of_a, [0.0, 0.0, 9.0], [1.0, 0.0, 0.0], [8.0, 0.0, 0.0]])
    classes = np.array([0] * 10 + [1, 1])
    positive = np.array([True] * 9 + [False, True, True])
    before = points_before(points, classes, positive)
    first = [0, 1, 3, 4, 5, 6]
    assert len(first) == FIRST_POINTS
    assert {point: list(earlier) for point, earlier in before.items()} == {
        **{point: first[:number] for number, point in enumerate(first)},
        2: [],
        9: first[:1],
        10: [],
        11: [10],
    }


def test_a_point_looked_at_where_an_earlier_one_is_reaches_no_farther_than_that_one() -> None:
    points = np.array([[float(number), 0.0, 0.0] for number in (0, 1, 2, 1)])
    before = points_before(points, np.zeros(4, dtype=int), np.ones(4, dtype=bool))
    assert list(before[3]) == list(before[1]) == [0]
