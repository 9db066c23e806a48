"""Segments that somebody corrected by hand are told from those that are as they were written, and are not lost."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import slicer
import vtk
from vtkmodules.util.numpy_support import vtk_to_numpy

from ViTTransferFunction.Logic.core.volumes.stepped_work import finished
from ViTTransferFunction.Logic.scene.segments.corrections import corrected_segments
from ViTTransferFunction.Logic.scene.segments.segment_tags import segments_of_classes
from ViTTransferFunction.Testing.support.scenes import OBLIQUE, add_segment, put_under
from ViTTransferFunction.Testing.support.segments import (
    RED,
    SHAPE,
    block,
    output,
    positions_of,
    voxels_of,
    write_segments,
)

LIVER, SPLEEN = "liver-id", "spleen-id"


def corrected(node: Any) -> set[str]:
    """Classes whose segments were corrected."""
    segmentation = node.GetSegmentation()
    return set(finished(corrected_segments(segmentation, segments_of_classes(segmentation, {LIVER, SPLEEN}))))


def organs(liver: np.ndarray, spleen: np.ndarray) -> list[Any]:
    return [output(liver, LIVER, "liver"), output(spleen, SPLEEN, "spleen")]


def paint(node: Any, volume: Any, segment_id: str, mask: np.ndarray) -> None:
    """Add voxels to a segment as the Segment Editor does."""
    logic, label = slicer.vtkSlicerSegmentationsModuleLogic, node.GetSegmentation().GetSegment(segment_id).GetLabelValue()
    stroke = logic.CreateOrientedImageDataFromVolumeNode(volume)
    stroke.AllocateScalars(vtk.VTK_UNSIGNED_CHAR, 1)
    vtk_to_numpy(stroke.GetPointData().GetScalars())[:] = label * mask.ravel()
    assert logic.SetBinaryLabelmapToSegment(stroke, node, segment_id, logic.MODE_MERGE_MAX)


@pytest.fixture
def written(a_segmentation: Any, a_volume: Any) -> list[str]:
    """IDs of two segments of ours, beside one of somebody else."""
    add_segment(a_segmentation, "bone", block(5, 6), OBLIQUE)
    return write_segments(a_segmentation, a_volume, organs(block(1, 3), block(3, 5)), respect_others=True)


def test_segments_as_they_were_written_are_not_corrected(a_segmentation: Any, written: list[str]) -> None:
    assert corrected(a_segmentation) == set()


def test_a_segment_that_was_painted_in_is_corrected_and_its_neighbour_is_not(
    a_segmentation: Any, a_volume: Any, written: list[str]
) -> None:
    paint(a_segmentation, a_volume, written[0], block(0, 1))
    assert corrected(a_segmentation) == {LIVER}


def test_a_segment_that_was_erased_is_corrected(a_segmentation: Any, written: list[str]) -> None:
    assert slicer.vtkSlicerSegmentationsModuleLogic.ClearSegment(a_segmentation, written[1])
    assert corrected(a_segmentation) == {SPLEEN}


def test_a_change_that_is_taken_back_is_none(a_segmentation: Any, a_volume: Any, written: list[str]) -> None:
    logic = slicer.vtkSlicerSegmentationsModuleLogic
    before = slicer.vtkOrientedImageData()
    a_segmentation.GetBinaryLabelmapRepresentation(written[0], before)
    paint(a_segmentation, a_volume, written[0], block(0, 1))
    assert logic.SetBinaryLabelmapToSegment(before, a_segmentation, written[0], logic.MODE_REPLACE)
    assert corrected(a_segmentation) == set()


def test_name_and_colour_are_no_corrections(a_segmentation: Any, written: list[str]) -> None:
    segment = a_segmentation.GetSegmentation().GetSegment(written[0])
    segment.SetName("Befund 1")
    segment.SetColor(0.0, 0.0, 1.0)
    assert corrected(a_segmentation) == set()


def test_merging_splitting_and_moving_labelmaps_is_no_correction(
    a_segmentation: Any, a_volume: Any, written: list[str]
) -> None:
    segmentation = a_segmentation.GetSegmentation()
    segmentation.CollapseBinaryLabelmaps(False)
    assert corrected(a_segmentation) == set()
    for segment_id in segmentation.GetSegmentIDs():
        segmentation.SeparateSegmentLabelmap(segment_id)
    assert corrected(a_segmentation) == set()
    put_under(a_segmentation, np.diag([-1.0, 1.0, 1.0, 1.0]))
    assert corrected(a_segmentation) == set()


def test_other_extents_are_no_correction(a_segmentation: Any, a_volume: Any, written: list[str]) -> None:
    resample = slicer.vtkOrientedImageDataResample
    image = slicer.vtkOrientedImageData()
    a_segmentation.GetBinaryLabelmapRepresentation(written[0], image)
    k, j, i = SHAPE
    padded = slicer.vtkOrientedImageData()
    extent = (-3, i + 4, -1, j + 1, -2, k)
    assert resample.CopyImage(image, padded, extent)
    a_segmentation.GetSegmentation().SeparateSegmentLabelmap(written[0])
    segment = a_segmentation.GetSegmentation().GetSegment(written[0])
    segment.AddRepresentation("Binary labelmap", padded)
    assert segment.GetRepresentation("Binary labelmap").GetExtent() == extent
    assert corrected(a_segmentation) == set()


def test_saving_and_loading_is_no_correction(
    slicer_app: Any, a_segmentation: Any, a_volume: Any, written: list[str], tmp_path: Path
) -> None:
    storage = slicer_app.scene.AddNewNodeByClass("vtkMRMLSegmentationStorageNode")
    storage.SetCropToMinimumExtent(True)
    storage.SetFileName(str(tmp_path / "written.seg.nrrd"))
    assert storage.WriteData(a_segmentation)
    loaded = slicer_app.scene.AddNewNodeByClass("vtkMRMLSegmentationNode")
    assert storage.ReadData(loaded)
    assert corrected(loaded) == set()
    paint(loaded, a_volume, written[0], block(0, 1))
    assert corrected(loaded) == {LIVER}


def test_a_hardened_transform_is_a_correction(a_segmentation: Any, written: list[str]) -> None:
    shift = np.eye(4)
    shift[0, 3] = 2.5
    put_under(a_segmentation, shift)
    a_segmentation.HardenTransform()
    assert corrected(a_segmentation) == {LIVER, SPLEEN}


def test_a_segment_of_which_nothing_is_noted_counts_as_corrected(a_segmentation: Any, written: list[str]) -> None:
    a_segmentation.GetSegmentation().GetSegment(written[0]).RemoveTag("ViTTransferFunction.voxels")
    assert corrected(a_segmentation) == {LIVER}


def test_a_kept_correction_stays_and_the_result_is_written_beside_it(
    a_segmentation: Any, a_volume: Any, written: list[str]
) -> None:
    """Under a name of its own; each class as a whole, where a segment of another class is not in the way."""
    paint(a_segmentation, a_volume, written[0], block(0, 1))
    liver, spleen = write_segments(a_segmentation, a_volume, organs(block(1, 4), block(4, 5)), respect_others=True)
    assert voxels_of(a_segmentation, written[0]) == positions_of(block(0, 3), a_volume)
    assert voxels_of(a_segmentation, liver) == positions_of(block(1, 4), a_volume)
    assert spleen == written[1]
    assert voxels_of(a_segmentation, spleen) == positions_of(block(4, 5), a_volume)
    segmentation = a_segmentation.GetSegmentation()
    names = [segmentation.GetSegment(id_).GetName() for id_ in segmentation.GetSegmentIDs()]
    assert names == ["bone", "liver", "spleen", "liver (2)"]
    assert segmentation.GetSegment(liver).GetColor() == pytest.approx(RED)


def test_a_kept_correction_is_in_the_way_of_other_classes_only_also_later(
    a_segmentation: Any, a_volume: Any, written: list[str]
) -> None:
    paint(a_segmentation, a_volume, written[0], block(0, 1))
    write_segments(a_segmentation, a_volume, organs(block(1, 4), block(4, 5)), respect_others=True)
    liver, spleen = write_segments(a_segmentation, a_volume, organs(block(2, 3), block(0, 2)), respect_others=True)
    assert liver != written[0]
    assert voxels_of(a_segmentation, liver) == positions_of(block(2, 3), a_volume)
    assert voxels_of(a_segmentation, spleen) == []
    assert voxels_of(a_segmentation, written[0]) == positions_of(block(0, 3), a_volume)


def test_a_correction_is_overwritten_where_the_user_says_so(a_segmentation: Any, a_volume: Any, written: list[str]) -> None:
    paint(a_segmentation, a_volume, written[0], block(0, 1))
    segments = organs(block(1, 4), block(4, 5))
    assert write_segments(a_segmentation, a_volume, segments, respect_others=True, corrections="overwrite") == written
    assert voxels_of(a_segmentation, written[0]) == positions_of(block(1, 4), a_volume)
    assert corrected(a_segmentation) == set()


def test_the_segment_that_a_class_continues_is_not_in_its_way(a_segmentation: Any, a_volume: Any) -> None:
    """Only in the way of others; and the result gets a name of its own."""
    theirs = add_segment(a_segmentation, "liver", block(1, 4), OBLIQUE)
    segments = organs(block(2, 5), block(0, 2))
    liver, spleen = write_segments(a_segmentation, a_volume, segments, respect_others=True, continued={LIVER: theirs})
    assert voxels_of(a_segmentation, liver) == positions_of(block(2, 5), a_volume)
    assert voxels_of(a_segmentation, spleen) == positions_of(block(0, 1), a_volume)
    assert voxels_of(a_segmentation, theirs) == positions_of(block(1, 4), a_volume)
    assert a_segmentation.GetSegmentation().GetSegment(liver).GetName() == "liver (2)"


def test_a_segment_that_two_classes_continue_is_in_the_way_of_neither(a_segmentation: Any, a_volume: Any) -> None:
    theirs = add_segment(a_segmentation, "liver", block(1, 5), OBLIQUE)
    duplicates = [output(block(1, 3), LIVER, "liver"), output(block(3, 5), "copy-id", "liver copy")]
    continued = {LIVER: theirs, "copy-id": theirs}
    written = write_segments(a_segmentation, a_volume, duplicates, respect_others=True, continued=continued)
    assert [voxels_of(a_segmentation, segment_id) for segment_id in written] == [
        positions_of(mask, a_volume) for mask in (block(1, 3), block(3, 5))
    ]


def test_the_users_copy_is_never_written_to_also_where_the_original_is_kept(
    a_segmentation: Any, a_volume: Any, written: list[str]
) -> None:
    copy = slicer.vtkSegment()
    copy.DeepCopy(a_segmentation.GetSegmentation().GetSegment(written[0]))
    a_segmentation.GetSegmentation().AddSegment(copy, "copy", written[0])
    assert a_segmentation.GetSegmentation().GetSegmentIDs().index("copy") == 1
    paint(a_segmentation, a_volume, written[0], block(0, 1))
    for mask in (block(1, 4), block(2, 3)):
        write_segments(a_segmentation, a_volume, organs(mask, block(4, 5)), respect_others=False)
        assert voxels_of(a_segmentation, "copy") == positions_of(block(1, 3), a_volume)
        assert voxels_of(a_segmentation, written[0]) == positions_of(block(0, 3), a_volume)
