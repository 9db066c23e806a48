"""Masks as segments, in Slicer's real segmentations."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import vtk
from vtkmodules.util.numpy_support import vtk_to_numpy

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.scene.mrml.transforms import vtk_matrix
from ViTTransferFunction.Testing.support.scenes import MOVED, put_under
from ViTTransferFunction.Testing.support.segments import (
    LABELMAP,
    RED,
    SHAPE,
    SURFACE,
    block,
    output,
    positions_of,
    voxels_of,
    write_segments,
)
from ViTTransferFunction.Testing.support.standin.subject_hierarchy import keep_subject_hierarchy

slicer = pytest.importorskip("slicer")

GREEN = (0.1, 0.9, 0.1)


def test_a_mask_becomes_a_segment_with_its_class_name_and_colour(a_segmentation: Any, a_volume: Any) -> None:
    (segment_id,) = write_segments(a_segmentation, a_volume, [output(block(1, 4))], respect_others=True)
    segment = a_segmentation.GetSegmentation().GetSegment(segment_id)
    assert voxels_of(a_segmentation, segment_id) == positions_of(block(1, 4), a_volume)
    assert segment.GetName() == "growth"
    assert segment.GetColor() == pytest.approx(RED)


def test_an_empty_segmentation_is_set_up_for_the_volume(a_segmentation: Any, a_volume: Any) -> None:
    put_under(a_volume, MOVED)
    write_segments(a_segmentation, a_volume, [output(block(1, 4))], respect_others=True)
    assert a_segmentation.GetDisplayNode() is not None
    assert a_segmentation.GetTransformNodeID() == a_volume.GetTransformNodeID()
    assert a_segmentation.GetNodeReference("referenceImageGeometryRef") is a_volume
    segmentation = a_segmentation.GetSegmentation()
    reference = slicer.vtkOrientedImageData()
    geometry = segmentation.GetConversionParameter("Reference image geometry")
    slicer.vtkSegmentationConverter.DeserializeImageGeometry(geometry, reference, False)
    assert reference.GetDimensions() == SHAPE[::-1]


def test_a_segmentation_is_set_up_in_the_study_of_its_volume_and_stays_where_users_move_it(
    a_segmentation: Any, a_volume: Any
) -> None:
    scene = a_volume.GetScene()
    keep_subject_hierarchy(scene)
    hierarchy = slicer.vtkMRMLSubjectHierarchyNode.GetSubjectHierarchyNode(scene)
    study = hierarchy.CreateStudyItem(hierarchy.CreateSubjectItem(hierarchy.GetSceneItemID(), "patient"), "study")
    volume, segmentation = (_listed(hierarchy, node) for node in (a_volume, a_segmentation))
    hierarchy.SetItemParent(volume, study)
    write_segments(a_segmentation, a_volume, [output(block(1, 4))], respect_others=True)
    assert hierarchy.GetItemParent(segmentation) == study
    hierarchy.SetItemParent(segmentation, hierarchy.GetSceneItemID())
    write_segments(a_segmentation, a_volume, [output(block(1, 5))], respect_others=True)
    assert hierarchy.GetItemParent(segmentation) == hierarchy.GetSceneItemID()


def _listed(hierarchy: Any, node: Any) -> int:
    """The item of a node that was in the scene before the tree was kept."""
    hierarchy.RequestOwnerPluginSearch(node)
    return int(hierarchy.GetItemByDataNode(node))


@pytest.mark.parametrize("volume_moved", [False, True], ids=["volume in place", "volume moved"])
@pytest.mark.parametrize("segmentation_moved", [False, True], ids=["segmentation in place", "segmentation moved"])
def test_voxels_lie_where_the_volume_has_them(
    a_segmentation: Any, a_volume: Any, volume_moved: bool, segmentation_moved: bool
) -> None:
    """Under parent transforms of the volume, of the segmentation, which here shears, or of both."""
    if volume_moved:
        put_under(put_under(a_volume, MOVED), np.diag([1.0, 1.0, -1.0, 1.0]))
    if segmentation_moved:
        sheared = MOVED.copy()
        sheared[0, 2] = 0.4
        put_under(a_segmentation, sheared)
    (segment_id,) = write_segments(a_segmentation, a_volume, [output(block(1, 4))], respect_others=True)
    assert voxels_of(a_segmentation, segment_id) == positions_of(block(1, 4), a_volume)


def test_the_segmentation_moves_with_the_volume_from_then_on(a_segmentation: Any, a_volume: Any) -> None:
    transform = put_under(a_volume, np.eye(4))
    (segment_id,) = write_segments(a_segmentation, a_volume, [output(block(1, 4))], respect_others=True)
    transform.SetMatrixTransformToParent(vtk_matrix(MOVED))
    assert voxels_of(a_segmentation, segment_id) == positions_of(block(1, 4), a_volume)


def test_an_empty_segmentation_stays_under_the_transform_that_the_user_gave_it(a_segmentation: Any, a_volume: Any) -> None:
    put_under(a_segmentation, MOVED)
    given = a_segmentation.GetParentTransformNode()
    (segment_id,) = write_segments(a_segmentation, a_volume, [output(block(1, 4))], respect_others=True)
    assert a_segmentation.GetParentTransformNode() is given
    assert voxels_of(a_segmentation, segment_id) == positions_of(block(1, 4), a_volume)


def test_writing_again_replaces_the_voxels_of_the_same_segment(a_segmentation: Any, a_volume: Any) -> None:
    first = write_segments(a_segmentation, a_volume, [output(block(1, 4)), output(block(4, 5), "b", "b")], respect_others=True)
    again = write_segments(a_segmentation, a_volume, [output(block(2, 3)), output(block(0, 1), "b", "b")], respect_others=True)
    assert again == first
    assert a_segmentation.GetSegmentation().GetNumberOfSegments() == 2
    assert voxels_of(a_segmentation, first[0]) == positions_of(block(2, 3), a_volume)
    assert voxels_of(a_segmentation, first[1]) == positions_of(block(0, 1), a_volume)


def test_classes_share_one_labelmap(a_segmentation: Any, a_volume: Any) -> None:
    masks = {"a": block(0, 2), "b": block(3, 4), "c": block(2, 3)}
    ids = write_segments(a_segmentation, a_volume, [output(m, n, n) for n, m in masks.items()], respect_others=True)
    assert a_segmentation.GetSegmentation().GetNumberOfLayers(LABELMAP) == 1
    for segment_id, mask in zip(ids, masks.values(), strict=True):
        assert voxels_of(a_segmentation, segment_id) == positions_of(mask, a_volume)


def test_more_classes_than_a_byte_can_count_have_labels_of_their_own(a_segmentation: Any, a_volume: Any) -> None:
    segments = []
    for number, place in enumerate(np.ndindex(SHAPE)):
        mask = np.zeros(SHAPE, dtype=bool)
        mask[place] = True
        segments.append(output(mask, f"class-{number}", str(number)))
    ids = write_segments(a_segmentation, a_volume, segments, respect_others=True)
    assert voxels_of(a_segmentation, ids[0]) == positions_of(segments[0].mask, a_volume)
    assert voxels_of(a_segmentation, ids[256]) == positions_of(segments[256].mask, a_volume)


def test_an_empty_mask_makes_an_empty_segment(a_segmentation: Any, a_volume: Any) -> None:
    nothing = np.zeros(SHAPE, dtype=bool)
    ids = write_segments(a_segmentation, a_volume, [output(nothing), output(nothing, "b", "b")], respect_others=True)
    assert [voxels_of(a_segmentation, segment_id) for segment_id in ids] == [[], []]
    write_segments(a_segmentation, a_volume, [output(block(1, 4)), output(nothing, "b", "b")], respect_others=True)
    assert voxels_of(a_segmentation, ids[0]) == positions_of(block(1, 4), a_volume)
    assert voxels_of(a_segmentation, ids[1]) == []


def test_an_empty_segment_can_be_painted_in_afterwards(a_segmentation: Any, a_volume: Any) -> None:
    (segment_id,) = write_segments(a_segmentation, a_volume, [output(np.zeros(SHAPE, dtype=bool))], respect_others=True)
    logic = slicer.vtkSlicerSegmentationsModuleLogic
    stroke = logic.CreateOrientedImageDataFromVolumeNode(a_volume)
    stroke.AllocateScalars(vtk.VTK_UNSIGNED_CHAR, 1)
    vtk_to_numpy(stroke.GetPointData().GetScalars())[:] = block(2, 3).ravel()
    assert logic.SetBinaryLabelmapToSegment(stroke, a_segmentation, segment_id, logic.MODE_MERGE_MAX)
    assert voxels_of(a_segmentation, segment_id) == positions_of(block(2, 3), a_volume)


def test_what_the_user_changed_in_slicer_stays(a_segmentation: Any, a_volume: Any) -> None:
    (segment_id,) = write_segments(a_segmentation, a_volume, [output(block(1, 4))], respect_others=True)
    segment = a_segmentation.GetSegmentation().GetSegment(segment_id)
    segment.SetName("Befund 1")
    segment.SetColor(0.0, 0.0, 1.0)
    segment.SetTerminology("context~SCT^1^Tissue~SCT^2^Mass~^^~~^^~^^")
    write_segments(a_segmentation, a_volume, [output(block(2, 4))], respect_others=True)
    assert segment.GetName() == "Befund 1"
    assert segment.GetColor() == (0.0, 0.0, 1.0)
    assert segment.GetTerminology() == "context~SCT^1^Tissue~SCT^2^Mass~^^~~^^~^^"


def test_a_class_that_is_renamed_and_recoloured_passes_both_on(a_segmentation: Any, a_volume: Any) -> None:
    (segment_id,) = write_segments(a_segmentation, a_volume, [output(block(1, 4))], respect_others=True)
    segment = a_segmentation.GetSegmentation().GetSegment(segment_id)
    segment.SetName("Befund 1")
    write_segments(a_segmentation, a_volume, [output(block(1, 4), name="nodule", color=GREEN)], respect_others=True)
    assert segment.GetName() == "nodule"
    assert segment.GetColor() == pytest.approx(GREEN)


def test_identity_is_the_same_after_saving_and_loading(
    slicer_app: Any, a_segmentation: Any, a_volume: Any, tmp_path: Path
) -> None:
    """With a name that holds the very characters by which the file separates tags."""
    name = "Rein|raus: Größe 50%"
    segments = [output(block(1, 4), name=name), output(block(4, 5), "b", "b")]
    ids = write_segments(a_segmentation, a_volume, segments, respect_others=True)
    path = tmp_path / "written.seg.nrrd"
    storage = slicer_app.scene.AddNewNodeByClass("vtkMRMLSegmentationStorageNode")
    storage.SetFileName(str(path))
    assert storage.WriteData(a_segmentation)
    loaded = slicer_app.scene.AddNewNodeByClass("vtkMRMLSegmentationNode")
    assert storage.ReadData(loaded)

    loaded.GetSegmentation().GetSegment(ids[0]).SetName("renamed by the user")
    segments = [output(block(2, 4), name=name), output(block(4, 5), "b", "b")]
    assert write_segments(loaded, a_volume, segments, respect_others=True) == ids
    assert voxels_of(loaded, ids[0]) == positions_of(block(2, 4), a_volume)
    assert loaded.GetSegmentation().GetSegment(ids[0]).GetName() == "renamed by the user"


@pytest.mark.parametrize(
    ("name", "codes"),
    [
        ("liver", "SCT^10200004^Liver~^^"),
        ("Left kidney", "SCT^64033007^Kidney~SCT^7771000^Left"),
        ("KIDNEY", "SCT^64033007^Kidney~^^"),
        ("growth", "SCT^85756007^Tissue~SCT^85756007^Tissue~^^"),
    ],
)
def test_a_class_named_like_a_structure_gets_its_codes(
    slicer_app: Any, a_segmentation: Any, a_volume: Any, name: str, codes: str
) -> None:
    segments = [output(block(1, 4), name=name)]
    (segment_id,) = write_segments(a_segmentation, a_volume, segments, True, slicer_app.app_logic)
    segment = a_segmentation.GetSegmentation().GetSegment(segment_id)
    assert codes in segment.GetTerminology()
    assert segment.GetName() == name
    assert segment.GetColor() == pytest.approx(RED)


def test_codes_follow_the_classes_name_unless_the_user_chose_others(
    slicer_app: Any, a_segmentation: Any, a_volume: Any
) -> None:
    def write(name: str) -> Any:
        segments = [output(block(1, 4), name=name)]
        (segment_id,) = write_segments(a_segmentation, a_volume, segments, True, slicer_app.app_logic)
        return a_segmentation.GetSegmentation().GetSegment(segment_id)

    assert "^Liver~" in write("liver").GetTerminology()
    assert "^Spleen~" in write("spleen").GetTerminology()
    assert "^Tissue~^^" in write("growth").GetTerminology()
    write("liver").SetTerminology("context~SCT^1^Tissue~SCT^2^Mass~^^~~^^~^^")
    assert "^Mass~" in write("spleen").GetTerminology()


def test_surfaces_are_made_again_where_the_voxels_changed(
    a_segmentation: Any, a_volume: Any, with_others: Callable[[], dict[str, Any]]
) -> None:
    segmentation = a_segmentation.GetSegmentation()
    (ours,) = write_segments(a_segmentation, a_volume, [output(block(1, 3))], respect_others=False)
    segmentation.CollapseBinaryLabelmaps(False)
    a_segmentation.CreateClosedSurfaceRepresentation()
    before = with_others()
    assert all(other["surface"].GetNumberOfPoints() for other in before.values())
    old_bounds = segmentation.GetSegmentRepresentation(ours, SURFACE).GetBounds()

    segments = [output(block(1, 6)), output(block(0, 1), "b", "b"), output(np.zeros(SHAPE, dtype=bool), "c", "c")]
    ids = write_segments(a_segmentation, a_volume, segments, respect_others=False)

    assert with_others() == before
    surfaces = [segmentation.GetSegmentRepresentation(segment_id, SURFACE) for segment_id in ids]
    assert surfaces[0].GetBounds()[5] > old_bounds[5] + 3.0
    assert [bool(surface.GetNumberOfPoints()) for surface in surfaces] == [True, True, False]


def test_no_surfaces_are_made_where_there_were_none(a_segmentation: Any, a_volume: Any) -> None:
    write_segments(a_segmentation, a_volume, [output(block(1, 4))], respect_others=True)
    write_segments(a_segmentation, a_volume, [output(block(2, 4))], respect_others=True)
    assert not a_segmentation.GetSegmentation().ContainsRepresentation(SURFACE)


def test_views_hear_of_new_voxels(a_segmentation: Any, a_volume: Any) -> None:
    write_segments(a_segmentation, a_volume, [output(block(1, 4))], respect_others=True)
    heard: list[str] = []
    for event in ("SourceRepresentationModified", "RepresentationModified"):
        a_segmentation.AddObserver(getattr(slicer.vtkSegmentation, event), lambda *_, event=event: heard.append(event))
    write_segments(a_segmentation, a_volume, [output(block(2, 4))], respect_others=True)
    assert sorted(heard) == ["RepresentationModified", "SourceRepresentationModified"]


def test_a_segmentation_of_surfaces_is_refused_with_the_way_out(surfaces_only: Any, a_volume: Any) -> None:
    with pytest.raises(InputError, match=r"'Segmentation' is stored as 'Closed surface'; expected .* Make source"):
        write_segments(surfaces_only, a_volume, [output(block(1, 4))], respect_others=True)
    assert surfaces_only.GetSegmentation().GetNumberOfSegments() == 1
    assert surfaces_only.GetSegmentation().GetSourceRepresentationName() == SURFACE


def test_an_empty_segmentation_for_surfaces_takes_voxels(a_segmentation: Any, a_volume: Any) -> None:
    a_segmentation.GetSegmentation().SetSourceRepresentationName(SURFACE)
    (segment_id,) = write_segments(a_segmentation, a_volume, [output(block(1, 4))], respect_others=True)
    assert voxels_of(a_segmentation, segment_id) == positions_of(block(1, 4), a_volume)


@pytest.mark.parametrize("warped", ["volume", "segmentation"])
def test_an_error_leaves_the_segmentation_as_it_was(a_segmentation: Any, a_volume: Any, warped: str) -> None:
    (segment_id,) = write_segments(a_segmentation, a_volume, [output(block(1, 4))], respect_others=True)
    transform = a_volume.GetScene().AddNewNodeByClass("vtkMRMLGridTransformNode", "Warp")
    {"volume": a_volume, "segmentation": a_segmentation}[warped].SetAndObserveTransformNodeID(transform.GetID())
    time = a_segmentation.GetSegmentation().GetMTime()
    with pytest.raises(InputError, match="Harden"):
        write_segments(a_segmentation, a_volume, [output(block(2, 3)), output(block(0, 1), "b")], respect_others=True)
    assert a_segmentation.GetSegmentation().GetMTime() == time
    assert a_segmentation.GetSegmentation().GetNumberOfSegments() == 1
    labelmap = a_segmentation.GetSegmentation().GetSegmentRepresentation(segment_id, LABELMAP)
    assert vtk_to_numpy(labelmap.GetPointData().GetScalars()).sum() == block(1, 4).sum()
