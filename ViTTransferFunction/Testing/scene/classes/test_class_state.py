"""Classes as values."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ViTTransferFunction.Logic.rendering.appearance import Appearance
from ViTTransferFunction.Logic.scene.classes.class_state import (
    ClassState,
    changed,
    duplicate_class_state,
    new_class_state,
    sharing,
)

LIVER = ClassState(
    "a1",
    "liver",
    Appearance((0.25, 0.5, 0.75), style="glass", ramp=0.25, edges=0.125),
    positive=((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)),
    negative=((-1.0, 0.0, 0.0),),
    positive_properties={(1.0, 2.0, 3.0): ("dome",), (4.0, 5.0, 6.0): ("hilum",)},
    negative_properties={(-1.0, 0.0, 0.0): ("lung",)},
)


def test_another_style_brings_its_own_shades_fading_and_edges() -> None:
    other = changed(LIVER, style="vessels", proximity=0.5)
    assert other == replace(LIVER, look=replace(LIVER.look, style="vessels", ramp=None, edges=None), proximity=0.5)
    assert changed(LIVER, style="vessels", ramp=0.75).look.ramp == 0.75


def test_new_classes_have_names_and_colours_of_their_own() -> None:
    states: list[ClassState] = []
    for _ in range(10):
        states.append(new_class_state(states))
    assert len({state.name for state in states}) == 10
    assert len({state.color for state in states}) == 10
    assert len({state.id for state in states}) == 10


def test_a_freed_name_and_colour_are_used_again() -> None:
    first, second = (new_class_state([]), None)
    second = new_class_state([first])
    again = new_class_state([second])
    assert (again.name, again.color) == (first.name, first.color)


def test_a_copy_of_a_class_differs_from_it_in_name_colour_and_what_is_said_of_points() -> None:
    states = [LIVER]
    for _ in range(3):
        states.append(duplicate_class_state(states, LIVER))
    assert [state.name for state in states] == ["liver", "liver copy", "liver copy (2)", "liver copy (3)"]
    assert len({state.color for state in states}) == len({state.id for state in states}) == 4
    first = states[1]
    same = replace(first, id=LIVER.id, name=LIVER.name, look=replace(first.look, color=LIVER.color))
    assert (same, first.positive_properties, first.negative_properties) == (LIVER, {}, {})


def test_a_class_shares_with_its_state_before_whatever_has_not_changed() -> None:
    def read(**changes: Any) -> ClassState:
        """As if from the scene: equal, and made anew."""
        points = {(float(n), n + 1.0, n + 2.0): (said,) for n, said in ((1, "dome"), (4, "hilum"))}
        return replace(LIVER, **{"positive": tuple(points), "positive_properties": points} | changes)

    assert read() == LIVER
    assert read().positive[0] is not LIVER.positive[0]
    assert sharing(read(), LIVER) is LIVER
    more = sharing(read(positive=((1.0, 2.0, 3.0), (7.0, 8.0, 9.0))), LIVER)
    assert more.positive == ((1.0, 2.0, 3.0), (7.0, 8.0, 9.0))
    assert more.positive[0] is LIVER.positive[0]
    said = sharing(read(positive_properties={(1.0, 2.0, 3.0): ("top",)}), LIVER)
    assert said.positive_properties == {(1.0, 2.0, 3.0): ("top",)}
