"""Scenes made by hand, or damaged: what a reference must not lead to counts as absent, and everything else goes on."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.scene.classes.class_nodes import CLASS_ROLE, NEGATIVE_ROLE, class_nodes
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.known_features import GRID
from ViTTransferFunction.Testing.support.scenes import annotate, segment_masks
from ViTTransferFunction.Testing.support.spheres import centre_ras


def reload(app: Any, session: SceneSession) -> None:
    """Have the session take the scene up as if it had just been loaded."""
    app.scene.StartState(app.scene.BatchProcessState)
    app.scene.EndState(app.scene.BatchProcessState)
    session.wait()


@pytest.mark.parametrize("class_name", ["vtkMRMLTextNode", "vtkMRMLSegmentationNode"])
def test_a_volume_of_another_kind_is_no_volume(slicer_app: Any, session: SceneSession, class_name: str) -> None:
    wrong = slicer_app.scene.AddNewNodeByClass(class_name, "wrong")
    volume = session.parameters.volume
    session.parameters.node.SetNodeReferenceID("volume", wrong.GetID())
    session.wait()
    assert session.parameters.volume is None
    assert session.phase == "no volume"
    assert session.take_error() is None
    session.set_volume(volume)
    session.wait()
    assert session.phase == "ready"


@pytest.mark.parametrize("class_name", ["vtkMRMLTextNode", "vtkMRMLScalarVolumeNode"])
def test_a_segmentation_of_another_kind_is_none_and_a_new_one_gets_the_segments(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray], class_name: str
) -> None:
    wrong = slicer_app.scene.AddNewNodeByClass(class_name, "wrong")
    session.parameters.node.SetNodeReferenceID("segmentation", wrong.GetID())
    (id_, *_) = annotate(session, spheres)
    assert session.segments.of(id_) is None
    session.segments.write()
    session.wait()
    assert session.take_error() is None
    assert list(segment_masks(session.parameters.segmentation, session.parameters.volume)) == [
        "sphere 1",
        "sphere 2",
        "sphere 3",
    ]


@pytest.mark.slow
@pytest.mark.parametrize(("cut", "role"), [("box", "renderingBox"), ("plane", "renderingPlane")])
def test_a_cut_of_another_kind_is_made_anew(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray], cut: str, role: str
) -> None:
    wrong = slicer_app.scene.AddNewNodeByClass("vtkMRMLMarkupsCurveNode", "wrong")
    session.parameters.node.SetNodeReferenceID(role, wrong.GetID())
    annotate(session, spheres)
    session.parameters.set("renderingCut", cut)
    session.wait()
    assert session.parameters.node.GetNodeReferenceID(role) not in (None, wrong.GetID())


@pytest.mark.parametrize("class_name", ["vtkMRMLTextNode", "vtkMRMLMarkupsFiducialNode"])
def test_a_class_that_is_another_node_is_none(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray], class_name: str
) -> None:
    wrong = slicer_app.scene.AddNewNodeByClass(class_name, "wrong")
    session.parameters.node.AddNodeReferenceID(CLASS_ROLE, wrong.GetID())
    session.parameters.node.AddNodeReferenceID(CLASS_ROLE, "vtkMRMLMarkupsFiducialNodeThatIsGone")
    reload(slicer_app, session)
    ids = annotate(session, spheres)
    assert [state.id for state in session.classes] == ids
    session.annotations.move_class(ids[0], 1)
    session.annotations.undo()
    session.annotations.remove_class(ids[0])
    session.wait()
    assert [state.id for state in session.classes] == ids[1:]
    assert slicer_app.scene.IsNodePresent(wrong)


def test_of_two_lists_of_one_class_the_first_counts(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    ids = annotate(session, spheres)
    first, second, _ = class_nodes(session.parameters.node)
    second.SetAttribute("ViTTransferFunction.class", ids[0])
    session.parameters.node.AddNodeReferenceID(CLASS_ROLE, first.GetID())
    reload(slicer_app, session)
    assert [state.name for state in session.classes] == ["sphere 1", "sphere 3"]
    assert session.chosen_iso(ids[0]) is not None


@pytest.mark.slow
@pytest.mark.parametrize("class_name", ["vtkMRMLMarkupsCurveNode", "itself", "positive points of another class"])
def test_negative_points_in_another_node_are_none_and_a_list_is_made_for_those_to_come(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray], class_name: str
) -> None:
    ids = annotate(session, spheres)
    positive, other, _ = class_nodes(session.parameters.node)
    known = {"itself": positive, "positive points of another class": other}
    wrong = known.get(class_name) or slicer_app.scene.AddNewNodeByClass(class_name, "wrong")
    positive.SetNodeReferenceID(NEGATIVE_ROLE, wrong.GetID())
    reload(slicer_app, session)
    assert session.classes[0].negative == ()
    session.annotations.add_points(ids[0], centre_ras(spheres, 3), positive=False)
    session.wait()
    assert [len(state.positive) for state in session.classes] == [1, 1, 1]
    assert len(session.classes[0].negative) == 1
    assert slicer_app.scene.IsNodePresent(wrong)


def test_lists_without_what_displays_them_get_it_again(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    ids = annotate(session, spheres)
    positive = class_nodes(session.parameters.node)[0]
    slicer_app.scene.RemoveNode(positive.GetDisplayNode())
    reload(slicer_app, session)
    assert len(session.classes) == 3
    session.annotations.set_class(ids[0], color=(0.2, 0.4, 0.6), visible=False)
    session.wait()
    assert session.classes[0].color == pytest.approx((0.2, 0.4, 0.6))
    assert not positive.GetDisplayNode().GetVisibility()


def test_a_volume_without_what_displays_it_can_be_segmented(
    slicer_app: Any, session: SceneSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    slicer_app.scene.RemoveNode(session.parameters.volume.GetDisplayNode())
    reload(slicer_app, session)
    annotate(session, spheres)
    session.segments.write()
    session.wait()
    assert session.take_error() is None
    assert session.parameters.get("grid") == GRID
