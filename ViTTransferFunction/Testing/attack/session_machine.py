"""A session while anything is done in any order, with what must hold meanwhile and at rest; hypothesis chooses and shortens."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import vtk
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.scene.classes.class_nodes import class_nodes, read_class
from ViTTransferFunction.Logic.scene.classes.class_state import Classes
from ViTTransferFunction.Logic.scene.mrml.nodes import displays_of, nodes_of_class
from ViTTransferFunction.Testing.support.scenes import FollowUp, add_segment, open_spheres, segment_masks
from ViTTransferFunction.Testing.support.segments import everything_about
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras

THEIRS = ("bone", "fat")
MOST_CLASSES = 4
PATIENCE_S = 120.0

places = st.tuples(*[st.floats(-14.0, 14.0)] * 3)
which = st.integers(0, MOST_CLASSES - 1)


class Desk:
    """One session, which many sequences of actions follow each other on.

    Args:
        app: the application.
        spheres: what is segmented.
    """

    def __init__(self, app: Any, spheres: Spheres) -> None:
        self.scene, self.spheres = app.scene, spheres
        self.session = open_spheres(app, spheres)
        self.volume, self.follow_up = self.session.parameters.volume, FollowUp(app.scene, spheres).volume
        self.theirs = app.scene.AddNewNodeByClass("vtkMRMLSegmentationNode", "theirs")
        self.theirs.CreateDefaultDisplayNodes()
        for label, name in enumerate(THEIRS, start=2):
            add_segment(self.theirs, name, spheres[1] == label, spheres[0].geometry.ijk_to_ras)
        self.of_others = self.about_others()
        self.session.set_segmentation(self.theirs)
        self.show_everything()
        self.clear()

    def about_others(self) -> list[dict[str, Any]]:
        """All that must not change about the segments of others."""
        return [everything_about(self.theirs, name) for name in THEIRS]

    def counts(self) -> tuple[int, int]:
        """How many nodes the scene has, and how many observers the session."""
        return self.scene.GetNumberOfNodes(), self.session.observer_count

    def show_everything(self) -> None:
        """So that what is made once, and stays, is there."""
        state = self.session.annotations.add_class()
        self.session.annotations.add_points(state.id, centre_ras(self.spheres, 1), positive=True)
        for mode in ("similarity", "transfer function"):
            self.session.parameters.set("rendering", mode)
            self.session.wait(PATIENCE_S)

    def clear(self) -> None:
        """Take back all that was done but for undo, and come to rest."""
        for volume in (self.follow_up, self.volume):
            self.session.set_volume(volume)
            for state in self.session.classes:
                self.session.annotations.remove_class(state.id)
        # What was shown of the volume goes with it, be it much or nothing.
        self.session.set_volume(None)
        self.session.wait(PATIENCE_S)
        self.session.set_volume(self.volume)
        self.session.set_segmentation(self.theirs)
        for node in nodes_of_class(self.scene, "vtkMRMLSegmentationNode"):
            if node is not self.theirs:
                for each in (*displays_of(node), node):
                    self.scene.RemoveNode(each)
        for name in ("respectOtherSegments", "otherSegmentsAreOutside", "overlayVisible", "proposalsVisible", "rendering"):
            self.session.parameters.set(name, self.session.parameters.DEFAULTS[name])
        self.session.wait(PATIENCE_S)
        segmentation = self.theirs.GetSegmentation()
        for segment_id in [segmentation.GetNthSegmentID(n) for n in range(segmentation.GetNumberOfSegments())]:
            if segment_id not in THEIRS:
                segmentation.RemoveSegment(segment_id)
        self.session.wait(PATIENCE_S)


def machine_at(desk: Desk) -> type[RuleBasedStateMachine]:
    """The actions on a session, for `hypothesis.stateful.run_state_machine_as_test`."""

    class SessionMachine(RuleBasedStateMachine):
        @initialize()
        def open(self) -> None:
            self.session, self.annotations = desk.session, desk.session.annotations
            self.at_rest = desk.counts()
            self.left: dict[Any, Classes] = {}
            self.add_class()
            self.add_points(0, True, (0.0, 0.0, 0.0), 1)

        def class_at(self, at: int) -> str:
            return self.session.classes[at % len(self.session.classes)].id

        def can_be_taken_back(self, action: Callable[[], Any]) -> None:
            before = self.session.classes
            action()
            after = self.session.classes
            if after != before:
                self.annotations.undo()
                assert self.session.classes == before
                self.annotations.redo()
                assert self.session.classes == after

        @precondition(lambda self: len(self.session.classes) < MOST_CLASSES)
        @rule()
        def add_class(self) -> None:
            self.can_be_taken_back(self.annotations.add_class)

        @precondition(lambda self: 0 < len(self.session.classes) < MOST_CLASSES)
        @rule(at=which)
        def duplicate_class(self, at: int) -> None:
            self.can_be_taken_back(lambda: self.annotations.duplicate_class(self.class_at(at)))

        @precondition(lambda self: self.session.classes)
        @rule(at=which)
        def remove_class(self, at: int) -> None:
            self.can_be_taken_back(lambda: self.annotations.remove_class(self.class_at(at)))

        @precondition(lambda self: self.session.classes)
        @rule(at=which, step=st.sampled_from((-1, 1)))
        def move_class(self, at: int, step: int) -> None:
            self.can_be_taken_back(lambda: self.annotations.move_class(self.class_at(at), step))

        @precondition(lambda self: self.session.classes)
        @rule(at=which, positive=st.booleans(), offset=places, label=st.integers(1, 3))
        def add_points(self, at: int, positive: bool, offset: tuple[float, float, float], label: int) -> None:
            point = centre_ras(desk.spheres, label) + offset
            self.can_be_taken_back(lambda: self.annotations.add_points(self.class_at(at), point, positive))

        @precondition(lambda self: self.session.classes)
        @rule(at=which, positive=st.booleans(), offset=places, label=st.integers(1, 3))
        def place_point(self, at: int, positive: bool, offset: tuple[float, float, float], label: int) -> None:
            node = self.annotations.points_node(self.class_at(at), positive)
            point = vtk.vtkVector3d(*(centre_ras(desk.spheres, label)[0] + offset))
            self.can_be_taken_back(lambda: node.AddControlPointWorld(point))

        @precondition(lambda self: self.session.classes)
        @rule(at=which)
        def remove_last_point(self, at: int) -> None:
            self.can_be_taken_back(lambda: self.annotations.remove_last_point(self.class_at(at)))

        @rule(offset=places, label=st.integers(1, 3), radius_mm=st.floats(0.0, 30.0))
        def erase_points(self, offset: tuple[float, float, float], label: int, radius_mm: float) -> None:
            near = centre_ras(desk.spheres, label) + offset
            self.can_be_taken_back(lambda: self.annotations.erase_points(near, radius_mm))

        @precondition(lambda self: self.session.classes)
        @rule(at=which, positive=st.booleans())
        def delete_list(self, at: int, positive: bool) -> None:
            node = self.annotations.points_node(self.class_at(at), positive)
            display = node.GetDisplayNode()
            self.can_be_taken_back(lambda: desk.scene.RemoveNode(node))
            # Whoever deletes a list in Slicer deletes what displays it.
            desk.scene.RemoveNode(display)

        @precondition(lambda self: self.session.classes)
        @rule(at=which, step=st.sampled_from((-1, 1)), wheel=st.booleans())
        def change_size(self, at: int, step: Literal[-1, 1], wheel: bool) -> None:
            (self.annotations.turn_size if wheel else self.annotations.step_size)(self.class_at(at), step)

        @precondition(lambda self: self.session.classes)
        @rule(
            at=which,
            fields=st.fixed_dictionaries(
                {},
                optional={
                    "iso": st.none() | st.floats(0.0, 1.0),
                    "proximity": st.floats(0.0, 1.0),
                    "opacity": st.floats(0.0, 1.0),
                    "visible": st.booleans(),
                    "refine": st.booleans(),
                    "name": st.text(min_size=1, max_size=5).filter(str.strip),
                },
            ),
        )
        def set_class(self, at: int, fields: dict[str, Any]) -> None:
            before = self.session.classes
            try:
                self.annotations.set_class(self.class_at(at), **fields)
            except InputError:
                assert self.session.classes == before

        @precondition(lambda self: self.session.classes)
        @rule(at=which, name=st.text(max_size=5))
        def rename_list(self, at: int, name: str) -> None:
            node = self.annotations.points_node(self.class_at(at), True)
            self.can_be_taken_back(lambda: node.SetName(name))

        @rule(steps=st.integers(1, 4))
        def undo_and_redo(self, steps: int) -> None:
            states = [self.session.classes]
            for _ in range(steps):
                if self.annotations.can_undo:
                    self.annotations.undo()
                    states.append(self.session.classes)
            for state in states[-2::-1]:
                self.annotations.redo()
                assert self.session.classes == state

        @rule(
            change=st.sampled_from((
                ("rendering", "off"), ("rendering", "similarity"), ("rendering", "transfer function"),
                ("otherSegmentsAreOutside", True), ("otherSegmentsAreOutside", False),
                ("respectOtherSegments", True), ("respectOtherSegments", False),
                ("overlayVisible", True), ("overlayVisible", False), ("proposalsVisible", True), ("proposalsVisible", False),
            ))
        )  # fmt: skip
        def change_setting(self, change: tuple[str, Any]) -> None:
            self.session.parameters.set(*change)

        @rule(volume=st.sampled_from((desk.volume, desk.follow_up, None)))
        def choose_volume(self, volume: Any) -> None:
            self.left[self.session.parameters.volume] = self.session.classes
            self.session.set_volume(volume)
            there = [state for state in self.left.get(volume, ()) if state.positive or state.negative]
            # What was made while no volume was chosen goes to the next one.
            assert volume is None or [state for state in self.session.classes if state in there] == there

        @rule(count=st.integers(0, 20))
        def poll(self, count: int) -> None:
            for _ in range(count):
                self.session.poll()

        @rule()
        def cancel(self) -> None:
            self.session.cancel()

        @rule()
        def rest(self) -> None:
            self.session.wait(PATIENCE_S)
            if self.session.phase == "ready":
                assert self.session.up_to_date
                self.what_is_shown_follows_from_the_points()

        def what_is_shown_follows_from_the_points(self) -> None:
            beyond = self.session.points_beyond
            for state in self.session.classes:
                inside = bool(state.positive) and beyond.get(state.id, 0) < len(state.positive)
                if state.id not in beyond:
                    assert (self.session.volume_ml(state.id) is not None) == inside, state

        @rule()
        def write_segments(self) -> None:
            self.session.wait(PATIENCE_S)
            written = [state for state in self.session.classes if self.session.volume_ml(state.id) is not None]
            respects = self.session.parameters.get("respectOtherSegments")
            self.session.segments.write("overwrite")
            self.session.wait(PATIENCE_S)
            if self.session.phase != "ready" or respects or not written:
                return
            millilitres = desk.spheres[0].geometry.voxel_volume_mm3 / 1000.0
            node = self.session.parameters.segmentation
            masks = segment_masks(node, self.session.parameters.volume)
            for state in written:
                segment_id = self.session.segments.of(state.id)
                if segment_id is not None:
                    name = node.GetSegmentation().GetSegment(segment_id).GetName()
                    shown = self.session.volume_ml(state.id)
                    assert shown is not None
                    assert abs(masks[name].sum() * millilitres - shown) <= 1e-6 * max(shown, 1.0), (state.name, shown)

        @invariant()
        def others_are_as_they_were(self) -> None:
            assert desk.about_others() == desk.of_others

        @invariant()
        def what_is_known_of_classes_is_what_the_scene_holds(self) -> None:
            nodes = class_nodes(desk.session.parameters.node)
            assert tuple(read_class(node) for node in nodes) == desk.session.classes

        def teardown(self) -> None:
            desk.clear()
            assert desk.counts() == self.at_rest
            error = desk.session.take_error()
            assert error is None or "There is nothing to segment" in error, error

    return SessionMachine
