"""A session while a user does anything in any order, whatever is under way."""

from __future__ import annotations

import os
import random
import sys
from contextlib import suppress
from signal import SIGKILL
from typing import Any

import numpy as np
import pytest
import slicer
import vtk
from vtkmodules.util.numpy_support import vtk_to_numpy

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.scene.mrml.nodes import nodes_of_class
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.scenes import FollowUp, add_segment, open_spheres, put_under
from ViTTransferFunction.Testing.support.segments import everything_about
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras

STEPS = 120
MOST_CLASSES = 5
OBSERVERS, OBSERVERS_OF_A_CLASS = 40, 16
THEIRS = ("bone", "fat")
NOT_THERE_TO_BE_DELETED = (
    "vtkMRMLSegmentationDisplayNode", "vtkMRMLAbstractViewNode", "vtkMRMLSliceCompositeNode", "vtkMRMLColorNode",
    "vtkMRMLSubjectHierarchyNode",
)  # fmt: skip


class User:
    """Does what users do, by one method for each, as chance will have it.

    Args:
        app: the application.
        spheres: what is segmented.
        chance: decides the details.
    """

    def __init__(self, app: Any, spheres: Spheres, chance: random.Random) -> None:
        self._random = chance
        self._app, self._scene, self._spheres = app, app.scene, spheres
        self.session = open_spheres(app, spheres)
        self._parameter_node = app.scene.GetFirstNodeByClass("vtkMRMLScriptedModuleNode")
        self.volume = self.session.parameters.volume
        self._another_volume = FollowUp(app.scene, spheres).volume
        self.theirs = app.scene.AddNewNodeByClass("vtkMRMLSegmentationNode", "theirs")
        self.theirs.CreateDefaultDisplayNodes()
        for label, name in enumerate(THEIRS, start=2):
            add_segment(self.theirs, name, spheres[1] == label, spheres[0].geometry.ijk_to_ras)
        self.session.set_segmentation(self.theirs)

    @property
    def _ids(self) -> list[str]:
        return [state.id for state in self.session.classes]

    def _points(self, count: int = 1) -> np.ndarray:
        near = [self._random.uniform(-14.0, 14.0) for _ in range(3)]
        return np.concatenate([centre_ras(self._spheres, self._random.choice((1, 2, 3))) + near for _ in range(count)])

    def _segment_ids(self) -> list[str]:
        node = self.session.parameters.segmentation
        return list(node.GetSegmentation().GetSegmentIDs()) if node else []

    def add_a_class(self) -> None:
        if len(self._ids) < MOST_CLASSES:
            self.session.annotations.add_class()

    def duplicate_a_class(self) -> None:
        if 0 < len(self._ids) < MOST_CLASSES:
            self.session.annotations.duplicate_class(self._random.choice(self._ids))

    def continue_a_segment(self) -> None:
        if len(self._ids) < MOST_CLASSES and self._segment_ids():
            self.session.continue_segment(self._random.choice(self._segment_ids()))

    def move_a_class(self) -> None:
        if self._ids:
            self.session.annotations.move_class(self._random.choice(self._ids), self._random.choice((-1, 1)))

    def remove_a_class(self) -> None:
        if self._ids:
            self.session.annotations.remove_class(self._random.choice(self._ids))

    def add_points(self) -> None:
        if self._ids:
            positive = self._random.random() < 0.7
            self.session.annotations.add_points(self._random.choice(self._ids), self._points(2), positive)

    def place_a_point(self) -> None:
        if self._ids:
            node = self.session.annotations.points_node(self._random.choice(self._ids), self._random.random() < 0.7)
            node.AddControlPointWorld(vtk.vtkVector3d(*self._points()[0]))

    def delete_a_list(self) -> None:
        if self._ids:
            positive = self._random.random() < 0.5
            self._scene.RemoveNode(self.session.annotations.points_node(self._random.choice(self._ids), positive))

    def delete_lists_at_once(self) -> None:
        self._scene.StartState(self._scene.BatchProcessState)
        for id_ in self._ids[:2]:
            self._scene.RemoveNode(self.session.annotations.points_node(id_, positive=True))
        self._scene.EndState(self._scene.BatchProcessState)

    def step_a_size(self) -> None:
        if self._ids:
            self.session.annotations.step_size(self._random.choice(self._ids), self._random.choice((-1, 1)))

    def turn_the_wheel(self) -> None:
        if self._ids:
            self.session.annotations.turn_size(self._random.choice(self._ids), self._random.choice((-1, 1)))

    def undo(self) -> None:
        self.session.annotations.undo()

    def redo(self) -> None:
        self.session.annotations.redo()

    def change_a_setting(self) -> None:
        name, values = self._random.choice([
            ("rendering", ("off", "similarity", "transfer function")),
            ("otherSegmentsAreOutside", (True, False)),
            ("respectOtherSegments", (True, False)),
            ("refinement", ("bilateral", "none")),
            ("overlayVisible", (True, False)),
            ("proposalsVisible", (True, False)),
        ])  # fmt: skip
        self.session.parameters.set(name, self._random.choice(values))

    def choose_a_volume(self) -> None:
        self.session.set_volume(self._random.choice((self.volume, self.volume, self._another_volume, None)))

    def delete_the_other_volume_and_load_it_again(self) -> None:
        self._scene.RemoveNode(self._another_volume)
        self._another_volume = FollowUp(self._scene, self._spheres).volume

    def take_over_points_of_another_scan(self) -> None:
        scans = list(self.session.other_scans.names)
        if scans and len(self._ids) < MOST_CLASSES:
            with suppress(InputError):  # They may be there already.
                self.session.other_scans.take_over(self._random.choice(scans))

    def choose_a_segmentation(self) -> None:
        self.session.set_segmentation(self._random.choice((self.theirs, None)))

    def delete_a_segment_of_ours(self) -> None:
        ours = [segment_id for segment_id in self._segment_ids() if segment_id not in THEIRS]
        if ours:
            self.session.parameters.segmentation.GetSegmentation().RemoveSegment(self._random.choice(ours))

    def move_the_volume(self) -> None:
        put_under(self.volume, np.diag([1.0, -1.0, 1.0, 1.0]))

    def write_segments(self) -> None:
        self.session.segments.write(self._random.choice(("ask", "keep", "overwrite")))

    def cancel(self) -> None:
        self.session.cancel()

    def compute_features(self) -> None:
        self.session.start_extraction()

    def kill_the_compute_process(self) -> None:
        if self.session.compute_pid and self._random.random() < 0.3:
            # Where it was killed just before, the session need not have heard of that yet.
            with suppress(ProcessLookupError):
                os.kill(self.session.compute_pid, SIGKILL)

    def look_closer(self) -> None:
        if self._ids:
            self.session.close_ups.look_closer(self._random.choice(self._ids))

    def look_at_whole(self) -> None:
        if self._ids:
            self.session.close_ups.look_at_whole(self._random.choice(self._ids))

    def remove_a_point(self) -> None:
        node, index = self._any_point()
        if node:
            node.RemoveNthControlPoint(index)

    def unset_a_point(self) -> None:
        node, index = self._any_point()
        if node:
            node.UnsetNthControlPointPosition(index)

    def restore_a_point(self) -> None:
        node, index = self._any_point()
        if node:
            node.RestoreNthControlPointPosition(index)

    def drag_a_point(self) -> None:
        node, index = self._any_point()
        if node:
            node.SetNthControlPointPositionWorld(index, *self._points()[0])

    def change_a_class(self) -> None:
        if self._ids:
            name, values = self._random.choice([
                ("name", ("liver", "Überbein ⛄", "a;b|c~d^e", "x" * 300)),
                ("color", ((0.1, 0.2, 0.3), (1.0, 1.0, 1.0))),
                ("iso", (None, 0.1, 0.9)),
                ("visible", (True, False)),
            ])  # fmt: skip
            with suppress(InputError):  # Another class may have the name.
                self.session.annotations.set_class(self._random.choice(self._ids), **{name: self._random.choice(values)})

    def move_a_list(self) -> None:
        if self._ids:
            node = self.session.annotations.points_node(self._random.choice(self._ids), positive=True)
            put_under(node, np.diag([1.0, 1.0, -1.0, 1.0]))

    def delete_a_transform(self) -> None:
        transform = self._scene.GetFirstNodeByClass("vtkMRMLLinearTransformNode")
        if transform:
            self._scene.RemoveNode(transform)

    def delete_anything_else(self) -> None:
        """As the module Data lets its users do."""
        nodes = [
            node
            for node in nodes_of_class(self._scene, "vtkMRMLNode")
            if node not in (self.theirs, self.volume, self._another_volume)
            and not node.GetSingletonTag()
            and not any(map(node.IsA, NOT_THERE_TO_BE_DELETED))
        ]
        if nodes:
            self._scene.RemoveNode(self._random.choice(nodes))

    def paint_in_a_segment_of_ours(self) -> None:
        ours = [segment_id for segment_id in self._segment_ids() if segment_id not in THEIRS]
        if ours:
            node, image = self.session.parameters.segmentation, slicer.vtkOrientedImageData()
            segment_id = self._random.choice(ours)
            node.GetBinaryLabelmapRepresentation(segment_id, image)
            if not image.IsEmpty():
                vtk_to_numpy(image.GetPointData().GetScalars())[:50] = 1
                slicer.vtkSlicerSegmentationsModuleLogic.SetBinaryLabelmapToSegment(image, node, segment_id)

    def start_again(self) -> None:
        """As where the module is reloaded."""
        before = self.session.classes
        self.session.close()
        self.session = SceneSession(self._scene, self._app.app_logic, self._parameter_node)
        assert self.session.classes == before

    def _any_point(self) -> tuple[Any, int]:
        """A list and the index of a point in it; None where there is none."""
        nodes = [self.session.annotations.points_node(id_, positive) for id_ in self._ids for positive in (True, False)]
        nodes = [node for node in nodes if node.GetNumberOfControlPoints()]
        node = self._random.choice(nodes) if nodes else None
        return node, self._random.randrange(node.GetNumberOfControlPoints()) if node else 0


