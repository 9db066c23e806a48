"""Classes of a scene in an annotation file, and out of it: what was clicked is computed elsewhere as it was here."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.CommandLine.vittf import main
from ViTTransferFunction.Logic.core.classes.annotated_class import AnnotatedClass
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.classes.close_up import CloseUp
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.files.annotation_files import read_annotations, write_annotations
from ViTTransferFunction.Logic.files.segmentation_files import read_segmentation, write_image
from ViTTransferFunction.Logic.scene.classes.annotated_classes import new_among
from ViTTransferFunction.Logic.scene.classes.class_state import new_class_state
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_close_up
from ViTTransferFunction.Testing.support.scenes import MOVED, annotate, put_under, segment_masks
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras

RED = (1.0, 0.0, 0.0)


def a_session_with_all_that_is_decided(session: SceneSession, spheres: Spheres) -> None:
    """Three classes in a volume that lies elsewhere than its file says, the first of them looked at closer."""
    put_under(session.parameters.volume, MOVED)
    for label in (1, 2, 3):
        id_ = session.annotations.add_class(f"sphere {label}").id
        session.annotations.add_points(id_, moved(centre_ras(spheres, label)), positive=True)
    first, second, third = (state.id for state in session.classes)
    session.annotations.add_points(first, moved(centre_ras(spheres, 3)), positive=False)
    session.annotations.set_class(second, size=0.5, proximity=0.25, opacity=0.5)
    session.annotations.set_class(third, iso=0.625, refine=False, color=RED)
    session.wait()
    session.close_ups.look_closer(first)
    request = session.file_classes.annotated()[0].request
    assert request.close_up is not None
    cache_known_close_up(*spheres, request.close_up, request.positive)
    session.wait()
    assert session.take_error() is None


def box_in(annotated: AnnotatedClass, spheres: Spheres) -> Any:
    """The voxels that a class is looked at in; None for all."""
    close_up = annotated.request.close_up
    return None if close_up is None else close_up.box_in(spheres[0].geometry, annotated.request.positive)


def moved(points_ras: np.ndarray) -> np.ndarray:
    return points_ras @ MOVED[:3, :3].T + MOVED[:3, 3]


def test_a_batch_gives_the_segmentation_of_the_session_that_its_points_were_written_from(
    session: SceneSession, spheres: Spheres, tmp_path: Path
) -> None:
    a_session_with_all_that_is_decided(session, spheres)
    session.segments.write()
    session.wait()
    scan, points, output = tmp_path / "scan.nrrd", tmp_path / "scan.annotations.json", tmp_path / "out.seg.nrrd"
    write_image(scan, spheres[0].array, spheres[0].geometry)
    write_annotations(session.file_classes.annotated(), points)
    assert main(["segment", str(scan), "--annotations", str(points), "--grid", str(GRID), "-o", str(output)]) == 0
    labels, _, segments = read_segmentation(output)
    masks = segment_masks(session.parameters.segmentation, session.parameters.volume)
    assert [segment.name for segment in segments] == list(masks)
    for label, (name, mask) in enumerate(masks.items(), start=1):
        assert mask.any()
        np.testing.assert_array_equal(labels == label, mask, name)


def test_what_was_written_and_is_added_again_asks_the_same_and_is_one_step_for_undo(
    session: SceneSession, spheres: Spheres, tmp_path: Path
) -> None:
    a_session_with_all_that_is_decided(session, spheres)
    written = session.file_classes.annotated()
    write_annotations(written, tmp_path / "a.json")
    for state in session.classes:
        session.annotations.remove_class(state.id)
    session.file_classes.add(read_annotations(tmp_path / "a.json", session.file_classes.geometry))
    assert session.selected_class == session.classes[0]
    for before, after in zip(written, session.file_classes.annotated(), strict=True):
        assert (after.color, after.opacity) == (before.color, before.opacity)
        assert box_in(after, spheres) == box_in(before, spheres)
        for polarity in ("positive", "negative"):
            np.testing.assert_allclose(getattr(after.request, polarity), getattr(before.request, polarity), atol=1e-9)
        places: dict[str, Any] = {name: getattr(before.request, name) for name in ("positive", "negative", "close_up")}
        assert replace(after.request, **places) == before.request
    session.annotations.undo()
    assert not session.classes
    session.annotations.redo()
    assert [state.name for state in session.classes] == ["sphere 1", "sphere 2", "sphere 3"]


def test_points_that_do_not_count_are_not_written_and_a_box_is_written_as_points_have_enlarged_it(
    session: SceneSession, spheres: Spheres
) -> None:
    id_ = session.annotations.add_class("sphere").id
    session.annotations.add_class("without points")
    session.annotations.add_points(id_, np.concatenate([centre_ras(spheres, 1), [[1000.0, 0.0, 0.0]]]), positive=True)
    session.annotations.set_close_up(id_, (*centre_ras(spheres, 3)[0].tolist(), 10.0, 10.0, 10.0))
    (written,) = session.file_classes.annotated()
    np.testing.assert_array_equal(written.request.positive, centre_ras(spheres, 1))
    assert written.request.close_up is not None
    offset = np.abs(centre_ras(spheres, 1)[0] - written.request.close_up.centre_ras)
    assert (offset < np.array(written.request.close_up.size_mm) / 2.0).all()


def test_what_no_file_can_say_is_refused(session: SceneSession, spheres: Spheres) -> None:
    with pytest.raises(InputError, match="There are no classes"):
        session.file_classes.annotated()
    first, *_ = annotate(session, spheres)
    session.annotations.points_node(first, positive=True).SetName("sphere 2")  # In the Data module.
    with pytest.raises(InputError, match="2 classes are named 'sphere 2'; give each class a name of its own"):
        session.file_classes.annotated()
    session.set_volume(None)
    with pytest.raises(InputError, match="no scan that the points could belong to; open it first"):
        session.file_classes.annotated()


def test_what_is_there_already_is_not_added_again_and_a_name_that_is_taken_gets_a_number(
    session: SceneSession, spheres: Spheres
) -> None:
    put_under(session.parameters.volume, MOVED)
    red = AnnotatedClass(ClassRequest("liver", centre_ras(spheres, 1), size=0.5), RED)
    more = replace(red, request=replace(red.request, negative=centre_ras(spheres, 2)))
    spleen = AnnotatedClass(ClassRequest("spleen", centre_ras(spheres, 3)), RED)
    session.file_classes.add([red])
    before = session.classes
    with pytest.raises(InputError, match="are all there already, with the same points and settings"):
        session.file_classes.add([red])
    assert session.classes == before
    session.file_classes.add([red, spleen])
    assert session.selected_class == session.classes[1]
    session.file_classes.add([more])
    with pytest.raises(InputError, match="are all there already"):
        session.file_classes.add([more])
    session.file_classes.add([replace(red, request=replace(red.request, size=1.0))])
    assert [state.name for state in session.classes] == ["liver", "spleen", "liver (2)", "liver (3)"]
    assert session.classes[0].color == RED
    assert len({state.color for state in session.classes}) == 4
    assert len(session.file_classes.annotated()) == 4
    assert session.take_error() is None


def test_a_structure_whose_colour_is_taken_gets_none_of_those_that_come_with_it() -> None:
    present = new_class_state([], "nodule")
    liver = replace(new_class_state([], "liver"), positive=((1.0, 2.0, 3.0),))
    spleen = replace(new_class_state([liver], "spleen"), positive=((4.0, 5.0, 6.0),))
    added = new_among([liver, spleen], [present])
    assert len({state.color for state in (present, *added)}) == 3
    assert [state.color for state in added][1] == spleen.color


def test_a_structure_whose_name_is_taken_gets_none_of_those_that_come_with_it() -> None:
    present = new_class_state([], "metastasis")
    first, second = (
        replace(new_class_state([], name), positive=((1.0, 2.0, number),))
        for number, name in enumerate(("metastasis", "metastasis (2)"))
    )
    for together in ([first, second], [second, first]):
        names = {state.positive: state.name for state in new_among(together, [present])}
        assert names == {first.positive: "metastasis (3)", second.positive: "metastasis (2)"}


def test_points_of_another_scan_are_refused_and_nothing_is_added(session: SceneSession, spheres: Spheres) -> None:
    good = AnnotatedClass(ClassRequest("good", centre_ras(spheres, 1)), RED)
    beyond = AnnotatedClass(ClassRequest("beyond", np.array([[1000.0, 0.0, 0.0]])), RED)
    with pytest.raises(InputError, match="1 of 1 points of class 'beyond' lie outside the volume"):
        session.file_classes.add([good, beyond])
    with pytest.raises(InputError, match="There are no classes"):
        session.file_classes.add([])
    assert session.classes == ()
    session.set_volume(None)
    with pytest.raises(InputError, match="no scan that the points could belong to"):
        session.file_classes.add([good])


def test_a_box_that_the_file_leaves_to_be_chosen_is_the_users_to_choose(session: SceneSession, spheres: Spheres) -> None:
    request = ClassRequest("gland", centre_ras(spheres, 1))
    given = CloseUp((0.0, 40.0, 50.0), (30.0, 30.0, 30.0))
    session.file_classes.add([
        AnnotatedClass(request, RED, close_up_from_map=True),
        AnnotatedClass(ClassRequest("boxed", centre_ras(spheres, 2), close_up=given), RED),
    ])  # fmt: skip
    assert [state.close_up for state in session.classes] == [None, (*given.centre_ras, *given.size_mm)]
    assert "The file asks to look closer at gland. Select each, and press Look closer" in (session.take_error() or "")
