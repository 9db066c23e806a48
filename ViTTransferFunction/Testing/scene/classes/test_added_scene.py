"""A saved scene with classes that is added to one in which somebody is working."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.scene.classes.class_nodes import class_nodes_of_all
from ViTTransferFunction.Logic.scene.classes.of_volume import VOLUME_ROLE, volume_of
from ViTTransferFunction.Logic.scene.interface.parameters import SceneParameters
from ViTTransferFunction.Testing.support.known_features import GRID
from ViTTransferFunction.Testing.support.scenes import add_volume, annotate, open_spheres, write_all
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras


@pytest.fixture
def saved(slicer_app: Any, spheres: Spheres, tmp_path: Path) -> Path:
    """A scene with a volume, one class and its segment, and a setting of its own; the application's is empty again."""
    session = open_spheres(slicer_app, spheres)
    theirs = session.annotations.add_class("theirs")
    session.annotations.add_points(theirs.id, centre_ras(spheres, 3), positive=True)
    session.wait()
    session.segments.write()
    session.wait()
    session.parameters.set("overlayOpacity", 0.9)
    path = tmp_path / "theirs.mrb"
    assert slicer_app.scene.WriteToMRB(str(path))
    session.close()
    slicer_app.scene.Clear(False)
    return path


@pytest.mark.slow
def test_what_is_worked_on_stays_and_what_was_added_is_there_with_its_own_scan(
    slicer_app: Any, spheres: Spheres, saved: Path
) -> None:
    session = open_spheres(slicer_app, spheres)
    annotate(session, spheres)
    session.segments.write()
    session.wait()
    mine, volume, segmentation = session.classes, session.parameters.volume, session.parameters.segmentation
    settings = {name: session.parameters.get(name) for name in SceneParameters.DEFAULTS}
    assert slicer_app.scene.ReadFromMRB(str(saved))
    session.wait()
    assert session.take_error() is None
    assert session.phase == "ready"
    assert (session.parameters.volume, session.parameters.segmentation) == (volume, segmentation)
    assert {name: session.parameters.get(name) for name in SceneParameters.DEFAULTS} == settings
    assert session.classes == mine
    (added,) = (node for node in class_nodes_of_all(session.parameters.node) if node.GetName() == "theirs")
    assert not added.GetDisplayNode().GetVisibility()
    session.annotations.undo()
    session.annotations.redo()
    assert session.classes == mine
    session.set_volume(volume_of(added))
    assert [(state.name, len(state.positive)) for state in session.classes] == [("theirs", 1)]
    assert added.GetDisplayNode().GetVisibility()
    assert session.segments.of(session.classes[0].id) is not None
    assert not session.annotations.can_undo
    session.set_volume(volume)
    assert session.classes == mine
    session.close()


@pytest.mark.slow
def test_an_earlier_state_of_the_same_work_is_added_with_a_scan_of_its_own(
    slicer_app: Any, spheres: Spheres, tmp_path: Path
) -> None:
    session = open_spheres(slicer_app, spheres)
    annotate(session, spheres)
    write_all(session)
    earlier, volume, segments = session.classes, session.parameters.volume, session.parameters.segmentation
    assert slicer_app.scene.WriteToMRB(str(tmp_path / "earlier.mrb"))
    session.annotations.add_points(session.classes[0].id, centre_ras(spheres, 2), positive=False)
    mine = session.classes
    for times in (1, 2):
        assert slicer_app.scene.ReadFromMRB(str(tmp_path / "earlier.mrb"))
        session.wait()
        assert session.classes == mine
        scans = list(dict.fromkeys(map(volume_of, class_nodes_of_all(session.parameters.node))))
        assert len(scans) == 1 + times
        session.set_volume(scans[-1])
        session.wait()
        assert session.classes == earlier
        assert session.parameters.segmentation is not segments
        assert all(session.segments.of(state.id) is not None for state in earlier)
        session.annotations.remove_class(session.classes[1].id)
        session.set_volume(volume)
        session.wait()
        assert session.classes == mine
    session.close()


@pytest.mark.slow
def test_structures_of_an_earlier_version_that_are_added_belong_to_the_scan_that_was_chosen_there(
    slicer_app: Any, spheres: Spheres, tmp_path: Path
) -> None:
    session = open_spheres(slicer_app, spheres)
    annotate(session, spheres)
    for positive in class_nodes_of_all(session.parameters.node):
        positive.RemoveNodeReferenceIDs(VOLUME_ROLE)
        positive.SetAttribute("ViTTransferFunction.volumeName", None)
    assert slicer_app.scene.WriteToMRB(str(tmp_path / "old.mrb"))
    session.close()
    slicer_app.scene.Clear(False)
    session = open_spheres(slicer_app, spheres)
    mine = session.annotations.add_class("mine")
    assert slicer_app.scene.ReadFromMRB(str(tmp_path / "old.mrb"))
    assert session.classes == (mine,)
    session.set_volume(volume_of(class_nodes_of_all(session.parameters.node)[-1]))
    assert [state.name for state in session.classes] == ["sphere 1", "sphere 2", "sphere 3"]
    session.close()


@pytest.mark.slow
def test_where_there_are_no_classes_an_added_scene_is_taken_up_as_it_was_saved(
    slicer_app: Any, spheres: Spheres, saved: Path
) -> None:
    session = open_spheres(slicer_app, spheres)
    empty = add_volume(slicer_app.scene, Volume(spheres[0].array, spheres[0].geometry, "another"))
    session.set_volume(empty)
    session.parameters.set("grid", GRID)
    assert slicer_app.scene.ReadFromMRB(str(saved))
    session.wait()
    assert [state.name for state in session.classes] == ["theirs"]
    assert session.parameters.volume not in (None, empty)
    assert session.segments.of(session.classes[0].id) is not None
    assert session.parameters.get("overlayOpacity") == 0.9
    assert not session.annotations.can_undo
    session.close()
