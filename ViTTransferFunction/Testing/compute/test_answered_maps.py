"""Which maps are shown, of those that have come."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ViTTransferFunction.Logic.compute.answered_maps import AnsweredMaps
from ViTTransferFunction.Logic.compute.requests import (
    ComputeMaps,
    FirstMap,
    Maps,
    MeasureMaps,
    RefinedMaps,
    RefineMaps,
    Refinement,
    Volumes,
)
from ViTTransferFunction.Logic.core.classes.class_map import ClassMap
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.classes.iso_proposals import IsoProposals
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry

LIVER, SPLEEN = (ClassRequest(id_, np.zeros((1, 3))) for id_ in ("liver", "spleen"))
BOTH = (LIVER, SPLEEN)
LARGER, SMALLER = replace(LIVER, size=1.0), replace(LIVER, size=-1.0)


MOVED = replace(LIVER, positive=np.ones((1, 3)))


def coarse_map(cells_inside: int = 40) -> ClassMap:
    """Of 64 cells, some of which reach the iso value."""
    proposals = IsoProposals(smaller=0.8, chosen=0.4, larger=0.1)
    levels = np.array([0.6, 0.2], dtype=np.float32)
    values = levels.repeat((cells_inside, 64 - cells_inside)).reshape(4, 4, 4)
    return ClassMap(values, Geometry((4, 4, 4), np.eye(4)), 0.4, proposals)


@pytest.fixture
def answers() -> AnsweredMaps:
    """With S_L of both classes."""
    answers = AnsweredMaps()
    answers.expect()
    answers.take(ComputeMaps(BOTH), Maps((coarse_map(), coarse_map())), refining=True)
    return answers


@pytest.fixture
def refined(answers: AnsweredMaps) -> AnsweredMaps:
    """With S_H as well."""
    answers.take_refined(RefineMaps(BOTH, Refinement()), RefinedMaps((coarse_map(), coarse_map()), (1.25, 0.5)))
    return answers


def test_the_map_that_came_first_stands_among_the_others_in_the_order_of_the_classes(answers: AnsweredMaps) -> None:
    before, request = answers.maps, ComputeMaps(BOTH, first="spleen")
    liver, spleen = coarse_map(), coarse_map()
    answers.expect()
    assert not answers.first_came
    answers.take_first(request, FirstMap(spleen))
    assert answers.first_came
    assert answers.maps == {"liver": before["liver"], "spleen": spleen}
    assert answers.low_maps is before
    answers.take(request, Maps((liver,)), refining=True)
    assert list(answers.maps.items()) == [("liver", liver), ("spleen", spleen)]


def test_a_first_map_of_what_was_given_up_is_not_taken_for_one_of_the_next(answers: AnsweredMaps) -> None:
    answers.expect()
    answers.take_first(ComputeMaps(BOTH, first="liver"), FirstMap(coarse_map()))
    answers.expect()
    liver, spleen = coarse_map(), coarse_map()
    answers.take(ComputeMaps(BOTH), Maps((liver, spleen)), refining=True)
    assert answers.maps == {"liver": liver, "spleen": spleen}


def test_refined_maps_take_the_place_of_coarse_ones_which_are_kept(answers: AnsweredMaps) -> None:
    coarse = answers.maps
    answers.take_volumes(MeasureMaps(BOTH), Volumes((1.5, 0.5)))
    assert (answers.refined, answers.volumes_ml) == ((False, False), {"liver": 1.5, "spleen": 0.5})
    answers.take_refined(RefineMaps(BOTH, Refinement()), RefinedMaps((coarse_map(), coarse_map()), (1.25, 0.5)))
    assert (answers.refined, answers.volumes_ml) == ((True, True), {"liver": 1.25, "spleen": 0.5})
    assert answers.low_maps is coarse
    assert answers.maps["liver"] is not coarse["liver"]


def click(answers: AnsweredMaps, spleen: ClassMap, refining: bool = True) -> ClassMap:
    """Another point in the liver is answered, by coarse maps and volumes; returns the liver's."""
    request, liver = ComputeMaps((MOVED, SPLEEN), first="liver"), coarse_map()
    answers.expect()
    answers.take_first(request, FirstMap(liver))
    answers.take(request, Maps((spleen,)), refining)
    answers.take_volumes(MeasureMaps(request.classes), Volumes((3.0, 4.0)))
    return liver


