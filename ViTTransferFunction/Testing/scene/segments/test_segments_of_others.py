"""Segments that are not ours do not change when ours are written."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry, transform_points
from ViTTransferFunction.Logic.scene.mrml.transforms import matrix_to_world
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image
from ViTTransferFunction.Testing.support.scenes import MOVED, OBLIQUE, add_segment, annotate, put_under, write_all
from ViTTransferFunction.Testing.support.segments import (
    LABELMAP,
    SHAPE,
    block,
    everything_about,
    output,
    positions_of,
    voxels_of,
    write_segments,
)
from ViTTransferFunction.Testing.support.spheres import Spheres

slicer = pytest.importorskip("slicer")


@pytest.mark.parametrize("respect_others", [False, True])
def test_other_segments_stay_as_they_are(
    a_segmentation: Any, a_volume: Any, with_others: Callable[[], dict[str, Any]], respect_others: bool
) -> None:
    before = with_others()
    for mask in (block(1, 5), block(0, 2), np.ones(SHAPE, dtype=bool)):
        write_segments(a_segmentation, a_volume, [output(mask), output(~mask, "b", "b")], respect_others)
        assert with_others() == before


def test_other_segments_stay_as_they_are_when_ours_shares_their_labelmap(
    a_segmentation: Any, a_volume: Any, with_others: Callable[[], dict[str, Any]]
) -> None:
    """As it does after a segmentation was saved and loaded."""
    segmentation = a_segmentation.GetSegmentation()
    (ours,) = write_segments(a_segmentation, a_volume, [output(block(5, 6))], respect_others=True)
    segmentation.CollapseBinaryLabelmaps(False)
    assert len(segmentation.GetSegmentIDsForDataObject(segmentation.GetSegmentRepresentation(ours, LABELMAP), LABELMAP)) > 1
    before = with_others()
    write_segments(a_segmentation, a_volume, [output(block(1, 5))], respect_others=False)
    assert with_others() == before
    assert voxels_of(a_segmentation, ours) == positions_of(block(1, 5), a_volume)
    write_segments(a_segmentation, a_volume, [output(np.zeros(SHAPE, dtype=bool))], respect_others=False)
    assert with_others() == before


def test_nothing_of_ours_stays_in_a_labelmap_that_it_shared(
    a_segmentation: Any, a_volume: Any, with_others: Callable[[], dict[str, Any]]
) -> None:
    """Slicer gives a free label of that labelmap to the next new segment, to which such voxels would then belong."""
    segmentation = a_segmentation.GetSegmentation()
    (ours,) = write_segments(a_segmentation, a_volume, [output(block(5, 6))], respect_others=True)
    segmentation.CollapseBinaryLabelmaps(False)
    label = segmentation.GetSegment(ours).GetLabelValue()
    shared = vtk_to_numpy(segmentation.GetSegmentRepresentation("bone", LABELMAP).GetPointData().GetScalars())
    assert label in shared
    write_segments(a_segmentation, a_volume, [output(block(1, 5))], respect_others=False)
    shared = vtk_to_numpy(segmentation.GetSegmentRepresentation("bone", LABELMAP).GetPointData().GetScalars())
    assert label not in shared


def test_voxels_of_other_segments_are_left_out(
    a_segmentation: Any, a_volume: Any, with_others: Callable[[], dict[str, Any]]
) -> None:
    everywhere = np.ones(SHAPE, dtype=bool)
    (ours,) = write_segments(a_segmentation, a_volume, [output(everywhere)], respect_others=True)
    assert voxels_of(a_segmentation, ours) == positions_of(everywhere & ~block(0, 5), a_volume)
    write_segments(a_segmentation, a_volume, [output(everywhere)], respect_others=False)
    assert voxels_of(a_segmentation, ours) == positions_of(everywhere, a_volume)


def test_the_segment_of_a_class_that_was_never_here_counts_as_somebody_elses(a_segmentation: Any, a_volume: Any) -> None:
    (finished,) = write_segments(a_segmentation, a_volume, [output(block(1, 4), "old")], respect_others=True)
    (new,) = write_segments(a_segmentation, a_volume, [output(block(2, 6), "new")], respect_others=True)
    assert voxels_of(a_segmentation, finished) == positions_of(block(1, 4), a_volume)
    assert voxels_of(a_segmentation, new) == positions_of(block(4, 6), a_volume)


def test_the_users_copy_of_our_segment_is_the_users(a_segmentation: Any, a_volume: Any) -> None:
    (ours,) = write_segments(a_segmentation, a_volume, [output(block(1, 4))], respect_others=True)
    copy = slicer.vtkSegment()
    copy.DeepCopy(a_segmentation.GetSegmentation().GetSegment(ours))
    a_segmentation.GetSegmentation().AddSegment(copy, "0-copy")
    write_segments(a_segmentation, a_volume, [output(block(2, 6))], respect_others=False)
    assert voxels_of(a_segmentation, "0-copy") == positions_of(block(1, 4), a_volume)
    assert voxels_of(a_segmentation, ours) == positions_of(block(2, 6), a_volume)


@pytest.mark.parametrize("moved", [False, True], ids=["in place", "moved"])
def test_segments_on_another_grid_keep_it(a_segmentation: Any, a_volume: Any, moved: bool) -> None:
    """A coarser one with other axes, whose voxels ours have to make room for."""
    coarse = np.diag([4.0, 4.0, 4.0, 1.0])
    coarse[:3, 3] = transform_points(matrix_to_world(a_volume), np.array([[4.0, -18.0, 38.0]]))[0]
    a_segmentation.CreateDefaultDisplayNodes()
    add_segment(a_segmentation, "other", np.ones((3, 3, 3), dtype=bool), coarse)
    if moved:
        put_under(a_segmentation, MOVED)
        put_under(a_volume, MOVED)
    before = everything_about(a_segmentation, "other")
    everywhere = np.ones(SHAPE, dtype=bool)
    (ours,) = write_segments(a_segmentation, a_volume, [output(everywhere)], respect_others=True)

    assert everything_about(a_segmentation, "other") == before
    image = a_segmentation.GetSegmentation().GetSegmentRepresentation("other", LABELMAP)
    assert image.GetSpacing() == (4.0, 4.0, 4.0)
    indices = Geometry((3, 3, 3), coarse).ras_to_ijk(Geometry(SHAPE, OBLIQUE).voxel_centres_ras())
    taken = np.all((indices > -0.5) & (indices < 2.5), axis=1).reshape(SHAPE)
    assert 0 < taken.sum() < taken.size
    assert voxels_of(a_segmentation, ours) == positions_of(~taken, a_volume)


def test_a_reference_geometry_that_others_rely_on_stays(a_segmentation: Any, a_volume: Any) -> None:
    add_segment(a_segmentation, "other", np.ones((3, 3, 3), dtype=bool), np.eye(4))
    other_volume = a_volume.GetScene().AddNewNodeByClass("vtkMRMLScalarVolumeNode", "MR")
    set_image(other_volume, np.zeros((3, 3, 3), dtype=np.int16), np.eye(4))
    a_segmentation.SetReferenceImageGeometryParameterFromVolumeNode(other_volume)
    write_segments(a_segmentation, a_volume, [output(block(1, 4))], respect_others=True)
    assert a_segmentation.GetNodeReference("referenceImageGeometryRef") is other_volume


def test_others_without_a_reference_geometry_get_the_volumes(a_segmentation: Any, a_volume: Any) -> None:
    add_segment(a_segmentation, "other", np.ones((3, 3, 3), dtype=bool), np.eye(4))
    write_segments(a_segmentation, a_volume, [output(block(1, 4))], respect_others=True)
    assert a_segmentation.GetNodeReference("referenceImageGeometryRef") is a_volume


def test_others_do_not_move_with_a_volume_that_is_under_a_transform(a_segmentation: Any, a_volume: Any) -> None:
    add_segment(a_segmentation, "other", np.ones((3, 3, 3), dtype=bool), np.eye(4))
    put_under(a_volume, MOVED)
    (ours,) = write_segments(a_segmentation, a_volume, [output(block(1, 4))], respect_others=False)
    assert a_segmentation.GetParentTransformNode() is None
    assert voxels_of(a_segmentation, ours) == positions_of(block(1, 4), a_volume)


def test_a_segmentation_that_was_made_surfaces_is_refused_before_anything_is_asked_or_computed(
    session: SceneSession, spheres: Spheres
) -> None:
    """Who says that corrections are to be overwritten, or waits for segments, is not told afterwards that they cannot be."""
    annotate(session, spheres)
    write_all(session)
    node = session.parameters.segmentation
    node.CreateClosedSurfaceRepresentation()
    node.GetSegmentation().SetSourceRepresentationName("Closed surface")
    session.wait()
    for corrections in ("ask", "overwrite"):
        session.segments.write(corrections)
        assert not session.busy
        assert "is stored as 'Closed surface'" in (session.take_error() or "")
        session.wait()
        assert session.segments.take_corrected() == ()