ACTIONS = tuple(name for name in vars(User) if not name.startswith("_"))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_whatever_is_done_in_whatever_order_the_session_comes_to_rest_and_leaves_others_alone(
    slicer_app: Any, spheres: Spheres, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    chance = random.Random(seed)
    user = User(slicer_app, spheres, chance)
    theirs = user.theirs
    composite = slicer_app.scene.AddNewNodeByClass("vtkMRMLSliceCompositeNode")
    composite.SetBackgroundVolumeID(user.volume.GetID())
    # VTK prints exceptions of observers and goes on.
    raised: list[Any] = []
    monkeypatch.setattr(sys, "excepthook", lambda *exception: raised.append(exception))
    before = [everything_about(theirs, name) for name in THEIRS]
    for _ in range(STEPS):
        action = chance.choice(ACTIONS)
        getattr(user, action)()
        for _ in range(chance.randrange(20)):
            user.session.poll()
        assert raised == [], action
        assert user.session.observer_count < OBSERVERS + OBSERVERS_OF_A_CLASS * len(user.session.classes)
    session = user.session
    session.wait()
    assert session.up_to_date or session.phase != "ready"
    assert [everything_about(theirs, name) for name in THEIRS] == before
    session.close()
    assert composite.GetNumberOfAdditionalLayers() == 0
    assert composite.GetBackgroundVolumeID() == user.volume.GetID()
