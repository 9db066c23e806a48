"""What happens in the scene to a session's nodes, and what is heard of it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.scene.interface.parameters import SceneParameters
from ViTTransferFunction.Logic.scene.mrml.transforms import vtk_matrix
from ViTTransferFunction.Logic.scene.scene_watch import SceneWatch
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image
from ViTTransferFunction.Testing.support.scenes import MOVED, OBLIQUE, add_parameter_node, add_segment, put_under
from ViTTransferFunction.Testing.support.segments import SHAPE, block


class Heard:
    """A watch on a scene, and what was heard of it since it was asked for last."""

    def __init__(self, scene: Any) -> None:
        self.parameters = SceneParameters(add_parameter_node(scene))
        self._heard: list[str] = []
        names = ("parameters", "nodes", "segments", "other scene")
        parameters, nodes, segments, other = (lambda name=name: self._heard.append(name) for name in names)
        self.watch = SceneWatch(scene, self.parameters, parameters, nodes, segments, other)

    def take(self) -> list[str]:
        """Each once, however often in a row."""
        heard, self._heard = list(dict.fromkeys(self._heard)), []
        return heard


@pytest.fixture
def heard(slicer_app: Any) -> Iterator[Heard]:
    heard = Heard(slicer_app.scene)
    assert heard.take() == []
    heard.watch.look()
    assert heard.take() == ["parameters"]
    yield heard
    heard.watch.close()
    assert heard.watch.observer_count == 0


@pytest.fixture
def volume(heard: Heard, a_volume: Any) -> Any:
    """The chosen one."""
    heard.parameters.set_reference("volume", a_volume)
    assert heard.take() == ["parameters"]
    return a_volume


def test_other_voxels_another_place_and_another_name_of_the_volume_are_heard_of(heard: Heard, volume: Any) -> None:
    set_image(volume, np.zeros(SHAPE, dtype=np.int16), OBLIQUE)
    assert heard.take() == ["parameters"]
    transform = put_under(volume, np.eye(4))
    assert heard.take() == ["parameters"]
    transform.SetMatrixTransformToParent(vtk_matrix(MOVED))
    assert heard.take() == ["parameters"]
    volume.SetName("MR")
    assert heard.take() == ["parameters"]


def test_nothing_is_heard_of_a_volume_that_is_not_chosen_any_more(heard: Heard, volume: Any) -> None:
    heard.parameters.set_reference("volume", None)
    heard.take()
    volume.SetName("MR")
    assert heard.take() == []


def test_segments_that_others_add_show_and_move_are_heard_of(heard: Heard, a_segmentation: Any) -> None:
    a_segmentation.CreateDefaultDisplayNodes()
    heard.parameters.set_reference("segmentation", a_segmentation)
    heard.take()
    add_segment(a_segmentation, "bone", block(0, 3), OBLIQUE)
    assert heard.take() == ["segments"]
    a_segmentation.GetDisplayNode().SetSegmentVisibility("bone", False)
    assert heard.take() == ["segments"]
    transform = put_under(a_segmentation, np.eye(4))
    assert heard.take() == ["segments"]
    transform.SetMatrixTransformToParent(vtk_matrix(MOVED))
    assert heard.take() == ["segments"]


def test_a_node_that_goes_is_heard_of_before_the_parameters_are_looked_at(heard: Heard, slicer_app: Any, volume: Any) -> None:
    slicer_app.scene.RemoveNode(volume)
    assert heard.take()[-2:] == ["nodes", "parameters"]


def test_nothing_is_heard_while_many_nodes_are_changed_at_once(heard: Heard, slicer_app: Any, volume: Any) -> None:
    scene = slicer_app.scene
    other = scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "MR")
    scene.StartState(scene.BatchProcessState)
    heard.parameters.set_reference("volume", other)
    scene.RemoveNode(volume)
    heard.watch.look()
    assert heard.take() == []
    scene.EndState(scene.BatchProcessState)
    assert heard.take() == ["nodes", "parameters"]
    other.SetName("CT")
    assert heard.take() == ["parameters"]


def test_a_scene_that_is_closed_is_another_one(heard: Heard, slicer_app: Any) -> None:
    slicer_app.scene.Clear(False)
    assert "other scene" in heard.take()
