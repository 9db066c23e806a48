"""When a closer look is suggested: after two large corrections of what is shown, or a small drawing; until what ends it.

And when it comes unasked: where a structure begins with a small outline, and is shown as something else.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import slicer

from ViTTransferFunction.Logic.core import close_up_choice
from ViTTransferFunction.Logic.core.class_map import FULL_SCALE, ClassMap
from ViTTransferFunction.Logic.core.diameter_points import points_of_diameter
from ViTTransferFunction.Logic.core.geometry import Geometry
from ViTTransferFunction.Logic.core.region_points import points_of_outline
from ViTTransferFunction.Logic.scene.annotations import SceneAnnotations
from ViTTransferFunction.Logic.scene.class_requests import ClassRequests, class_requests
from ViTTransferFunction.Logic.scene.class_state import ClassState
from ViTTransferFunction.Logic.scene.close_up_hints import CloseUpHints
from ViTTransferFunction.Logic.scene.volume import set_image
from ViTTransferFunction.Logic.scene.volume_content import content_of
from ViTTransferFunction.Logic.scene.wording import CloserLookReason
from ViTTransferFunction.Testing.support.scenes import MOVED, add_parameter_node, put_under

VOXELS = Geometry((60, 60, 60), np.diag([2.0, 2.0, 2.0, 1.0]))
CELLS = VOXELS.resized((24, 24, 24))
"""Of 5 mm."""
MIDDLE, RADIUS_MM = np.array([59.0, 59.0, 59.0]), 20.0
DEEP, DEEPER = MIDDLE + np.array([10.0, 0.0, 0.0]), MIDDLE + np.array([0.0, 3.0, 0.0])
"""Within what is shown, and farther from its surface than a cell is wide."""
SHALLOW, BESIDE = MIDDLE + np.array([18.0, 0.0, 0.0]), MIDDLE + np.array([23.0, 0.0, 0.0])
FAR = MIDDLE + np.array([30.0, 0.0, 0.0])


SMALL_MM, LARGE_MM = 19.0, 21.0
"""Of less and more than four cells."""


def sphere(geometry: Geometry, in_bytes: bool, radius_mm: float = RADIUS_MM) -> ClassMap:
    away = np.linalg.norm(geometry.voxel_centres_ras() - MIDDLE, axis=1).reshape(geometry.shape)
    array = np.clip(0.5 + (radius_mm - away) / 10.0, 0.0, 1.0).astype(np.float32)
    return ClassMap(np.rint(FULL_SCALE * array).astype(np.uint8) if in_bytes else array, geometry, 0.5)


def circle(radius_mm: float, width: float = 1.0) -> np.ndarray:
    """Around the middle, (60, 3) RAS millimetres; or an ellipse, which is so much as wide as it is long."""
    angles = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    return MIDDLE + radius_mm * np.stack([np.cos(angles), width * np.sin(angles), 0.0 * angles], axis=1)


class Corrected:
    """A class of which a sphere is shown whatever is clicked, and what is made of how it is corrected.

    Attributes:
        annotations: of the class; after each change, the answer is there at once, unless `proxy.up_to_date` says otherwise.
        proxy: has the maps.
        volume: is looked at.
    """

    proxy: Any
    volume: Any

    def __init__(self, scene: Any) -> None:
        self.node = scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "CT")
        set_image(self.node, np.zeros(VOXELS.shape, dtype=np.int16), VOXELS.ijk_to_ras)
        self.volume = SimpleNamespace(content=SimpleNamespace(geometry=VOXELS), changed=False)
        self.proxy = SimpleNamespace(phase="ready", up_to_date=True, maps={}, low_maps={}, refined=())
        self.annotations = SceneAnnotations(scene, add_parameter_node(scene), lambda: self.hints.note())
        parameters: Any = SimpleNamespace(volume=self.node)
        self.hints = CloseUpHints(parameters, self.annotations, self.volume, self.proxy)
        self.id = self.annotations.add_class("aorta").id
        self.add(MIDDLE)
        self.show(self.id)

    @property
    def state(self) -> ClassState:
        return self.annotations.classes[0]

    def show(self, id_: str) -> None:
        self.proxy.maps[id_], self.proxy.low_maps[id_] = sphere(VOXELS, in_bytes=True), sphere(CELLS, in_bytes=False)

    def add(self, *points_ras: np.ndarray, positive: bool = True, continued: bool = False) -> None:
        self.annotations.add_points(self.id, np.array(points_ras), positive, continued)

    def cut(self, *points_ras: np.ndarray, continued: bool = False) -> None:
        self.add(*points_ras, positive=False, continued=continued)

    def move(self, positive: bool, index: int, to_ras: np.ndarray) -> None:
        """Drag a point."""
        points = self.annotations.points_node(self.id, positive)
        points.SetNthControlPointPositionWorld(index, *to_ras)
        points.InvokeEvent(slicer.vtkMRMLMarkupsNode.PointEndInteractionEvent)

    def draw(self, length_mm: float, middle_ras: np.ndarray = MIDDLE) -> None:
        """Draw a diameter where nothing was shown."""
        half = 0.5 * length_mm * np.array([0.0, 0.6, 0.8])
        self.draw_points(*points_of_diameter(np.stack([middle_ras - half, middle_ras + half])))

    def draw_points(self, inside_ras: np.ndarray, outside_ras: np.ndarray) -> None:
        """Draw what stands for these points where nothing was shown."""
        shown, self.proxy.maps = self.proxy.maps, {}
        self.annotations.add_points_of_both(self.id, inside_ras, outside_ras)
        self.proxy.maps = shown

    def begin(self, radius_mm: float, shown_mm: float = RADIUS_MM) -> str:
        """Begin a class with an outline around the middle; then a sphere of `shown_mm` is shown of it. Returns its id."""
        id_ = self.annotations.add_class(f"structure {len(self.annotations.classes)}").id
        self.outline(id_, radius_mm)
        self.proxy.maps[id_] = sphere(VOXELS, in_bytes=True, radius_mm=shown_mm)
        self.proxy.low_maps[id_] = sphere(CELLS, in_bytes=False, radius_mm=shown_mm)
        self.proxy.refined = (True,) * len(self.proxy.maps)
        return id_

    def outline(self, id_: str, radius_mm: float) -> None:
        outline = circle(radius_mm)
        self.annotations.add_points_of_both(id_, *points_of_outline(outline))
        self.hints.note_outline(id_, outline)

    def unasked(self) -> list[str]:
        """The classes that are to be looked at closely now; they are at once."""
        ids = list(self.hints.take_unasked(self.requests))
        for id_ in ids:
            self.annotations.set_close_up(id_, (*MIDDLE.tolist(), 50.0, 50.0, 50.0))
        return ids

    @property
    def requests(self) -> ClassRequests:
        return class_requests(self.annotations.classes, {}, self.node, content_of(self.node))

    def reason(self, state: ClassState | None = None) -> CloserLookReason | None:
        return self.hints.of(state or self.state, self.requests)

    def suggests(self, state: ClassState | None = None) -> bool:
        reason = self.reason(state)
        assert reason in (None, "large corrections")
        return reason is not None


@pytest.fixture
def corrected(slicer_app: Any) -> Any:
    corrected = Corrected(slicer_app.scene)
    yield corrected
    corrected.annotations.close()


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
    corrected.draw_points(*points_of_outline(circle(0.5 * length_mm, width)))
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
    corrected.annotations.add_points_of_both(id_, *points_of_outline(outline))
    corrected.hints.note_outline(id_, outline)
    corrected.proxy.maps = {id_: sphere(VOXELS, in_bytes=True, radius_mm=SMALL_RADIUS_MM)}
    corrected.proxy.low_maps = {id_: sphere(CELLS, in_bytes=False)}
    corrected.proxy.refined = (True,)
    # As it was outlined; elsewhere there is nothing.
    assert corrected.unasked() == []
