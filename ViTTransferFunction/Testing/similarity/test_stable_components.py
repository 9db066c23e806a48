"""Components around points at several tolerances, and what they say of an iso value."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.system.errors import Cancelled
from ViTTransferFunction.Logic.core.volumes.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.similarity.closed_structures import raise_within
from ViTTransferFunction.Logic.similarity.intensity_blocks import IntensityBlocks
from ViTTransferFunction.Logic.similarity.iso_value import (
    CANDIDATES,
    Components,
    Levels,
    choose_iso_by_edges,
    component_evidence,
    prior_iso,
)
from ViTTransferFunction.Logic.similarity.stable_components import TOLERANCES, StableComponents, stability
from ViTTransferFunction.Testing.support.volumes import volume_of

WINDOW = IntensityWindow(0.0, 100.0)
CELLS = (16, 16, 16)
NEVER = len(TOLERANCES)
LEFT, DOOR, RIGHT = (8, 8, 4), (8, 8, 8), (8, 8, 12)
"""Cells (k, j, i)."""


def two_rooms() -> Volume:
    """Two rooms of 0 in walls of 90, and between them a door of 30; 32³ voxels, two for a cell along each axis."""
    array = np.full((32, 32, 32), 90.0, dtype=np.float32)
    array[8:24, 8:24, 2:16] = array[8:24, 8:24, 18:30] = 0.0
    array[12:20, 12:20, 16:18] = 30.0
    return volume_of(array)


def components_of(volume: Volume, body: int = 16**3) -> StableComponents:
    cells = volume.geometry.resized(CELLS)
    units = IntensityBlocks(volume, cells, WINDOW).cell_units()
    return StableComponents(units, cells, np.arange(units.size), lambda: body)


def at(*cells: tuple[int, int, int]) -> np.ndarray:
    geometry = two_rooms().geometry.resized(CELLS)
    return geometry.ijk_to_ras_points(np.array([cell[::-1] for cell in cells], dtype=float))


def steps_of(components: StableComponents, requests: list[ClassRequest], index: int = 0) -> np.ndarray:
    return components.of_class(requests, index).reshape(CELLS)


def test_a_component_reaches_through_a_door_only_at_a_tolerance_as_wide_as_the_door_differs() -> None:
    steps = steps_of(components_of(two_rooms()), [ClassRequest("left", at(LEFT))])
    assert steps[LEFT] == 0
    assert TOLERANCES[steps[DOOR]] == TOLERANCES[steps[RIGHT]] == pytest.approx(0.32)
    assert steps[0, 0, 0] == NEVER


def test_what_another_class_or_a_negative_point_is_nearer_to_is_in_no_component() -> None:
    components = components_of(two_rooms())
    with_rival = steps_of(components, [ClassRequest("left", at(LEFT)), ClassRequest("right", at(RIGHT))])
    with_negative = steps_of(components, [ClassRequest("left", at(LEFT), at(RIGHT))])
    for steps in (with_rival, with_negative):
        assert steps[LEFT] == 0
        assert steps[RIGHT] == NEVER
        assert steps[DOOR] < NEVER, "what is as near to both may be either's"


def test_components_depend_on_the_points_that_there_are_and_not_on_those_that_there_were() -> None:
    components = components_of(two_rooms())
    alone = [ClassRequest("left", at(LEFT))]
    before = steps_of(components, alone).copy()
    steps_of(components, [ClassRequest("left", at(LEFT, DOOR), at(RIGHT))])
    np.testing.assert_array_equal(steps_of(components, alone), before)


def test_looking_can_be_cancelled_before_each_new_point_and_then_goes_on() -> None:
    components = components_of(two_rooms())
    looked: list[int] = []

    def twice() -> None:
        if len(looked) == 2:
            raise Cancelled
        looked.append(1)

    three = [ClassRequest("left", at(LEFT, DOOR), at(RIGHT))]
    with pytest.raises(Cancelled):
        components.update(three, twice)
    again: list[int] = []
    components.update(three, lambda: again.append(1))
    assert len(again) == 1


def test_several_points_have_the_components_of_all_of_them() -> None:
    components = components_of(two_rooms())
    steps = steps_of(components, [ClassRequest("both", at(LEFT, RIGHT))])
    assert steps[LEFT] == steps[RIGHT] == 0


def closed_of(components: StableComponents, requests: list[ClassRequest]) -> np.ndarray:
    """Where the first class is closed off."""
    closed = components.closed(requests, 0)
    assert closed is not None
    return closed.reshape(CELLS)


def test_what_lies_within_walls_with_a_point_is_closed_and_ends_there() -> None:
    volume = two_rooms()
    rooms = volume.array[::2, ::2, ::2] == 0.0
    left = rooms & (np.arange(CELLS[2]) < CELLS[2] // 2)
    components = components_of(volume)
    np.testing.assert_array_equal(closed_of(components, [ClassRequest("left", at(LEFT))]), left)
    np.testing.assert_array_equal(closed_of(components, [ClassRequest("both", at(LEFT, RIGHT, LEFT))]), rooms)


def test_what_is_closed_ends_where_another_class_is_nearer() -> None:
    volume = two_rooms()
    volume.array[8:24, 8:24, 16:30] = 5.0  # One room, of two intensities.
    components = components_of(volume)
    left = ClassRequest("left", at(LEFT))
    assert closed_of(components, [left])[RIGHT]
    with_rival = closed_of(components, [left, ClassRequest("right", at(RIGHT))])
    assert with_rival[LEFT]
    assert not with_rival[RIGHT]


def test_what_goes_on_outside_of_the_volume_is_not_closed() -> None:
    volume = two_rooms()
    volume.array[:16] = volume.array[8:24].copy()
    assert components_of(volume).closed([ClassRequest("left", at(LEFT))], 0) is None


def test_what_is_most_of_the_body_is_not_closed() -> None:
    volume, requests = two_rooms(), [ClassRequest("left", at(LEFT))]
    room = int(closed_of(components_of(volume), requests).sum())
    assert components_of(volume, body=2 * room).closed(requests, 0) is not None
    assert components_of(volume, body=2 * room - 1).closed(requests, 0) is None


def test_what_grows_with_every_tolerance_is_not_closed_however_many_points_are_in_it() -> None:
    slope = np.broadcast_to(np.linspace(0.0, 90.0, 32, dtype=np.float32), (32, 32, 32))
    components = components_of(volume_of(slope.copy()))
    assert components.closed([ClassRequest("slope", at(LEFT, DOOR, RIGHT))], 0) is None


def test_a_map_is_raised_to_half_way_on_a_logarithmic_scale_within_what_is_closed_and_nowhere_else() -> None:
    similarity = np.array([0.81, 0.01, 0.0, 0.3, 0.9])
    raise_within(np.array([True, True, True, False, False]), similarity)
    np.testing.assert_allclose(similarity, [0.81, 0.09, 0.0, 0.3, 0.9])


def test_components_are_found_beside_voxels_that_are_not_numbers() -> None:
    volume = two_rooms()
    volume.array[:, :, :2] = np.nan
    steps = steps_of(components_of(volume), [ClassRequest("left", at(LEFT))])
    assert steps[LEFT] == 0
    assert (steps[:, :, 0] == NEVER).all()


def test_large_components_that_stay_are_stable_and_growing_or_tiny_ones_are_not() -> None:
    plateau = stability(np.array([100.0, 5000.0, 5200.0, 5300.0, 40_000.0, 60_000.0]), 100_000)
    assert plateau.argmax() == 2
    assert plateau[2] > 0.95
    assert stability(np.array([10.0, 100.0, 1000.0, 10_000.0, 50_000.0, 90_000.0]), 100_000)[:4].max() < 0.4
    assert stability(np.array([1.0, 1.0, 1.0, 1.0, 1.0, 40_000.0]), 100_000)[:5].max() < 0.05
    assert not stability(np.full(6, 60_000.0), 100_000).any(), "what fills most of the volume is no structure"


def fading_ball() -> tuple[np.ndarray, np.ndarray]:
    """A map that fades from its middle on, and knows no wall; and components that end at one, where the map is 0.05."""
    axis = np.arange(40) - 19.5
    distance = np.sqrt(axis[:, None, None] ** 2 + axis[:, None] ** 2 + axis**2).ravel()
    steps = np.where(distance < 15.0, 1, NEVER).astype(np.uint8)
    steps[distance < 5.0] = 0
    return np.exp(-distance / 5.0), steps


def evidence_of(similarity: np.ndarray, steps: np.ndarray, positive_count: int) -> np.ndarray:
    return component_evidence(Levels(similarity), Components(steps, positive_count))


def test_the_evidence_of_a_component_is_largest_where_the_map_encloses_it_and_less_with_more_points() -> None:
    similarity, steps = fading_ball()
    evidence = evidence_of(similarity, steps, 1)
    assert CANDIDATES[evidence.argmax()] == pytest.approx(np.exp(-3.0), rel=0.1)
    assert evidence.max() > 0.5
    np.testing.assert_allclose(evidence_of(similarity, steps, 4), evidence / 2.0)


def test_components_that_only_grow_are_no_evidence() -> None:
    similarity, _ = fading_ball()
    distance = -5.0 * np.log(similarity)
    growing = np.clip(np.ceil(np.log(distance) / np.log(2.5)), 0, NEVER).astype(np.uint8)
    assert not evidence_of(similarity, growing, 1).any()


def test_the_iso_value_is_drawn_to_what_encloses_a_stable_component() -> None:
    similarity, steps = fading_ball()
    flat, at_positive = np.ones_like(similarity), np.array([1.0])
    without = choose_iso_by_edges(similarity, flat, at_positive, prior_iso(1))
    drawn = choose_iso_by_edges(similarity, flat, at_positive, prior_iso(1), Components(steps, 1))
    assert without == pytest.approx(prior_iso(1), rel=0.1)
    assert drawn == pytest.approx(np.exp(-3.0), rel=0.25)
