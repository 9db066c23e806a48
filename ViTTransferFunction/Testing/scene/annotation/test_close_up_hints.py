"""When a closer look is suggested: where the map says little of how far a structure reaches, or at a small drawing."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.class_map import ClassMap
from ViTTransferFunction.Logic.core.classes.region_points import points_of_outline
from ViTTransferFunction.Logic.scene.interface.message_texts import CloserLookReason
from ViTTransferFunction.Testing.support.corrected import (
    BESIDE,
    CELLS,
    FAR,
    LARGE_MM,
    MIDDLE,
    SMALL_MM,
    VAGUE_MM,
    VOXELS,
    WITHIN,
    Corrected,
    circle,
    sphere,
)


def test_a_closer_look_is_suggested_as_long_as_the_extent_is_vague_from_the_first_click_on(corrected: Corrected) -> None:
    assert corrected.reason() is None
    corrected.show_vaguely()
    said = [corrected.reason()]
    corrected.cut(WITHIN)
    said.append(corrected.reason())
    corrected.show(corrected.id)
    said.append(corrected.reason())
    assert said == ["vague extent", "vague extent", None]


def test_each_structure_is_judged_by_its_own_map(corrected: Corrected) -> None:
    other = corrected.annotations.duplicate_class(corrected.id)
    corrected.show_vaguely()
    corrected.show(other.id)
    assert (corrected.reason(), corrected.reason(other)) == ("vague extent", None)


def test_while_a_map_is_awaited_the_one_before_says_whether_the_extent_is_vague(corrected: Corrected) -> None:
    corrected.show_vaguely()
    corrected.proxy.up_to_date = False
    assert corrected.reason() is None
    corrected.proxy.up_to_date = True
    assert corrected.reason() == "vague extent"
    corrected.show(corrected.id)
    corrected.proxy.up_to_date = False
    assert corrected.reason() == "vague extent"
    corrected.proxy.up_to_date = True
    assert corrected.reason() is None


def test_where_no_box_is_possible_there_is_nothing_to_suggest(corrected: Corrected) -> None:
    corrected.show_vaguely()
    corrected.add(np.array([5.0, 5.0, 5.0]))
    corrected.show_vaguely()
    assert corrected.reason() is None


def test_who_has_looked_closer_is_not_told_again(corrected: Corrected) -> None:
    corrected.show_vaguely()
    corrected.annotations.set_close_up(corrected.id, (*MIDDLE.tolist(), 50.0, 50.0, 50.0))
    assert corrected.reason() is None
    corrected.annotations.set_close_up(corrected.id, None)
    corrected.cut(WITHIN)
    assert corrected.reason() is None


def test_coarse_features_suggest_nothing_and_neither_does_what_is_not_shown(corrected: Corrected) -> None:
    corrected.show_vaguely()
    corrected.proxy.phase = "extracting"
    assert corrected.reason() is None
    corrected.proxy.phase = "ready"
    assert corrected.reason() == "vague extent"
    del corrected.proxy.low_maps[corrected.id]
    assert corrected.reason() is None


def test_a_diameter_of_less_than_four_cells_suggests_a_closer_look(corrected: Corrected) -> None:
    corrected.draw(LARGE_MM)
    assert corrected.reason() is None
    corrected.annotations.undo()
    corrected.draw(SMALL_MM)
    assert corrected.reason() == "small drawing"
    # Of another preset, or of another number of cells.
    corrected.proxy.low_maps[corrected.id] = sphere(VOXELS.resized((30, 30, 30)), in_bytes=False)
    assert corrected.reason() is None


def test_the_hint_at_a_small_drawing_is_undone_and_comes_back_with_it(corrected: Corrected) -> None:
    corrected.draw(SMALL_MM)
    said, undo, redo = [], corrected.annotations.undo, corrected.annotations.redo
    for step in (undo, redo, lambda: corrected.annotations.remove_last_point(corrected.id)):
        step()
        said.append(corrected.reason())
    assert said == [None, "small drawing", None]


def test_the_hint_at_a_small_drawing_goes_with_the_next_point_and_comes_back_with_undo(corrected: Corrected) -> None:
    corrected.draw(SMALL_MM)
    corrected.cut(FAR)
    assert corrected.reason() is None
    corrected.annotations.undo()
    assert corrected.reason() == "small drawing"


def test_after_a_small_drawing_the_map_says_whether_the_extent_is_vague(corrected: Corrected) -> None:
    corrected.show_vaguely()
    corrected.draw(SMALL_MM)
    said = [corrected.reason()]
    corrected.cut(FAR)
    said.append(corrected.reason())
    assert said == ["small drawing", "vague extent"]


def test_of_an_outline_that_a_structure_begins_with_nothing_is_suggested_until_the_next_point(corrected: Corrected) -> None:
    id_ = corrected.begin(0.5 * LARGE_MM + 1.0)
    corrected.show(id_, VAGUE_MM)
    assert corrected.reason(corrected.annotations.classes[-1]) is None
    corrected.annotations.add_points(id_, FAR[None], positive=False)
    assert corrected.reason(corrected.annotations.classes[-1]) == "vague extent"


def test_what_was_before_a_small_drawing_does_not_matter(corrected: Corrected) -> None:
    corrected.add(BESIDE)
    corrected.cut(WITHIN)
    corrected.draw(SMALL_MM)
    assert corrected.reason() == "small drawing"


def test_the_last_drawing_counts(corrected: Corrected) -> None:
    corrected.draw(SMALL_MM)
    corrected.draw(LARGE_MM, FAR)
    assert corrected.reason() is None
    corrected.draw(SMALL_MM, MIDDLE + 1.0)
    assert corrected.reason() == "small drawing"


def test_who_has_looked_closer_is_not_told_of_a_small_drawing(corrected: Corrected) -> None:
    corrected.draw(SMALL_MM)
    corrected.annotations.set_close_up(corrected.id, (*MIDDLE.tolist(), 50.0, 50.0, 50.0))
    assert corrected.reason() is None
    corrected.annotations.undo()
    assert corrected.reason() is None


def test_what_was_drawn_before_scene_or_volume_were_others_suggests_nothing(corrected: Corrected) -> None:
    corrected.draw(SMALL_MM)
    corrected.hints.forget()
    assert corrected.reason() is None


def test_a_small_drawing_in_a_scene_that_was_opened_with_its_structure_counts(corrected: Corrected) -> None:
    corrected.open_anew()
    corrected.draw(SMALL_MM)
    assert corrected.reason() == "small drawing"


def test_what_was_drawn_is_small_no_longer_when_a_point_of_it_was_moved(corrected: Corrected) -> None:
    corrected.draw(SMALL_MM)
    corrected.move(True, 0, FAR)
    assert corrected.reason() is None


@pytest.mark.parametrize(
    ("length_mm", "width", "reason"),
    [(LARGE_MM + 1.0, 1.0, None), (SMALL_MM - 1.0, 1.0, "small drawing"), (SMALL_MM - 1.0, 0.7, "small drawing")],
)
def test_an_outline_is_as_small_as_it_is_long(
    corrected: Corrected, length_mm: float, width: float, reason: CloserLookReason | None
) -> None:
    corrected.draw_points(*points_of_outline(circle(0.5 * length_mm, width), 1.0))
    assert corrected.reason() == reason


def test_a_small_drawing_suggests_nothing_before_anything_is_shown_or_where_no_box_is_possible(corrected: Corrected) -> None:
    low_map = corrected.proxy.low_maps.pop(corrected.id)
    corrected.draw(SMALL_MM)
    assert corrected.reason() is None
    corrected.proxy.low_maps[corrected.id] = low_map
    corrected.proxy.phase = "extracting"
    assert corrected.reason() is None
    corrected.proxy.phase = "ready"
    assert corrected.reason() == "small drawing"
    corrected.proxy.low_maps[corrected.id] = ClassMap(np.ones(CELLS.shape, dtype=np.float32), CELLS, 0.5)
    assert corrected.reason() is None
