"""Points that were placed on another scan than their volume shows are told of; of what is done on purpose, nothing is said."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files.annotation_files import read_annotations, write_annotations
from ViTTransferFunction.Logic.files.segmentation_files import write_image
from ViTTransferFunction.Logic.scene.classes.class_attributes import attribute, set_attribute
from ViTTransferFunction.Logic.scene.mrml.nodes import nodes_of_class
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image
from ViTTransferFunction.Testing.support.scenes import FollowUp, add_parameter_node, annotate, open_spheres
from ViTTransferFunction.Testing.support.sequences import Sequence
from ViTTransferFunction.Testing.support.spheres import Spheres

TOLD = "Points in 'ct' were placed on a scan that looks different"


@pytest.fixture
def other(spheres: Spheres) -> Volume:
    """Another patient's scan, on the grid of the spheres."""
    return replace(spheres[0], array=spheres[0].array[::-1].copy(), name="other")


class SavedScene:
    """A scene beside its scan's file, with three structures of a point each; opened anew each time.

    Attributes:
        scan: the scan's file.
        session: of the scene that is open.
    """

    def __init__(self, app: Any, spheres: Spheres, folder: Path) -> None:
        self.scan, self._scene = folder / "ct.nrrd", str(folder / "scene.mrml")
        self._app = app
        self.session = open_spheres(app, spheres)
        volume = self.session.parameters.volume
        volume.SetName("ct")
        write_image(self.scan, spheres[0].array, spheres[0].geometry)
        volume.AddDefaultStorageNode()
        volume.GetStorageNode().SetFileName(str(self.scan))
        annotate(self.session, spheres)
        self.save()

    def save(self) -> None:
        """Save the scene, which leaves the scan's file as it is."""
        for number, node in enumerate(nodes_of_class(self._app.scene, "vtkMRMLMarkupsNode")):
            node.AddDefaultStorageNode()
            node.GetStorageNode().SetFileName(str(self.scan.with_name(f"{number}.mrk.json")))
            assert node.GetStorageNode().WriteData(node)
        self._app.scene.SetURL(self._scene)
        assert self._app.scene.Commit(self._scene)

    def open(self) -> tuple[str, ...]:
        """Open it anew; returns what is told."""
        self.session.close()
        self._app.scene.Clear(False)
        self._app.scene.SetURL(self._scene)
        assert self._app.scene.Import()
        parameters = self._app.scene.GetSingletonNode("ViTTransferFunction", "vtkMRMLScriptedModuleNode")
        self.session = SceneSession(self._app.scene, self._app.app_logic, parameters)
        return self.told()

    def replace_by(self, volume: Volume) -> None:
        """Put another scan in the place of the scan's file."""
        write_image(self.scan, volume.array, volume.geometry)

    def told(self) -> tuple[str, ...]:
        self.session.wait()
        return tuple(error for error in self.session.errors if error.startswith(TOLD))


@pytest.fixture
def saved(slicer_app: Any, spheres: Spheres, tmp_path: Path) -> Iterator[SavedScene]:
    saved = SavedScene(slicer_app, spheres, tmp_path)
    yield saved
    saved.session.close()


def test_a_scan_that_was_replaced_by_another_patients_is_told_of_until_its_points_are_changed(
    saved: SavedScene, other: Volume
) -> None:
    assert saved.told() == ()
    assert saved.open() == ()
    saved.replace_by(other)
    (told,) = saved.open()
    annotations, (first, *others) = saved.session.annotations, saved.session.classes
    annotations.set_class(first.id, name="liver")
    assert saved.told() == (told,)
    for state in others:
        annotations.remove_points(state.id)
        assert saved.told() == (told,)
    annotations.add_points(first.id, np.array(first.positive) + 2.0, positive=True)
    assert saved.told() == ()


def test_whoever_saves_without_going_on_is_told_again_and_whoever_placed_a_point_is_not(
    saved: SavedScene, other: Volume
) -> None:
    saved.replace_by(other)
    assert saved.open()
    saved.save()
    assert saved.open()
    annotations, state = saved.session.annotations, saved.session.classes[0]
    annotations.add_points(state.id, np.array(state.positive) + 2.0, positive=True)
    assert saved.told()
    saved.save()
    assert saved.open() == ()


def test_the_same_scan_saved_with_other_numbers_is_not_told_of(saved: SavedScene, spheres: Spheres) -> None:
    volume, _ = spheres
    saved.replace_by(replace(volume, array=np.rint(10.0 * volume.array + 1000.0).astype(np.int16)))
    assert saved.open() == ()


@pytest.mark.parametrize("note", [None, "garbled"])
def test_a_scene_that_does_not_say_what_its_points_were_placed_on_is_not_told_of(
    saved: SavedScene, other: Volume, note: str | None
) -> None:
    set_attribute(saved.session.parameters.volume, "thumbnail", note)
    saved.save()
    saved.replace_by(other)
    assert saved.open() == ()


