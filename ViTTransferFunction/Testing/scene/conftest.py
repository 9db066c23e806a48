"""A volume, and a segmentation with segments of somebody else."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import slicer
import vtk

from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image
from ViTTransferFunction.Testing.support.corrected import Corrected
from ViTTransferFunction.Testing.support.scenes import OBLIQUE, FollowUp, add_parameter_node, add_segment, open_spheres
from ViTTransferFunction.Testing.support.segments import LABELMAP, SHAPE, SURFACE, block, everything_about
from ViTTransferFunction.Testing.support.spheres import Spheres


@pytest.fixture
def session(slicer_app: Any, spheres: Spheres) -> Iterator[SceneSession]:
    """A session on the spheres, ready for clicks."""
    session = open_spheres(slicer_app, spheres)
    yield session
    session.close()


@pytest.fixture
def session_without_volume(slicer_app: Any) -> Iterator[SceneSession]:
    """A session without a volume, which starts no compute process."""
    session = SceneSession(slicer_app.scene, slicer_app.app_logic, add_parameter_node(slicer_app.scene))
    yield session
    assert session.compute_pid is None
    session.close()


@pytest.fixture
def follow_up(slicer_app: Any, spheres: Spheres) -> FollowUp:
    """A later scan, in which the spheres are elsewhere."""
    return FollowUp(slicer_app.scene, spheres)


@pytest.fixture
def a_volume(slicer_app: Any) -> Any:
    node = slicer_app.scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "CT")
    set_image(node, np.arange(np.prod(SHAPE), dtype=np.int16).reshape(SHAPE), OBLIQUE)
    return node


@pytest.fixture
def a_segmentation(slicer_app: Any) -> Any:
    return slicer_app.scene.AddNewNodeByClass("vtkMRMLSegmentationNode", "Segmentation")


@pytest.fixture
def surfaces_only(a_segmentation: Any) -> Any:
    """A segmentation as an STL file gives it."""
    source = vtk.vtkSphereSource()
    source.Update()
    a_segmentation.GetSegmentation().SetSourceRepresentationName(SURFACE)
    segment = slicer.vtkSegment()
    segment.SetName("implant")
    segment.AddRepresentation(SURFACE, source.GetOutput())
    a_segmentation.GetSegmentation().AddSegment(segment, "implant")
    return a_segmentation


@pytest.fixture
def with_others(a_segmentation: Any, a_volume: Any) -> Callable[[], dict[str, Any]]:
    """The segmentation with three segments of somebody else; gives all that must not change about them.

    The first two share a labelmap, the third overlaps with both.
    """
    a_segmentation.CreateDefaultDisplayNodes()
    for name, mask in (("bone", block(0, 3)), ("vessel", block(3, 5)), ("tumour", block(2, 4))):
        add_segment(a_segmentation, name, mask, OBLIQUE)
    a_segmentation.GetSegmentation().CollapseBinaryLabelmaps(False)
    a_segmentation.SetReferenceImageGeometryParameterFromVolumeNode(a_volume)
    assert a_segmentation.GetSegmentation().GetNumberOfLayers(LABELMAP) == 2
    return lambda: {name: everything_about(a_segmentation, name) for name in ("bone", "vessel", "tumour")}


@pytest.fixture
def corrected(slicer_app: Any) -> Iterator[Corrected]:
    corrected = Corrected(slicer_app.scene)
    yield corrected
    corrected.annotations.close()
