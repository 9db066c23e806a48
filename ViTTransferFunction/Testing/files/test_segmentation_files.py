"""What segments may be called, and segmentations as others write them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from ViTTransferFunction.Logic.core.classes.colors import default_color
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.files.segmentation_files import Segment, read_segmentation, write_segmentation
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Testing.files.test_dicom_series import write_frames

DICOM_SEGMENTATION = "1.2.840.10008.5.1.4.1.1.66.4"

RED = (1.0, 0.0, 0.0)
TAGS = {
    "Segment0_ID": "Segment_1",
    "Segment0_Name": "kidney",
    "Segment0_Color": "1 0 0",
    "Segment0_LabelValue": "1",
    "Segment1_ID": "Segment_2",
    "Segment1_Name": "tumour",
    "Segment1_Color": "0 1 0",
    "Segment1_LabelValue": "2",
}
NAMES = {
    "what ends a line of text": "a\u2028encoding: ascii\u2029type: none\u2028sizes: 1",
    "what headers are made of": "data file: elsewhere := encoding: ascii",
    "backslashes": "a\\nb\\",
    "quotes and slashes": "a/'b'\"c\"/../.d",
    "spaces around": "  kidney ",
    "many scripts": "肝臓 كبد печень 🫀",
}


@pytest.fixture
def labels() -> np.ndarray:
    found = np.zeros((4, 5, 6), dtype=np.uint8)
    found[1:3, 1:3, 1:4], found[3, 3:, 2:5] = 1, 2
    return found


def write_by_others(path: Path, voxels: np.ndarray, tags: Mapping[str, str]) -> None:
    image = sitk.GetImageFromArray(voxels, isVector=voxels.ndim > 3)
    for key, value in tags.items():
        image.SetMetaData(key, value)
    sitk.WriteImage(image, str(path))


@pytest.mark.parametrize("name", NAMES.values(), ids=NAMES)
def test_a_segment_may_be_called_anything_that_can_be_written(tmp_path: Path, labels: np.ndarray, name: str) -> None:
    path = tmp_path / "out.seg.nrrd"
    write_segmentation(path, labels, Geometry(labels.shape, np.eye(4)), [Segment("kidney", RED), Segment(name, RED)])
    read, _, segments = read_segmentation(path)
    np.testing.assert_array_equal(read, labels)
    assert [segment.name for segment in segments] == ["kidney", name]
    assert sitk.ReadImage(str(path)).GetMetaData("Segment1_Name") == name


def test_names_that_an_older_slicer_wrote_on_windows_have_their_letters(tmp_path: Path, labels: np.ndarray) -> None:
    """Of bytes that are no UTF-8, SimpleITK makes what no text may hold: VTK ends the program that is to draw it."""
    path = tmp_path / "out.seg.nrrd"
    names = ["Lungenfl-gel", "gro-e Z-ste", "ß"]
    write_segmentation(path, labels, Geometry(labels.shape, np.eye(4)), [Segment(name, RED) for name in names])
    path.write_bytes(path.read_bytes().replace(b"fl-gel", b"fl\xfcgel").replace(b"gro-e Z-ste", b"gro\xdfe Z\xffste"))
    assert [segment.name for segment in read_segmentation(path)[2]] == ["Lungenflügel", "große Zÿste", "ß"]


def test_names_may_be_longer_together_than_most_headers(tmp_path: Path, labels: np.ndarray) -> None:
    path, long = tmp_path / "out.seg.nrrd", [f"{index} {'x' * 3000}" for index in range(400)]
    write_segmentation(path, labels, Geometry(labels.shape, np.eye(4)), [Segment(name, RED) for name in long])
    assert [segment.name for segment in read_segmentation(path)[2]] == long


def test_what_a_scans_header_says_besides_is_not_taken_for_what_it_says_of_the_voxels(
    tmp_path: Path, labels: np.ndarray
) -> None:
    write_by_others(tmp_path / "scan.nrrd", labels, {"encoding": "ascii", "units": '"m"', "note": "page\x0cencoding: ascii"})
    np.testing.assert_array_equal(read_volume(tmp_path / "scan.nrrd").array, labels)


def test_what_other_programs_leave_out_is_as_slicer_has_it(tmp_path: Path, labels: np.ndarray) -> None:
    path = tmp_path / "others.seg.nrrd"
    write_by_others(path, (labels == 1).astype(np.uint8), {"Segment0_ID": "kidney"})
    read, _, segments = read_segmentation(path)
    np.testing.assert_array_equal(read, labels == 1)
    assert segments == [Segment("kidney", default_color(0))]


@pytest.mark.parametrize("dtype", [np.uint8, np.float64])
def test_the_segments_of_a_label_map_are_named_by_its_numbers_also_where_these_are_written_as_fractions(
    tmp_path: Path, labels: np.ndarray, dtype: type
) -> None:
    write_by_others(tmp_path / "labels.nrrd", np.array([0, 7, 3])[labels].astype(dtype), {})
    read, _, segments = read_segmentation(tmp_path / "labels.nrrd")
    np.testing.assert_array_equal(read, np.array([0, 2, 1])[labels])
    assert [segment.name for segment in segments] == ["3", "7"]


@pytest.mark.parametrize(
    ("tags", "message"),
    [
        (
            {"Segment1_LabelValue": "1"},
            "two segments of the same voxels, 'kidney' and 'tumour', both labelled 1; .* Remove one",
        ),
        ({"Segment1_LabelValue": "one"}, "segment 'tumour' has the label 'one'; expected a whole number. Open it in Slicer"),
        (
            {"Segment0_Color": "255 0 0"},
            "segment 'kidney' has the color '255 0 0'; expected three numbers from 0 to 1. Open it",
        ),
        ({"Segment0_Color": "red"}, "segment 'kidney' has the color 'red'; expected three numbers from 0 to 1. Open it"),
    ],
)
def test_segments_that_cannot_be_told_apart_or_shown_are_refused_with_what_to_do(
    tmp_path: Path, labels: np.ndarray, tags: dict[str, str], message: str
) -> None:
    write_by_others(tmp_path / "others.seg.nrrd", labels, {**TAGS, **tags})
    with pytest.raises(InputError, match=message):
        read_segmentation(tmp_path / "others.seg.nrrd")


def test_a_segmentation_of_dicom_is_refused_with_what_to_do(tmp_path: Path) -> None:
    """ITK would put the frames of its segments one above the other, as one segment."""
    slices = [[0.0, 2.0, 4.0], [0.0, 2.0, 4.0]]
    file = write_frames(tmp_path / "SEG.dcm", [height for segment in slices for height in segment], kind=DICOM_SEGMENTATION)
    with pytest.raises(InputError, match=r"is a DICOM file; expected a Slicer segmentation .* save the segmentation as \.seg"):
        read_segmentation(file)


def test_segments_in_layers_are_refused_with_how_to_make_one_of_them(tmp_path: Path, labels: np.ndarray) -> None:
    layers = np.stack([labels == 1, labels > 0], axis=-1).astype(np.uint8)
    write_by_others(tmp_path / "others.seg.nrrd", layers, {**TAGS, "Segment1_LabelValue": "1", "Segment1_Layer": "1"})
    with pytest.raises(InputError, match=r"segments in 2 layers, .* press 'Collapse labelmap layers'"):
        read_segmentation(tmp_path / "others.seg.nrrd")