def test_a_scan_without_points_is_not_told_of(saved: SavedScene, other: Volume) -> None:
    for state in saved.session.classes:
        saved.session.annotations.remove_points(state.id)
    assert saved.told() == ()
    assert attribute(saved.session.parameters.volume, "thumbnail") is None
    saved.save()
    saved.replace_by(other)
    assert saved.open() == ()


def test_voxels_that_are_changed_while_the_scene_is_open_are_meant(saved: SavedScene, other: Volume) -> None:
    volume = saved.session.parameters.volume
    set_image(volume, other.array, other.geometry.ijk_to_ras)
    assert saved.told() == ()
    saved.save()
    saved.replace_by(other)
    assert saved.open() == ()


def test_the_note_does_not_have_the_scan_saved_again(saved: SavedScene) -> None:
    saved.open()
    volume, state = saved.session.parameters.volume, saved.session.classes[0]
    set_attribute(volume, "thumbnail", None)
    saved.session.annotations.add_points(state.id, np.array(state.positive) + 2.0, positive=True)
    saved.told()
    assert attribute(volume, "thumbnail") is not None
    assert not volume.GetModifiedSinceRead()


def test_each_scan_of_a_scene_has_points_of_its_own(
    saved: SavedScene, slicer_app: Any, spheres: Spheres, other: Volume
) -> None:
    saved.replace_by(other)
    (told,) = saved.open()
    session = saved.session
    replaced, follow_up = session.parameters.volume, FollowUp(slicer_app.scene, spheres)
    session.set_volume(follow_up.volume)
    assert saved.told() == ()
    follow_up.click(session)
    assert saved.told() == ()
    session.set_volume(replaced)
    assert saved.told() == (told,)
    session.set_volume(follow_up.volume)
    session.other_scans.take_over(next(iter(session.other_scans.names)))
    assert saved.told() == ()


def test_frames_of_a_sequence_share_points_and_nothing_is_noted(slicer_app: Any, spheres: Spheres, other: Volume) -> None:
    sequence = Sequence(slicer_app.scene, [spheres[0], other])
    session = SceneSession(slicer_app.scene, slicer_app.app_logic, add_parameter_node(slicer_app.scene))
    session.set_volume(sequence.volume)
    session.wait()
    annotate(session, spheres)
    sequence.show(2)
    session.wait()
    session.set_volume(None)
    session.set_volume(sequence.volume)
    session.wait()
    assert session.errors == ()
    assert attribute(sequence.volume, "thumbnail") is None
    assert session.file_classes.annotated()[0].placed_on is None
    session.close()


def test_points_of_a_file_that_were_placed_on_another_scan_are_told_of(
    saved: SavedScene, other: Volume, spheres: Spheres, tmp_path: Path
) -> None:
    session = saved.session
    write_annotations(session.file_classes.annotated(), tmp_path / "a.json")

    def load(volume: Volume) -> tuple[str, ...]:
        for state in session.classes:
            session.annotations.remove_class(state.id)
        set_image(session.parameters.volume, volume.array, volume.geometry.ijk_to_ras)
        assert saved.told() == ()
        session.file_classes.add(read_annotations(tmp_path / "a.json", session.file_classes.geometry))
        return saved.told()

    assert load(spheres[0]) == ()
    (told,) = load(other)
    # What is written meanwhile still says where they come from.
    placed_on = session.file_classes.annotated()[0].placed_on
    assert placed_on is not None
    assert placed_on.may_be_of(spheres[0].array, spheres[0].geometry)
    saved.save()
    saved.replace_by(other)
    assert saved.open() == (told,)


def test_each_file_whose_points_were_placed_on_another_scan_is_told_of(
    saved: SavedScene, other: Volume, tmp_path: Path
) -> None:
    session = saved.session
    annotated = session.file_classes.annotated()
    for number, each in enumerate(annotated):
        write_annotations([each], tmp_path / f"{number}.json")
    for state in session.classes:
        session.annotations.remove_class(state.id)
    set_image(session.parameters.volume, other.array, other.geometry.ijk_to_ras)
    assert saved.told() == ()
    for number in range(len(annotated)):
        session.file_classes.add(read_annotations(tmp_path / f"{number}.json", session.file_classes.geometry))
        assert saved.told() == tuple(iter(session.take_error, None)) != ()


def test_points_of_each_file_are_told_of_until_they_are_gone_and_those_that_were_there_before_are_not_meant(
    saved: SavedScene, other: Volume, tmp_path: Path
) -> None:
    session = saved.session
    of_files, mine = session.file_classes.annotated()[:2], session.classes[2]
    for state in session.classes[:2]:
        session.annotations.remove_class(state.id)
    set_image(session.parameters.volume, other.array, other.geometry.ijk_to_ras)
    assert saved.told() == ()
    for each in of_files:
        session.file_classes.add([each])
    assert saved.told()
    for state in session.classes[::-1]:
        if state.id != mine.id:
            assert saved.told()
            session.annotations.remove_class(state.id)
    assert saved.told() == ()
