"""Structures with their points from another scan of the scene."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("slicer")

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.scenes import FollowUp, add_volume, annotate, put_under
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras


def test_structures_without_points_get_those_of_another_scan_in_one_step(
    slicer_app: Any, session: SceneSession, spheres: Spheres
) -> None:
    ids, baseline = annotate(session, spheres), session.parameters.volume
    session.annotations.add_points(ids[0], centre_ras(spheres, 2), positive=False)
    session.annotations.step_size(ids[0], 1)
    session.annotations.set_close_up(ids[1], (1.0, 2.0, 3.0, 40.5, 50.0, 60.0))
    session.annotations.add_class("empty")
    assert session.other_scans.names == {}
    theirs = session.classes
    copy = add_volume(slicer_app.scene, Volume(spheres[0].array, spheres[0].geometry, "copy"))
    session.set_volume(copy)
    brought = session.classes
    session.annotations.remove_class(brought[2].id)
    before = session.classes
    ((key, name),) = session.other_scans.names.items()
    assert name == baseline.GetName()
    session.other_scans.take_over(key)
    mine = {state.name: state for state in session.classes}
    assert list(mine) == ["sphere 1", "sphere 2", "empty", "sphere 3"]
    assert [mine[name].id for name in ("sphere 1", "sphere 2")] == [state.id for state in brought[:2]]
    for state in theirs[:3]:
        got = mine[state.name]
        assert (got.positive, got.negative, got.size) == (state.positive, state.negative, state.size)
        assert got.close_up is None
        assert got.id != state.id
    assert session.selected_class == mine["sphere 1"]
    session.wait()
    assert session.chosen_iso(mine["sphere 3"].id) is not None
    with pytest.raises(InputError, match="all there already"):
        session.other_scans.take_over(key)
    session.annotations.undo()
    assert session.classes == before
    session.set_volume(baseline)
    assert session.classes == theirs
    # On the copy, there are structures without points.
    assert session.other_scans.names == {}


def test_a_structure_that_has_points_keeps_them_and_the_other_one_gets_a_number(
    session: SceneSession, follow_up: FollowUp, spheres: Spheres
) -> None:
    annotate(session, spheres)
    session.set_volume(follow_up.volume)
    follow_up.click(session)
    first = session.classes[0]
    session.annotations.remove_points(first.id)
    session.annotations.add_points(first.id, np.array(first.positive), positive=False)
    mine = session.classes
    session.other_scans.take_over(*session.other_scans.names)
    assert session.classes[:3] == mine
    assert [state.name for state in session.classes[3:]] == ["sphere 1 (2)", "sphere 2 (2)", "sphere 3 (2)"]
    assert len({state.color for state in session.classes}) == 6


def test_points_of_a_scan_that_was_removed_can_be_had_when_it_is_loaded_again(
    slicer_app: Any, session: SceneSession, spheres: Spheres
) -> None:
    first, second, _ = annotate(session, spheres)
    session.annotations.add_points(first, np.array([[1000.0, 0.0, 0.0]]), positive=False)  # In neither.
    session.annotations.set_class(second, visible=False)
    session.annotations.add_points(session.annotations.add_class("none of these").id, centre_ras(spheres, 3), positive=False)
    session.annotations.continue_segment("segment of the scan", "tumour", (1.0, 0.0, 0.0), centre_ras(spheres, 1))
    classes = session.classes
    slicer_app.scene.RemoveNode(session.parameters.volume)
    assert session.other_scans.names == {}
    session.set_volume(add_volume(slicer_app.scene, spheres[0]))
    assert list(session.other_scans.names.values()) == [f"{spheres[0].name} (removed)"]
    session.other_scans.take_over(*session.other_scans.names)
    assert [(state.positive, state.negative) for state in session.classes] == [
        (state.positive, state.negative) for state in classes
    ]
    assert all(state.visible and not state.continues for state in session.classes)


def test_points_of_a_scan_whose_file_was_not_found_can_be_had_as_the_user_is_told(
    slicer_app: Any, session: SceneSession, spheres: Spheres
) -> None:
    annotate(session, spheres)
    classes = session.classes
    session.parameters.volume.SetAndObserveImageData(None)
    session.wait()
    assert "'Add points of another scan'" in (session.take_error() or "")
    session.set_volume(add_volume(slicer_app.scene, spheres[0]))
    session.other_scans.take_over(*session.other_scans.names)
    assert [(state.positive, state.negative) for state in session.classes] == [
        (state.positive, state.negative) for state in classes
    ]


def test_scans_of_one_name_are_two(slicer_app: Any, session: SceneSession, spheres: Spheres) -> None:
    scans = [session.parameters.volume, add_volume(slicer_app.scene, spheres[0]), add_volume(slicer_app.scene, spheres[0])]
    for label, scan in enumerate(scans[:2], start=1):
        scan.SetName("CT")
        session.set_volume(scan)
        session.annotations.add_points(
            session.annotations.add_class(f"sphere {label}").id, centre_ras(spheres, label), positive=True
        )
    session.set_volume(scans[2])
    assert list(session.other_scans.names.values()) == ["CT", "CT"]
    session.other_scans.take_over(list(session.other_scans.names)[1])
    assert [state.positive for state in session.classes if state.positive] == [
        tuple(map(tuple, centre_ras(spheres, 2).tolist()))
    ]


def test_of_structures_of_one_name_none_takes_the_place_of_another(
    slicer_app: Any, session: SceneSession, spheres: Spheres
) -> None:
    """A scan was removed and loaded again, and what was clicked first each time has the name that it gets by itself."""
    for label in (1, 2, 1):
        session.annotations.set_classes(())
        session.annotations.add_points(session.annotations.add_class().id, centre_ras(spheres, label), positive=True)
        slicer_app.scene.RemoveNode(session.parameters.volume)
        session.set_volume(add_volume(slicer_app.scene, spheres[0]))
    assert [(state.name, state.positive) for state in session.classes] == [("Structure 1", ())]
    session.other_scans.take_over(*session.other_scans.names)
    places = [tuple(map(tuple, centre_ras(spheres, label).tolist())) for label in (1, 2)]
    assert [(state.name, state.positive) for state in session.classes] == [
        ("Structure 1", places[0]),
        ("Structure 1 (2)", places[1]),
    ]


def test_points_of_a_scan_that_lies_elsewhere_are_refused(session: SceneSession, follow_up: FollowUp, spheres: Spheres) -> None:
    annotate(session, spheres)
    put_under(
        follow_up.volume, np.array([[1.0, 0.0, 0.0, 5000.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    )
    session.set_volume(follow_up.volume)
    before = session.classes
    with pytest.raises(InputError, match="None of the points of 'spheres' lies in this scan"):
        session.other_scans.take_over(*session.other_scans.names)
    assert session.classes == before
