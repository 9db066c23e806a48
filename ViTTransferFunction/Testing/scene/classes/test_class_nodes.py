"""Classes as point lists in a scene."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import slicer
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ViTTransferFunction.Logic.rendering.appearance import Appearance
from ViTTransferFunction.Logic.scene.classes.class_nodes import (
    class_id,
    class_nodes,
    create_class,
    give_to_volume,
    negative_node,
    order_classes,
    read_class,
    remove_class,
    write_class,
)
from ViTTransferFunction.Logic.scene.classes.class_state import ClassState
from ViTTransferFunction.Logic.scene.mrml.data_tree import FOLDER_NAME
from ViTTransferFunction.Testing.support.scenes import add_parameter_node, put_under
from ViTTransferFunction.Testing.support.standin.subject_hierarchy import keep_subject_hierarchy

LIVER = ClassState(
    "a1",
    "Leber, groß",
    Appearance((0.25, 0.5, 0.75), opacity=0.5, style="glass", low=-40.0, ramp=0.25, edges=0.125),
    iso=0.125,
    proximity=0.25,
    refine=False,
    visible=False,
    positive=((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)),
    negative=((7.0, 8.0, 9.0),),
)


@pytest.fixture
def scene(slicer_app: Any) -> Any:
    return slicer_app.scene


@pytest.fixture
def parameter_node(scene: Any) -> Any:
    return add_parameter_node(scene)


def display_of_negative(node: Any) -> Any:
    negative = negative_node(node)
    assert negative is not None
    return negative.GetDisplayNode()


@pytest.mark.parametrize("earlier", [False, True])
def test_names_are_in_no_labels_of_points_which_the_c_library_would_take_for_formats(
    scene: Any, parameter_node: Any, earlier: bool
) -> None:
    """Of "70% stenosis", it would read text at the address that is the point's number, and the application would end."""
    positive = create_class(scene, parameter_node, LIVER)
    negative = negative_node(positive)
    assert negative is not None
    for node in (positive, negative):
        if earlier:
            node.SetControlPointLabelFormat("%N-%d")
    write_class(scene, positive, replace(LIVER, name="50% done"))
    for node in (positive, negative):
        n = node.AddControlPoint(1.0, 2.0, 3.0)
        assert node.GetNthControlPointLabel(n).isdigit()


def test_what_was_written_is_read(scene: Any, parameter_node: Any) -> None:
    assert read_class(create_class(scene, parameter_node, LIVER)) == LIVER
    plain = ClassState("b2", "spleen", Appearance((0.0, 0.0, 0.0)))
    assert read_class(create_class(scene, parameter_node, plain)) == plain


def test_every_field_can_be_changed(scene: Any, parameter_node: Any) -> None:
    node = create_class(scene, parameter_node, ClassState("a1", "spleen", Appearance((0.0, 0.0, 0.0))))
    write_class(scene, node, LIVER)
    assert read_class(node) == LIVER
    write_class(scene, node, ClassState("a1", "spleen", Appearance((0.0, 0.0, 0.0))))
    assert read_class(node) == ClassState("a1", "spleen", Appearance((0.0, 0.0, 0.0)))


def test_writing_what_is_there_already_touches_nothing(scene: Any, parameter_node: Any) -> None:
    node = create_class(scene, parameter_node, LIVER)
    nodes = [node, node.GetDisplayNode(), negative_node(node), display_of_negative(node)]
    before = [n.GetMTime() for n in nodes]
    write_class(scene, node, LIVER)
    assert [n.GetMTime() for n in nodes] == before


def test_points_inside_are_dots_and_those_outside_crosses_in_a_list_that_says_so(scene: Any, parameter_node: Any) -> None:
    node = create_class(scene, parameter_node, LIVER)
    display, outside = node.GetDisplayNode(), display_of_negative(node)
    assert (display.GetGlyphType(), outside.GetGlyphType()) == (display.Sphere3D, display.ThickCross2D)
    negative = negative_node(node)
    assert negative is not None
    assert (node.GetName(), negative.GetName()) == ("Leber, groß", "Leber, groß – outside")


def test_points_under_a_transform_are_given_in_the_scenes_coordinates(scene: Any, parameter_node: Any) -> None:
    node = create_class(scene, parameter_node, LIVER)
    shift = np.eye(4)
    shift[0, 3] = 100.0
    put_under(node, shift)
    assert read_class(node).positive == ((101.0, 2.0, 3.0), (104.0, 5.0, 6.0))


