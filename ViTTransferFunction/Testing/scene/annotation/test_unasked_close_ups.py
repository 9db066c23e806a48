"""When a closer look comes unasked: where a structure begins with a small outline, and is shown as something else."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes import close_up_choice
from ViTTransferFunction.Logic.core.classes.class_map import FULL_SCALE, ClassMap
from ViTTransferFunction.Logic.core.classes.region_points import points_of_outline
from ViTTransferFunction.Testing.support.corrected import (
    BESIDE,
    CELLS,
    FAR,
    LARGE_MM,
    MIDDLE,
    VOXELS,
    Corrected,
    circle,
    sphere,
)
from ViTTransferFunction.Testing.support.scenes import MOVED, put_under

SMALL_RADIUS_MM = 8.0


def test_what_begins_with_a_small_outline_and_is_shown_as_something_else_is_looked_at_unasked(corrected: Corrected) -> None:
    id_ = corrected.begin(SMALL_RADIUS_MM)
    assert corrected.unasked() == [id_]
    state = corrected.annotations.classes[-1]
    assert corrected.reason(state) == "small outline"
    corrected.annotations.add_points(id_, BESIDE[None], positive=True)
    assert corrected.reason(corrected.annotations.classes[-1]) is None


def test_what_is_shown_as_it_was_outlined_stays_in_the_whole_and_nothing_is_suggested(corrected: Corrected) -> None:
    corrected.begin(SMALL_RADIUS_MM, shown_mm=SMALL_RADIUS_MM)
    assert (corrected.unasked(), corrected.reason(corrected.annotations.classes[-1])) == ([], None)


def test_what_is_large_stays_in_the_whole(corrected: Corrected) -> None:
    corrected.begin(LARGE_MM / 2.0 + 1.0)
    assert corrected.unasked() == []


def test_an_outline_that_is_not_the_first_of_a_structure_is_left_to_its_user(corrected: Corrected) -> None:
    corrected.annotations.add_class("clicked")
    id_ = corrected.annotations.classes[-1].id
    corrected.annotations.add_points(id_, MIDDLE[None], positive=True)
    corrected.outline(id_, SMALL_RADIUS_MM)
    corrected.show(id_)
    corrected.proxy.refined = (True,) * len(corrected.proxy.maps)
    assert corrected.unasked() == []
    assert corrected.reason(corrected.annotations.classes[-1]) == "small drawing"


def test_an_outline_is_judged_once_and_not_again_by_what_corrections_make_of_it(corrected: Corrected) -> None:
    id_ = corrected.begin(SMALL_RADIUS_MM, shown_mm=SMALL_RADIUS_MM)
    assert corrected.unasked() == []
    corrected.show(id_)
    assert corrected.unasked() == []


def test_an_outline_of_which_a_point_was_removed_is_none_any_more(corrected: Corrected) -> None:
    id_ = corrected.begin(SMALL_RADIUS_MM)
    corrected.annotations.remove_last_point(id_)
    assert corrected.unasked() == []


def test_an_outline_beyond_which_there_is_nothing_of_the_scan_begins_none(corrected: Corrected) -> None:
    id_ = corrected.annotations.add_class("all there is").id
    outline = circle(SMALL_RADIUS_MM)
    inside, _ = points_of_outline(outline, 1.0)
    corrected.annotations.add_points(id_, inside, positive=True)
    corrected.hints.note_outline(id_, outline)
    corrected.show(id_)
    corrected.proxy.refined = (True,) * len(corrected.proxy.maps)
    assert corrected.unasked() == []


def test_who_went_back_to_the_whole_stays_there(corrected: Corrected) -> None:
    id_ = corrected.begin(SMALL_RADIUS_MM)
    corrected.unasked()
    corrected.annotations.undo()
    said = [corrected.annotations.classes[-1].close_up, corrected.unasked()]
    corrected.annotations.undo()
    corrected.annotations.redo()
    corrected.outline(id_, SMALL_RADIUS_MM - 1.0)
    assert [*said, corrected.unasked()] == [None, [], []]


@pytest.mark.parametrize("waits", ["coarse", "not refined", "awaited", "stale"])
def test_it_waits_for_what_the_whole_shows_in_the_end(corrected: Corrected, waits: str) -> None:
    id_ = corrected.begin(SMALL_RADIUS_MM)
    refined = corrected.proxy.refined
    if waits == "coarse":
        corrected.proxy.phase = "extracting"
    elif waits == "not refined":
        corrected.proxy.refined = (False,) * len(refined)
    elif waits == "awaited":
        corrected.proxy.up_to_date = False
    else:
        corrected.volume.changed = True
    assert corrected.unasked() == []
    corrected.proxy.phase, corrected.proxy.up_to_date, corrected.proxy.refined = "ready", True, refined
    corrected.volume.changed = False
    assert corrected.unasked() == [id_]


def test_what_was_undone_can_still_be_redone(corrected: Corrected) -> None:
    corrected.begin(SMALL_RADIUS_MM)
    corrected.cut(FAR)
    corrected.annotations.undo()
    assert corrected.unasked() == []
    corrected.annotations.redo()
    assert len(corrected.unasked()) == 1


@pytest.mark.parametrize("is_possible", [True, False])
def test_a_flood_of_the_scan_begins_one_where_a_box_about_the_outline_is_possible(
    corrected: Corrected, monkeypatch: pytest.MonkeyPatch, is_possible: bool
) -> None:
    id_ = corrected.begin(SMALL_RADIUS_MM)
    corrected.proxy.maps[id_] = ClassMap(np.full(VOXELS.shape, FULL_SCALE, dtype=np.uint8), VOXELS, 0.5)
    if not is_possible:
        monkeypatch.setattr(close_up_choice, "LARGEST_SHARE", 0.01)
    assert corrected.unasked() == ([id_] if is_possible else [])


def test_an_outline_is_compared_where_the_volume_was_moved_to(corrected: Corrected) -> None:
    put_under(corrected.node, MOVED)
    id_ = corrected.annotations.add_class("moved").id
    outline = circle(SMALL_RADIUS_MM) @ MOVED[:3, :3].T + MOVED[:3, 3]
    corrected.annotations.add_points_of_both(id_, *points_of_outline(outline, 1.0))
    corrected.hints.note_outline(id_, outline)
    corrected.proxy.maps = {id_: sphere(VOXELS, in_bytes=True, radius_mm=SMALL_RADIUS_MM)}
    corrected.proxy.low_maps = {id_: sphere(CELLS, in_bytes=False)}
    corrected.proxy.refined = (True,)
    # As it was outlined; elsewhere there is nothing.
    assert corrected.unasked() == []
