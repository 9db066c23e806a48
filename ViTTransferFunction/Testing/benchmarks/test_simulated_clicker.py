"""Where the simulated user clicks, on shapes whose deepest point is known."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from Benchmarks.shared.regions import deepest_voxel
from Benchmarks.shared.simulated_clicker import Click, click_in_rounds, first_click, next_click
from ViTTransferFunction.Testing.support.masks import box_mask

CUBE_MM = (1.0, 1.0, 1.0)
SHAPE = (9, 9, 20)

a_box = functools.partial(box_mask, SHAPE)

SMALL = a_box(slice(3, 6), slice(3, 6), slice(15, 18))
LARGE = a_box(slice(2, 7), slice(2, 7), slice(2, 7))
NOTHING = np.zeros(SHAPE, dtype=bool)


def test_the_first_click_is_at_the_centre_of_the_largest_component():
    assert first_click(LARGE | SMALL, CUBE_MM) == Click((4, 4, 4), positive=True)


def test_depth_is_measured_in_millimetres():
    # Two plates, each 3 voxels thick; the one whose thickness is more millimetres is deeper.
    plates = a_box(slice(0, 5), slice(0, 3), slice(0, 5)) | a_box(slice(0, 5), slice(4, 9), slice(10, 13))
    assert deepest_voxel(plates, (1.0, 1.2, 1.0)) == (2, 1, 2)
    assert deepest_voxel(plates, (1.0, 1.0, 1.2)) == (2, 6, 11)


def test_beyond_the_volume_is_outside():
    assert deepest_voxel(np.ones((5, 5, 5), dtype=bool), CUBE_MM) == (2, 2, 2)


def test_a_missed_part_gets_a_positive_click():
    assert next_click(SMALL, LARGE | SMALL, CUBE_MM) == Click((4, 4, 4), positive=True)


def test_a_part_taken_wrongly_gets_a_negative_click():
    assert next_click(LARGE | SMALL, LARGE, CUBE_MM) == Click((4, 4, 16), positive=False)


def test_the_larger_of_two_errors_is_corrected():
    assert next_click(SMALL, LARGE, CUBE_MM) == Click((4, 4, 4), positive=True)
    assert next_click(LARGE, SMALL, CUBE_MM) == Click((4, 4, 4), positive=False)


def test_a_perfect_answer_gets_no_click():
    assert next_click(LARGE, LARGE, CUBE_MM) is None


def test_where_a_method_takes_no_negative_clicks_only_what_was_missed_is_clicked():
    assert next_click(LARGE, SMALL, CUBE_MM, with_negatives=False) == Click((4, 4, 16), positive=True)
    assert next_click(LARGE | SMALL, SMALL, CUBE_MM, with_negatives=False) is None


def test_a_structure_without_voxels_cannot_be_clicked():
    with pytest.raises(ValueError, match="no voxel"):
        first_click(NOTHING, CUBE_MM)


def test_every_class_gets_one_click_a_round_until_it_is_right():
    truth = 1 * LARGE + 2 * SMALL
    rounds = list(click_in_rounds(truth, CUBE_MM, segment=lambda _: 1 * LARGE, rounds=3))
    assert [r.number for r in rounds] == [1, 2, 3]
    assert [[len(of_class) for of_class in r.clicks] for r in rounds] == [[1, 1], [1, 2], [1, 3]]


def test_the_method_sees_the_clicks_of_all_classes_so_far():
    seen = []

    def segment(clicks):
        seen.append([list(of_class) for of_class in clicks])
        return np.zeros(SHAPE, dtype=int)

    list(click_in_rounds(1 * LARGE, CUBE_MM, segment, rounds=2))
    click = Click((4, 4, 4), positive=True)
    assert seen == [[[click]], [[click, click]]]


def test_a_label_that_does_not_occur_is_refused():
    with pytest.raises(ValueError, match="no voxel"):
        next(click_in_rounds(2 * LARGE, CUBE_MM, segment=lambda _: 2 * LARGE))


def test_a_class_may_be_begun_by_other_gestures_before_its_errors_are_clicked_on():
    line, across = [Click((4, 4, 4), True), Click((4, 4, 9), False)], [Click((4, 2, 4), True)]
    rounds = list(
        click_in_rounds(LARGE.astype(np.uint8), CUBE_MM, lambda clicks: np.zeros(SHAPE, int), 3, begun_by=[[line, across]])
    )
    assert [len(state.clicks[0]) for state in rounds] == [2, 3, 4]
    assert rounds[1].clicks[0] == (*line, *across)
    # Nothing was found, and so the middle lacks.
    assert rounds[2].clicks[0][-1] == Click((4, 4, 4), positive=True)