@given(*[st.lists(st.sampled_from([(float(n), 0.0, 0.0) for n in range(6)]), max_size=6)] * 2)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_points_become_any_others(
    scene: Any, parameter_node: Any, before: list[tuple[float, float, float]], after: list[tuple[float, float, float]]
) -> None:
    node = create_class(scene, parameter_node, replace(LIVER, positive=tuple(before)))
    write_class(scene, node, replace(LIVER, positive=tuple(after)))
    assert read_class(node).positive == tuple(after)
    remove_class(scene, node)


def test_points_that_stay_keep_their_labels_and_locks(scene: Any, parameter_node: Any) -> None:
    dome, hilum, tip, edge = ((float(n), 0.0, 0.0) for n in range(4))
    node = create_class(scene, parameter_node, replace(LIVER, positive=(dome, hilum, tip)))
    for index, label in enumerate(("dome", "hilum", "tip")):
        node.SetNthControlPointLabel(index, label)
        node.SetNthControlPointLocked(index, True)

    def labels(*points: tuple[float, float, float]) -> list[str]:
        write_class(scene, node, replace(LIVER, positive=points))
        count = node.GetNumberOfControlPoints()
        return [node.GetNthControlPointLabel(n) for n in range(count) if node.GetNthControlPointLocked(n)]

    assert labels(dome, hilum, tip, edge) == ["dome", "hilum", "tip"]
    assert labels(dome, tip, edge) == ["dome", "tip"]
    assert labels(dome, hilum, tip, edge) == ["dome", "tip"]
    assert labels(dome, edge) == ["dome"]
    assert labels((9.0, 9.0, 9.0), edge) == ["dome"]


def test_points_that_are_added_have_labels_and_a_list_of_a_fixed_number_takes_them(scene: Any, parameter_node: Any) -> None:
    node = create_class(scene, parameter_node, LIVER)
    node.SetFixedNumberOfControlPoints(True)
    for points in ((*LIVER.positive, (7.0, 8.0, 9.0)), LIVER.positive[1:]):
        write_class(scene, node, replace(LIVER, positive=points))
        assert read_class(node).positive == points
        assert all(node.GetNthControlPointLabel(n) for n in range(len(points)))
        assert node.GetFixedNumberOfControlPoints()


def test_removing_a_class_takes_both_lists(scene: Any, parameter_node: Any) -> None:
    before = scene.GetNumberOfNodes()
    remove_class(scene, create_class(scene, parameter_node, LIVER))
    assert class_nodes(parameter_node) == []
    assert scene.GetNumberOfNodes() == before


def test_classes_are_brought_into_order(scene: Any, parameter_node: Any) -> None:
    for id_ in "abc":
        create_class(scene, parameter_node, replace(LIVER, id=id_))
    order_classes(parameter_node, ["c", "a", "b"])
    assert [read_class(node).id for node in class_nodes(parameter_node)] == ["c", "a", "b"]


def test_classes_that_a_volume_is_given_beside_one_of_their_name_and_id_are_others(scene: Any, parameter_node: Any) -> None:
    volume = scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "CT")
    first = create_class(scene, parameter_node, LIVER)
    assert give_to_volume(volume, [first]) == [first]
    others = [create_class(scene, parameter_node, LIVER) for _ in range(2)]
    assert give_to_volume(volume, [first, *others]) == others
    parameter_node.SetNodeReferenceID("volume", volume.GetID())
    nodes = class_nodes(parameter_node)
    assert nodes == [first, *others]
    assert len(set(map(class_id, nodes))) == len({node.GetName() for node in nodes}) == 3


def test_lists_are_kept_in_a_folder_where_the_application_lists_nodes(scene: Any, parameter_node: Any) -> None:
    keep_subject_hierarchy(scene)
    hierarchy = slicer.vtkMRMLSubjectHierarchyNode.GetSubjectHierarchyNode(scene)
    parents = set()
    for id_ in "ab":
        node = create_class(scene, parameter_node, replace(LIVER, id=id_))
        parents |= {hierarchy.GetItemParent(hierarchy.GetItemByDataNode(n)) for n in (node, negative_node(node))}
    (folder,) = parents
    assert hierarchy.GetItemName(folder) == FOLDER_NAME


def test_a_class_that_is_removed_leaves_nothing(scene: Any, parameter_node: Any) -> None:
    create_class(scene, parameter_node, LIVER)
    count = scene.GetNumberOfNodes()
    remove_class(scene, create_class(scene, parameter_node, ClassState("b2", "spleen", Appearance((0.0, 0.0, 0.0)))))
    assert scene.GetNumberOfNodes() == count