@pytest.mark.parametrize("cells_inside", [40, 39, 42])
def test_what_a_click_on_another_class_hardly_changes_stays_as_fine_as_it_was(refined: AnsweredMaps, cells_inside: int) -> None:
    fine, spleen = refined.maps["spleen"], coarse_map(cells_inside)
    liver = click(refined, spleen)
    assert refined.maps == {"liver": liver, "spleen": fine}
    assert refined.low_maps == {"liver": liver, "spleen": spleen}
    assert refined.volumes_ml == {"liver": 3.0, "spleen": 0.5}
    assert refined.refined == (False, True)
    answers = RefinedMaps((coarse_map(), coarse_map()), (2.0, 0.75))
    refined.take_refined(RefineMaps((MOVED, SPLEEN), Refinement()), answers)
    assert tuple(refined.maps.values()) == answers.maps
    assert refined.volumes_ml == {"liver": 2.0, "spleen": 0.75}


def test_what_a_click_on_another_class_takes_away_is_shown_at_once(refined: AnsweredMaps) -> None:
    spleen = coarse_map(cells_inside=37)
    liver = click(refined, spleen)
    assert refined.maps == {"liver": liver, "spleen": spleen}
    assert refined.volumes_ml == {"liver": 3.0, "spleen": 4.0}


def test_a_class_that_has_no_map_any_more_has_no_volume_either(refined: AnsweredMaps) -> None:
    refined.expect()
    refined.take(ComputeMaps((SPLEEN,)), Maps((coarse_map(),)), refining=True)
    assert refined.volumes_ml == {"spleen": 0.5}


def test_a_class_may_have_come_refined_alone() -> None:
    answers = AnsweredMaps()
    answers.take_refined(RefineMaps(BOTH, Refinement()), RefinedMaps((coarse_map(), coarse_map()), (1.25, 0.5)))
    answers.take(ComputeMaps(BOTH), maps := Maps((coarse_map(), coarse_map())), refining=True)
    assert list(answers.maps.values()) == list(maps.maps)


def test_where_nothing_is_refined_any_more_all_maps_are_the_latest(refined: AnsweredMaps) -> None:
    spleen = coarse_map()
    liver = click(refined, spleen, refining=False)
    assert refined.maps == {"liver": liver, "spleen": spleen}
    assert refined.volumes_ml == {"liver": 3.0, "spleen": 4.0}


def test_a_class_that_is_asked_for_otherwise_is_shown_by_its_new_map(refined: AnsweredMaps) -> None:
    liver, spleen = coarse_map(), coarse_map()
    refined.expect()
    refined.take(ComputeMaps((LIVER, replace(SPLEEN, proximity=0.5))), Maps((liver, spleen)), refining=True)
    assert refined.maps["spleen"] is spleen
    assert refined.maps["liver"] is not liver


@pytest.mark.parametrize(("request_", "iso"), [(LARGER, 0.1), (SMALLER, 0.8), (replace(LIVER, iso=0.6), 0.6)])
def test_another_size_or_iso_value_is_that_of_the_coarse_map(refined: AnsweredMaps, request_: ClassRequest, iso: float) -> None:
    coarse = refined.low_maps["liver"]
    refined.resize((request_, SPLEEN))
    assert refined.maps["liver"].iso == pytest.approx(iso)
    assert refined.maps["liver"].array is coarse.array
    assert refined.refined == (False, False)


@pytest.mark.parametrize(
    "classes",
    [BOTH, (replace(LARGER, positive=np.ones((1, 3))), SPLEEN), (LARGER,), (SPLEEN, LARGER), ()],
    ids=["nothing", "a point as well", "a class less", "another order", "none"],
)
def test_where_anything_else_is_other_maps_stay_until_they_are_answered_anew(
    refined: AnsweredMaps, classes: tuple[ClassRequest, ...]
) -> None:
    shown = refined.maps
    refined.resize(classes)
    assert refined.maps is shown
    assert refined.refined == (True, True)


def test_a_first_map_is_taken_back_with_the_click_that_it_answers(answers: AnsweredMaps) -> None:
    before = dict(answers.maps)
    moved = replace(LIVER, positive=np.ones((1, 3)))
    answers.expect()
    answers.take_first(ComputeMaps((moved, SPLEEN), first="liver"), FirstMap(coarse_map()))
    answers.resize(BOTH)
    assert {id_: shown.array is before[id_].array for id_, shown in answers.maps.items()} == {"liver": True, "spleen": True}
