"""Segments are written in short steps: all or nothing, whatever happens to the scene in between."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from typing import Any
from weakref import ref

import numpy as np
import pytest
import slicer
from vtkmodules.util.numpy_support import vtk_to_numpy

from ViTTransferFunction.Logic.compute.requests import Labels
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes import stepped_work
from ViTTransferFunction.Logic.rendering.appearance import Appearance
from ViTTransferFunction.Logic.scene.classes.class_state import Classes, ClassState
from ViTTransferFunction.Logic.scene.interface.parameters import SceneParameters
from ViTTransferFunction.Logic.scene.segments.segment_output import SegmentOutput
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image
from ViTTransferFunction.Testing.support.scenes import OBLIQUE, add_parameter_node, add_segment

SHAPE = (12, 512, 512)
POINT = ((0.0, 0.0, 0.0),)
CLASSES = (
    ClassState("a", "liver", Appearance((1.0, 0.0, 0.0)), positive=POINT),
    ClassState("b", "spleen", Appearance((0.0, 1.0, 0.0)), positive=POINT),
)
LABELS = np.zeros(SHAPE, dtype=np.uint8)
LABELS[:, 10:200, 20:400] = 1
LABELS[:, 300:400, 20:400] = 2


class Desk:
    """A volume, a segmentation with a segment of somebody else, and the output to it, of which one step is taken at a time."""

    def __init__(self, app: Any) -> None:
        self.scene = app.scene
        self.classes: Classes = CLASSES
        self.volume = app.scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "CT")
        set_image(self.volume, np.zeros(SHAPE, dtype=np.int16), OBLIQUE)
        self.segmentation = app.scene.AddNewNodeByClass("vtkMRMLSegmentationNode", "of a colleague")
        add_segment(self.segmentation, "bone", block(slice(0, 100)), OBLIQUE)
        self.parameters = SceneParameters(add_parameter_node(app.scene))
        self.parameters.set_reference("volume", self.volume)
        self.parameters.set_reference("segmentation", self.segmentation)
        self.reported: list[str] = []
        self.output = SegmentOutput(app.scene, app.app_logic, self.parameters, lambda: self.classes, self.reported.append)

    def begin(self) -> None:
        """Begin to write, and take some of the steps."""
        self.output.write(self.parameters.segmentation, Labels(LABELS, (0, 0, 0)), ["a", "b"], "keep", "")
        for _ in range(10):
            self.output.advance()
        assert self.output.busy

    def finish(self) -> int:
        """Take all steps that are left; returns how many."""
        count = 0
        while self.output.busy:
            self.output.advance()
            count += 1
        return count

    def voxels(self) -> dict[str, int]:
        """How many voxels each segment has, by its name."""
        segmentation = self.segmentation.GetSegmentation()
        segments = [segmentation.GetSegment(id_) for id_ in segmentation.GetSegmentIDs()]
        return {segment.GetName(): int((labels_of(segment) == segment.GetLabelValue()).sum()) for segment in segments}


def labels_of(segment: Any) -> np.ndarray:
    return vtk_to_numpy(segment.GetRepresentation("Binary labelmap").GetPointData().GetScalars())


def block(rows: slice) -> np.ndarray:
    mask = np.zeros(SHAPE, dtype=bool)
    mask[:, rows, 100:150] = True
    return mask


@pytest.fixture
def desk(slicer_app: Any, monkeypatch: pytest.MonkeyPatch) -> Desk:
    monkeypatch.setattr(stepped_work, "ADVANCE_S", 0.0)
    return Desk(slicer_app)


BONE = int(block(slice(0, 100)).sum())
LIVER, SPLEEN = int((LABELS == 1).sum()), int((LABELS == 2).sum())
LIVER_BESIDE_BONE = LIVER - int((block(slice(0, 100)) & (LABELS == 1)).sum())


def test_nothing_is_written_before_everything_is(desk: Desk) -> None:
    time = desk.segmentation.GetSegmentation().GetMTime()
    desk.begin()
    shares = []
    while desk.output.busy:
        assert desk.segmentation.GetSegmentation().GetMTime() == time
        assert desk.output.progress is not None
        shares.append(desk.output.progress.done / desk.output.progress.total)
        desk.output.advance()
    assert len(shares) > 3
    assert shares == sorted(shares)
    assert 0.0 < shares[0] < 0.6
    assert desk.voxels() == {"bone": BONE, "liver": LIVER_BESIDE_BONE, "spleen": SPLEEN}
    assert desk.output.progress is None


def test_the_segmentation_hears_of_one_modification(desk: Desk) -> None:
    heard: list[str] = []
    desk.begin()
    desk.segmentation.AddObserver("ModifiedEvent", lambda caller, event: heard.append(event))
    desk.finish()
    assert len(heard) == 1


def test_cancelling_leaves_everything_as_it_was(desk: Desk) -> None:
    desk.parameters.set_reference("segmentation", None)
    nodes = desk.scene.GetNumberOfNodes()
    desk.begin()
    desk.output.cancel()
    assert desk.finish() == 0
    assert desk.voxels() == {"bone": BONE}
    assert desk.scene.GetNumberOfNodes() == nodes


@pytest.mark.parametrize("work", ["writing", "looking for corrections"])
def test_what_fails_is_over_and_fails_once(desk: Desk, work: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """For want of memory, say."""

    def fails(*_: Any) -> Iterator[int]:
        yield 1
        raise MemoryError

    for steps in ("prepare_segments", "corrected_segments"):
        monkeypatch.setattr(f"ViTTransferFunction.Logic.scene.segments.segment_output.{steps}", fails)
    with pytest.raises(MemoryError):  # noqa: PT012
        if work == "writing":
            desk.begin()
        else:
            desk.output.find_corrections(lambda: pytest.fail("nobody knows whether there are none"))
        desk.finish()
    assert not desk.output.busy
    desk.output.advance()
    assert desk.voxels() == {"bone": BONE}


@pytest.mark.parametrize("end", ["written", "cancelled"])
def test_labels_leave_memory_when_they_are_not_needed_any_more(desk: Desk, end: str) -> None:
    labels = Labels(LABELS.copy(), (0, 0, 0))
    voxels = ref(labels.array)
    desk.output.write(desk.segmentation, labels, ["a", "b"], "keep", "")
    del labels
    desk.output.advance()
    assert voxels() is not None
    if end == "written":
        desk.finish()
    else:
        desk.output.cancel()
    gc.collect()
    assert voxels() is None


def test_a_new_segmentation_is_made_with_its_segments(desk: Desk) -> None:
    desk.parameters.set_reference("segmentation", None)
    desk.begin()
    desk.finish()
    assert desk.parameters.segmentation.GetName() == "CT segmentation"
    assert desk.parameters.segmentation.GetSegmentation().GetNumberOfSegments() == 2
    assert desk.voxels() == {"bone": BONE}


def test_a_volume_that_is_deleted_meanwhile_ends_it_quietly(desk: Desk) -> None:
    desk.begin()
    desk.scene.RemoveNode(desk.volume)
    assert desk.finish() == 1
    assert desk.voxels() == {"bone": BONE}


@pytest.mark.parametrize("work", ["writing", "looking for corrections"])
def test_that_the_segmentation_is_deleted_meanwhile_is_said_and_nothing_written(desk: Desk, work: str) -> None:
    if work == "writing":
        desk.begin()
    else:
        desk.output.find_corrections(lambda: None)
    desk.scene.RemoveNode(desk.segmentation)
    nodes = desk.scene.GetNumberOfNodes()
    with pytest.raises(InputError, match="'of a colleague' was removed"):
        desk.output.advance()
    assert not desk.output.busy
    assert desk.scene.GetNumberOfNodes() == nodes
    assert desk.voxels() == {"bone": BONE}


def test_so_is_that_it_was_deleted_while_segments_were_computed(desk: Desk) -> None:
    desk.scene.RemoveNode(desk.segmentation)
    with pytest.raises(InputError, match="'of a colleague' was removed"):
        desk.output.write(desk.segmentation, Labels(LABELS, (0, 0, 0)), ["a", "b"], "keep", "")
    assert not desk.output.busy


def test_a_scene_that_is_closed_meanwhile_ends_it_quietly(desk: Desk) -> None:
    desk.begin()
    desk.scene.Clear(False)
    assert desk.finish() == 1


def test_what_the_user_paints_meanwhile_is_respected(desk: Desk) -> None:
    desk.begin()
    add_segment(desk.segmentation, "vessel", block(slice(150, 180)), OBLIQUE)
    desk.finish()
    painted = int((block(slice(150, 180)) & (LABELS == 1)).sum())
    vessel = int(block(slice(150, 180)).sum())
    assert desk.voxels() == {"bone": BONE, "vessel": vessel, "liver": LIVER_BESIDE_BONE - painted, "spleen": SPLEEN}


def test_the_segment_editors_undo_goes_back_to_what_was_written_also_where_it_saved_a_state_meanwhile(desk: Desk) -> None:
    history = slicer.vtkSegmentationHistory()
    history.SetSegmentation(desk.segmentation.GetSegmentation())
    add_segment(desk.segmentation, "vessel", block(slice(450, 500)), OBLIQUE)
    desk.segmentation.GetSegmentation().CollapseBinaryLabelmaps(False)
    desk.output.write(desk.parameters.segmentation, Labels(LABELS // 2, (0, 0, 0)), ["a"], "keep", "")
    desk.finish()
    desk.begin()
    history.SaveState()
    desk.finish()
    written = desk.voxels()
    history.SaveState()
    for segment_id in desk.segmentation.GetSegmentation().GetSegmentIDs():
        desk.segmentation.RemoveSegment(segment_id)
    history.RestorePreviousState()
    assert desk.voxels() == written


def test_a_class_that_is_removed_meanwhile_is_not_written_and_leaves_no_voxels(desk: Desk) -> None:
    desk.begin()
    desk.classes = CLASSES[1:]
    desk.finish()
    assert desk.voxels() == {"bone": BONE, "spleen": SPLEEN}
    segmentation = desk.segmentation.GetSegmentation()
    spleen = segmentation.GetSegment(segmentation.GetSegmentIDs()[1])
    assert int((labels_of(spleen) != 0).sum()) == SPLEEN


def test_a_class_that_is_renamed_meanwhile_has_its_new_name(desk: Desk) -> None:
    desk.begin()
    desk.classes = (CLASSES[0], ClassState("b", "milza", Appearance((0.0, 1.0, 0.0))))
    desk.finish()
    assert set(desk.voxels()) == {"bone", "liver", "milza"}


def test_a_volume_that_is_bent_meanwhile_is_reported_and_nothing_written(desk: Desk) -> None:
    desk.begin()
    bent = desk.scene.AddNewNodeByClass("vtkMRMLGridTransformNode", "Warp")
    desk.volume.SetAndObserveTransformNodeID(bent.GetID())
    with pytest.raises(InputError, match="Harden"):
        desk.finish()
    assert not desk.output.busy
    assert desk.voxels() == {"bone": BONE}


def test_corrections_are_looked_for_in_steps_and_named_once(desk: Desk) -> None:
    desk.begin()
    desk.finish()
    called: list[str] = []
    desk.output.find_corrections(lambda: called.append("none"))
    assert desk.finish() > 2
    assert (called, desk.output.take_corrected()) == (["none"], ())
    segmentation = desk.segmentation.GetSegmentation()
    assert slicer.vtkSlicerSegmentationsModuleLogic.ClearSegment(desk.segmentation, segmentation.GetSegmentIDs()[1])
    desk.output.find_corrections(lambda: called.append("again"))
    desk.finish()
    assert called == ["none"]
    assert desk.output.take_corrected() == ("liver",)
    assert desk.output.take_corrected() == ()


def test_a_segment_that_is_deleted_while_corrections_are_looked_for_ends_it_quietly(desk: Desk) -> None:
    desk.begin()
    desk.finish()
    segmentation = desk.segmentation.GetSegmentation()
    for steps in (0, 3):
        desk.output.find_corrections(lambda: None)
        for _ in range(steps):
            desk.output.advance()
        segmentation.RemoveSegment(segmentation.GetSegmentIDs()[-1])
        desk.finish()
        assert desk.output.take_corrected() == ()


def test_of_segments_with_voxels_there_is_nothing_to_say(desk: Desk) -> None:
    desk.begin()
    desk.finish()
    assert desk.reported == []


def test_which_segments_are_empty_is_said_once(desk: Desk) -> None:
    desk.classes = (*CLASSES, ClassState("other", "vessel", Appearance((0.0, 0.0, 1.0))))
    desk.output.write(desk.parameters.segmentation, Labels(LABELS, (0, 0, 0)), ["b", "a", "other"], "keep", "")
    desk.finish()
    assert desk.voxels()["vessel"] == 0
    (notice,) = desk.reported
    assert notice.startswith("Nothing was found of 'vessel': nothing is similar enough")


def test_a_segment_is_empty_as_well_where_no_class_has_a_voxel(desk: Desk) -> None:
    desk.output.write(desk.parameters.segmentation, Labels(np.zeros((0, 0, 0), np.uint8), (0, 0, 0)), ["a", "b"], "keep", "")
    desk.finish()
    (notice,) = desk.reported
    assert notice.startswith("Nothing was found of 'liver', 'spleen'")


def test_a_segment_whose_voxels_others_have_is_said_to_be_empty_for_that(desk: Desk) -> None:
    add_segment(desk.segmentation, "body", LABELS > 0, OBLIQUE)
    desk.begin()
    desk.finish()
    (notice,) = desk.reported
    assert notice.startswith("Nothing is left of 'liver', 'spleen': all voxels belong to other segments")


@pytest.mark.parametrize(("rows", "lacking"), [(slice(0, 110), ["liver"]), (slice(0, 100), [])])
def test_a_segment_is_said_to_lack_most_of_its_voxels_where_others_have_them(
    desk: Desk, rows: slice, lacking: list[str]
) -> None:
    earlier = np.zeros(SHAPE, dtype=bool)
    earlier[:, rows] = True
    add_segment(desk.segmentation, "earlier", earlier, OBLIQUE)
    desk.begin()
    desk.finish()
    assert [notice.partition(":")[0] for notice in desk.reported] == [f"Less than half is left of '{name}'" for name in lacking]
