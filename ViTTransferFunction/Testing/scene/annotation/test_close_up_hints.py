"""When a closer look is suggested: after two large corrections of what is shown, or a small drawing; until what ends it."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.class_map import FULL_SCALE, ClassMap
from ViTTransferFunction.Logic.core.classes.region_points import points_of_outline
from ViTTransferFunction.Logic.scene.interface.wording import CloserLookReason
from ViTTransferFunction.Testing.support.corrected import (
    BESIDE,
    CELLS,
    DEEP,
    DEEPER,
    FAR,
    LARGE_MM,
    MIDDLE,
    SHALLOW,
    SMALL_MM,
    VOXELS,
    Corrected,
    circle,
    sphere,
)
from ViTTransferFunction.Testing.support.scenes import MOVED, put_under


def test_a_closer_look_is_suggested_from_the_second_gross_correction_until_one_that_is_not(corrected: Corrected) -> None:
    said = [corrected.suggests()]
    # The last two: what was passed over is not said again.
    for point in (DEEP, DEEPER, DEEP + 1.0, SHALLOW, DEEP - 1.0, DEEPER - 1.0):
        corrected.cut(point)
        said.append(corrected.suggests())
    assert said == [False, False, True, True, False, False, False]


def test_points_on_the_structure_count_as_well(corrected: Corrected) -> None:
    corrected.add(FAR)
    assert not corrected.suggests()
    corrected.cut(DEEP)
    assert corrected.suggests()


def test_several_like_objects_clicked_one_after_the_other_suggest_nothing(corrected: Corrected) -> None:
    corrected.add(FAR)
    corrected.add(FAR + np.array([0.0, 8.0, 0.0]))
    corrected.add(FAR - np.array([0.0, 8.0, 0.0]))
    assert not corrected.suggests()
    corrected.cut(DEEP)
    assert corrected.suggests()


def test_small_corrections_suggest_nothing(corrected: Corrected) -> None:
    for shift in (0.0, 0.5, 1.0):
        corrected.cut(SHALLOW + shift)
        corrected.add(BESIDE + shift)
        corrected.add(MIDDLE + shift)
        corrected.cut(FAR + shift)
    assert not corrected.suggests()


def test_between_gross_corrections_there_may_be_others(corrected: Corrected) -> None:
    corrected.cut(DEEP)
    corrected.cut(SHALLOW)
    corrected.cut(DEEPER)
    assert corrected.suggests()


def test_what_is_refined_is_judged_as_it_is_shown_by_the_width_of_a_cell(corrected: Corrected) -> None:
    everything = ClassMap(np.full(VOXELS.shape, FULL_SCALE, dtype=np.uint8), VOXELS, 0.5)
    corrected.proxy.maps[corrected.id] = everything
    corrected.add(FAR)
    corrected.add(FAR + 1.0)
    assert not corrected.suggests()
    corrected.cut(BESIDE)
    corrected.cut(SHALLOW)
    assert corrected.suggests()


def test_it_goes_with_what_is_undone_and_comes_back_with_it(corrected: Corrected) -> None:
    corrected.cut(DEEP)
    corrected.cut(DEEPER)
    corrected.cut(SHALLOW)
    said, undo, redo = [], corrected.annotations.undo, corrected.annotations.redo
    for step in (undo, undo, redo, redo):
        step()
        said.append(corrected.suggests())
    assert said == [True, False, True, False]


def test_points_that_are_brought_back_are_not_judged_again(corrected: Corrected) -> None:
    corrected.proxy.phase = "extracting"
    corrected.cut(DEEP)
    corrected.cut(DEEPER)
    corrected.proxy.phase = "ready"
    corrected.annotations.undo()
    corrected.annotations.undo()
    corrected.annotations.redo()
    corrected.annotations.redo()
    assert len(corrected.state.negative) == 2
    assert not corrected.suggests()


def test_it_goes_with_points_that_are_removed_and_comes_with_new_ones(corrected: Corrected) -> None:
    corrected.cut(DEEP)
    corrected.cut(DEEPER)
    corrected.annotations.erase_points(np.array([DEEP, DEEPER]), 1.0)
    assert not corrected.suggests()
    corrected.cut(DEEP + 1.0)
    assert not corrected.suggests()
    corrected.cut(DEEPER + 1.0)
    assert corrected.suggests()


def test_who_has_looked_closer_is_not_told_again(corrected: Corrected) -> None:
    corrected.cut(DEEP)
    corrected.cut(DEEPER)
    corrected.annotations.set_close_up(corrected.id, (*MIDDLE.tolist(), 50.0, 50.0, 50.0))
    assert not corrected.suggests()
    corrected.annotations.set_close_up(corrected.id, None)
    corrected.cut(DEEP + 1.0)
    assert not corrected.suggests()


def test_what_is_wrong_in_a_close_up_is_not_the_whole_volumes_fault(corrected: Corrected) -> None:
    corrected.annotations.set_close_up(corrected.id, (*MIDDLE.tolist(), 50.0, 50.0, 50.0))
    corrected.cut(DEEP)
    corrected.cut(DEEPER)
    corrected.annotations.set_close_up(corrected.id, None)
    assert not corrected.suggests()


def test_where_no_box_is_possible_there_is_nothing_to_suggest(corrected: Corrected) -> None:
    corrected.cut(DEEP)
    corrected.add(np.array([5.0, 5.0, 5.0]))
    assert not corrected.suggests()


def test_whether_a_box_is_possible_follows_the_map_and_stays_while_one_is_awaited(corrected: Corrected) -> None:
    corrected.cut(DEEP)
    corrected.proxy.up_to_date = False
    assert not corrected.suggests()
    corrected.proxy.up_to_date = True
    corrected.cut(DEEPER)
    assert corrected.suggests()
    everything = ClassMap(np.ones(CELLS.shape, dtype=np.float32), CELLS, 0.5)
    corrected.proxy.low_maps[corrected.id] = everything
    corrected.proxy.up_to_date = False
    assert corrected.suggests()
    corrected.proxy.up_to_date = True
    assert not corrected.suggests()
    del corrected.proxy.low_maps[corrected.id]
    assert not corrected.suggests()


@pytest.mark.parametrize("unseen", ["awaited", "coarse", "stale", "hidden", "missing"])
def test_what_is_placed_while_nothing_of_it_is_shown_corrected_nothing(corrected: Corrected, unseen: str) -> None:
    if unseen == "awaited":
        corrected.proxy.up_to_date = False
    elif unseen == "coarse":
        corrected.proxy.phase = "extracting"
    elif unseen == "stale":
        corrected.volume.changed = True
    elif unseen == "missing":
        corrected.proxy.maps = {}
    for place in (DEEP, DEEPER):
        if unseen == "hidden":  # Until the first one is placed.
            corrected.annotations.set_class(corrected.id, visible=False)
        corrected.cut(place)
    corrected.proxy.up_to_date, corrected.proxy.phase, corrected.volume.changed = True, "ready", False
    corrected.show(corrected.id)
    assert not corrected.suggests()
    # One is not enough, and those before are none.
    corrected.cut(DEEP + 1.0)
    assert not corrected.suggests()


def test_a_class_that_begins_with_points_was_not_corrected(corrected: Corrected) -> None:
    corrected.cut(DEEP)
    corrected.cut(DEEPER)
    copied = corrected.annotations.duplicate_class(corrected.id)
    corrected.show(copied.id)
    assert not corrected.suggests(copied)
    assert corrected.suggests()
    corrected.annotations.remove_class(corrected.id)
    corrected.annotations.undo()
    assert corrected.suggests()


def test_a_stroke_is_one_correction(corrected: Corrected) -> None:
    corrected.cut(SHALLOW)
    corrected.cut(DEEP, continued=True)
    corrected.cut(DEEPER, continued=True)
    assert not corrected.suggests()
    corrected.cut(DEEP + 1.0)
    assert corrected.suggests()
    corrected.cut(SHALLOW + 1.0, continued=True)
    assert corrected.suggests()


def test_a_region_is_one_correction_and_gross_where_a_point_of_it_is(corrected: Corrected) -> None:
    corrected.cut(SHALLOW, DEEP, DEEPER)
    assert not corrected.suggests()
    corrected.cut(SHALLOW + 1.0, DEEP + 1.0)
    assert corrected.suggests()


def test_a_diameter_is_one_correction_with_what_lies_beyond_its_ends(corrected: Corrected) -> None:
    corrected.annotations.add_points_of_both(corrected.id, np.array([FAR, FAR + 1.0]), np.array([DEEP, DEEPER]))
    assert not corrected.suggests()
    corrected.cut(DEEP + 1.0)
    assert corrected.suggests()


def test_a_moved_point_is_no_new_correction(corrected: Corrected) -> None:
    corrected.cut(DEEP)
    corrected.cut(SHALLOW)
    corrected.move(False, 1, DEEPER)
    assert not corrected.suggests()


def test_a_gross_correction_that_is_moved_stays_one(corrected: Corrected) -> None:
    corrected.cut(DEEP)
    corrected.cut(DEEPER)
    corrected.move(False, 0, SHALLOW)
    assert corrected.suggests()
    corrected.annotations.undo()
    assert corrected.suggests()
    corrected.annotations.undo()
    assert not corrected.suggests()


def test_another_volume_begins_anew(corrected: Corrected) -> None:
    corrected.cut(DEEP)
    corrected.cut(DEEPER)
    corrected.hints.forget()
    assert not corrected.suggests()
    corrected.annotations.undo()
    corrected.annotations.redo()
    assert not corrected.suggests()
    corrected.cut(DEEP + 1.0)
    assert not corrected.suggests()
    corrected.cut(DEEPER + 1.0)
    assert corrected.suggests()


def test_points_are_judged_where_the_volume_was_moved_to(corrected: Corrected) -> None:
    put_under(corrected.node, MOVED)
    moved = [MOVED[:3, :3] @ point + MOVED[:3, 3] for point in (MIDDLE, DEEP, DEEPER)]
    corrected.move(True, 0, moved[0])
    corrected.cut(moved[1])
    assert not corrected.suggests()
    corrected.cut(moved[2])
    assert corrected.suggests()


def test_points_beyond_the_volume_correct_nothing(corrected: Corrected) -> None:
    corrected.add(MIDDLE + 200.0)
    corrected.add(MIDDLE - 200.0)
    assert not corrected.suggests()


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


def test_the_hint_at_a_small_drawing_stays_until_a_correction_that_is_not_gross(corrected: Corrected) -> None:
    corrected.draw(SMALL_MM)
    corrected.add(FAR)
    said = [corrected.reason()]
    for point in (DEEP, SHALLOW):
        corrected.cut(point)
        said.append(corrected.reason())
    assert said == ["small drawing", "large corrections", None]
    corrected.annotations.undo()
    corrected.annotations.undo()
    corrected.cut(SHALLOW)
    assert corrected.reason() is None


def test_a_stroke_after_a_small_drawing_is_gross_where_a_point_of_it_is(corrected: Corrected) -> None:
    corrected.draw(SMALL_MM)
    corrected.cut(SHALLOW)
    assert corrected.reason() is None
    corrected.cut(DEEP, continued=True)
    assert corrected.reason() == "small drawing"


def test_what_was_before_a_small_drawing_does_not_matter(corrected: Corrected) -> None:
    corrected.add(BESIDE)
    corrected.cut(SHALLOW)
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
