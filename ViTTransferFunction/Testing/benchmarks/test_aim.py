"""Where in a structure or an error a simulated person clicks."""

from __future__ import annotations

import functools

import numpy as np

from Benchmarks.shared.aim import ERROR_MM, PersonsAim
from Benchmarks.shared.regions import deepest_voxel, depth_mm
from Benchmarks.shared.simulated_clicker import click_in_rounds, next_click
from ViTTransferFunction.Testing.support.masks import box_mask

SPACING_MM = (2.0, 1.0, 1.0)
SHAPE = (30, 60, 60)

a_box = functools.partial(box_mask, SHAPE)

LARGE = a_box(slice(5, 25), slice(5, 45), slice(5, 45))
THIN = a_box(slice(2, 4), slice(50, 52), slice(0, 60))
SPECK = a_box(slice(28, 29), slice(55, 56), slice(55, 56))


def test_the_first_click_lies_anywhere_in_the_inner_half_of_the_depth() -> None:
    depths = depth_mm(LARGE, SPACING_MM)
    clicked = [PersonsAim(path).at_structure(LARGE, SPACING_MM) for path in range(200)]
    of_clicks = np.array([depths[voxel] for voxel in clicked])
    assert of_clicks.min() >= 0.5 * depths.max()
    # An inner half of the depth is an eighth of a cube, and half of that is shallower than 0.63 of it.
    assert np.mean(of_clicks < 0.65 * depths.max()) > 0.3
    assert len(set(clicked)) > 150


def test_a_thin_part_beside_a_deep_one_is_not_clicked_first() -> None:
    assert not any(THIN[PersonsAim(path).at_structure(LARGE | THIN, SPACING_MM)] for path in range(50))


def test_later_clicks_lie_around_the_deepest_place_with_a_persons_error_in_millimetres() -> None:
    deepest = np.array(deepest_voxel(LARGE, SPACING_MM))
    clicked = np.array([PersonsAim(path).at_error(LARGE, SPACING_MM) for path in range(300)])
    errors_mm = (clicked - deepest) * SPACING_MM
    np.testing.assert_allclose(errors_mm.std(axis=0), ERROR_MM, rtol=0.2)
    np.testing.assert_allclose(errors_mm.mean(axis=0), 0.0, atol=0.6)


def test_a_click_always_hits_the_error() -> None:
    assert all(THIN[PersonsAim(path).at_error(THIN, SPACING_MM)] for path in range(50))
    assert PersonsAim(0).at_error(SPECK, SPACING_MM) == (28, 55, 55)


def test_one_seed_is_one_path_and_another_seed_another() -> None:
    def path(*seed: int) -> list[tuple[int, int, int]]:
        aim = PersonsAim(*seed)
        return [aim.at_structure(LARGE, SPACING_MM), *(aim.at_error(LARGE, SPACING_MM) for _ in range(3))]

    assert path(1, 2) == path(1, 2)
    assert path(1, 2) != path(1, 3)
    assert path(1, 2) != path(2, 2)


def test_the_clicker_aims_each_class_by_its_own_aim() -> None:
    truth = 1 * LARGE + 2 * THIN
    aims = [PersonsAim(1, label) for label in (1, 2)]
    *_, last = click_in_rounds(truth, SPACING_MM, lambda _: np.zeros(SHAPE, dtype=int), rounds=2, aims=aims)
    for label, of_class in enumerate(last.clicks, start=1):
        aim = PersonsAim(1, label)
        mask = truth == label
        expected = [aim.at_structure(mask, SPACING_MM), aim.at_error(mask, SPACING_MM)]
        assert [click.kji for click in of_class] == expected


def test_an_aimed_correction_stays_in_the_largest_error() -> None:
    for path in range(20):
        click = next_click(LARGE | THIN, THIN, SPACING_MM, aim=PersonsAim(path))
        assert click is not None
        assert LARGE[click.kji]
        assert not click.positive
