"""Volumes and segmentations from and to files."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813
import slicerio

from ViTTransferFunction.Logic.core.system import available_memory
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.geometry import LPS_TO_RAS, Geometry
from ViTTransferFunction.Logic.core.volumes.resampling import resample_labels
from ViTTransferFunction.Logic.files.segmentation_files import Segment, read_segmentation, write_segmentation
from ViTTransferFunction.Logic.files.volume_files import _name, files_of, read_volume
from ViTTransferFunction.Testing.attack.scans import meta, meta_fields, nrrd, nrrd_fields
from ViTTransferFunction.Testing.files.test_dicom_series import stack
from ViTTransferFunction.Testing.support.allocation import peak_bytes

OBLIQUE_LEFT_HANDED = np.array([[-1.6, 0.9, 0.0, 30.0], [1.2, 1.2, 0.0, -20.0], [0.0, 0.0, 5.0, 7.0], [0.0, 0.0, 0.0, 1.0]])
SEGMENTS = [Segment("left kidney", (0.9, 0.1, 0.2)), Segment("Leber, groß", (0.1, 0.5, 1.0))]


def image(array: np.ndarray, **kwargs: bool) -> sitk.Image:
    return sitk.GetImageFromArray(array, **kwargs)


def ramp(shape: tuple[int, ...]) -> np.ndarray:
    return np.arange(np.prod(shape), dtype=np.int16).reshape(shape)


def turned_ramp() -> sitk.Image:
    """A ramp of 4 × 5 × 6 voxels that lies off the origin, with unequal edges, mirrored and turned about S."""
    turned = image(ramp((4, 5, 6)))
    turned.SetSpacing([2.0, 1.5, 5.0])
    turned.SetOrigin([30.0, -20.0, 7.0])
    turned.SetDirection([-0.8, 0.6, 0.0, 0.6, 0.8, 0.0, 0.0, 0.0, 1.0])
    return turned


@pytest.mark.parametrize("name", ["scan.hdr", "scan.img", "scan.nhdr", "skipping.nhdr", "scan.mhd"])
def test_a_volume_s_files_are_that_with_its_header_and_that_with_its_voxels(tmp_path: Path, name: str) -> None:
    """Cohorts tell by them whether a case has to be computed again."""
    sitk.WriteImage(turned_ramp(), str(tmp_path / name.replace(".img", ".hdr")))
    both = set(tmp_path.iterdir())
    if name.startswith("skipping"):
        header = tmp_path / name
        header.write_bytes(header.read_bytes().replace(b"encoding:", b"byte skip: -1\nencoding:"))
    assert set(files_of(tmp_path / name)) == both
    assert len(both) == 2


@pytest.mark.parametrize(("name", "copies"), [("scan.nii.gz", 2), ("scan.nii", 2), ("scan.nrrd", 1), ("scan.mha", 1)])
def test_a_volume_that_memory_has_no_room_for_is_refused_before_the_system_ends_the_program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, copies: int
) -> None:
    sitk.WriteImage(turned_ramp(), str(tmp_path / name), useCompression=True)
    needed = copies * turned_ramp().GetNumberOfPixels() * turned_ramp().GetSizeOfPixelComponent()
    monkeypatch.setattr(available_memory, "available_memory_bytes", lambda: needed - 1)
    with pytest.raises(InputError, match=rf"Opening .*{name} takes at least .* Close other programs"):
        read_volume(tmp_path / name)
    monkeypatch.setattr(available_memory, "available_memory_bytes", lambda: needed)
    assert read_volume(tmp_path / name).shape == (4, 5, 6)


@pytest.mark.parametrize("name", ["scan.seg.nrrd", "renamed.nrrd"])
def test_a_segmentation_is_not_taken_for_a_scan_whatever_it_is_called(tmp_path: Path, name: str) -> None:
    labels = (ramp((4, 5, 6)) % 3).astype(np.uint8)
    write_segmentation(tmp_path / "written.seg.nrrd", labels, Geometry(labels.shape, np.eye(4)), SEGMENTS)
    path = (tmp_path / "written.seg.nrrd").rename(tmp_path / name)
    with pytest.raises(InputError, match=f"{name} is a segmentation; expected the scan that it is of"):
        read_volume(path)


@pytest.mark.parametrize(
    ("ending", "said", "unsaid"),
    [
        (".nrrd", b"space: left-posterior-superior", b"space dimension: 3"),
        (".nrrd", b"space: left-posterior-superior", b"space: 3D-right-handed"),
        (".mha", b"TransformMatrix", b"Comment"),
    ],
)
def test_of_a_file_that_does_not_name_the_patients_sides_there_is_a_warning(
    tmp_path: Path, ending: str, said: bytes, unsaid: bytes
) -> None:
    path = tmp_path / f"scan{ending}"
    warnings: list[str] = []
    straight = turned_ramp()
    straight.SetDirection(np.eye(3).ravel().tolist())
    sitk.WriteImage(straight, str(path))
    read_volume(path, warnings.append)
    assert not warnings
    assert said in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(said, unsaid, 1))
    read_volume(path, warnings.append)
    assert [f"{path.name} does not say how it lies in the patient" in warning for warning in warnings] == [True]


@pytest.mark.parametrize("ending", [".nii.gz", ".nrrd", ".mha"])
def test_array_and_geometry_are_the_same_in_every_format(tmp_path: Path, ending: str) -> None:
    source = turned_ramp()
    sitk.WriteImage(source, str(tmp_path / f"scan{ending}"))

    volume = read_volume(tmp_path / f"scan{ending}")

    np.testing.assert_array_equal(volume.array, ramp((4, 5, 6)))
    voxel = np.array([[5, 4, 3]])
    physical_lps = source.TransformIndexToPhysicalPoint([5, 4, 3])
    np.testing.assert_allclose(volume.geometry.ijk_to_ras_points(voxel)[0], np.array(physical_lps) * [-1, -1, 1], atol=1e-4)
    assert volume.name == "scan"


@pytest.mark.parametrize("ending", [".nii.gz", ".nrrd", ".mha"])
def test_of_one_time_point_alone_is_the_volume_that_it_is(tmp_path: Path, ending: str) -> None:
    frame = turned_ramp()
    sitk.WriteImage(frame, str(tmp_path / f"frame{ending}"))
    sitk.WriteImage(sitk.JoinSeries([frame], 0.0, 2.5), str(tmp_path / f"sequence{ending}"))

    expected, volume = read_volume(tmp_path / f"frame{ending}"), read_volume(tmp_path / f"sequence{ending}")

    np.testing.assert_array_equal(volume.array, ramp((4, 5, 6)))
    np.testing.assert_allclose(volume.geometry.ijk_to_ras, expected.geometry.ijk_to_ras, atol=1e-6)


def test_a_volume_is_never_held_twice_while_it_is_read(tmp_path: Path) -> None:
    sitk.WriteImage(image(ramp((128, 160, 160))), str(tmp_path / "scan.nrrd"))
    # What numpy allocates, that is; the reader needs the volume once.
    assert peak_bytes(lambda: read_volume(tmp_path / "scan.nrrd")) < 0.25 * ramp((128, 160, 160)).nbytes


def test_voxels_stay_when_nothing_but_a_part_of_them_is_kept(tmp_path: Path) -> None:
    sitk.WriteImage(image(ramp((40, 50, 60))), str(tmp_path / "scan.mha"))
    kept = read_volume(tmp_path / "scan.mha").array[10:, ::2].T
    for _ in range(5):
        # Memory that was given back would be used again.
        read_volume(tmp_path / "scan.mha").array[:] = -1
    np.testing.assert_array_equal(kept, ramp((40, 50, 60))[10:, ::2].T)


def test_a_dicom_folder_and_a_nifti_file_of_one_scan_agree(tmp_path: Path, real_volume: Callable[[str], Path]) -> None:
    folder = real_volume("torso_dicom")
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(folder)))
    sitk.WriteImage(reader.Execute(), str(tmp_path / "scan.nii.gz"))

    dicom, nifti = read_volume(folder), read_volume(tmp_path / "scan.nii.gz")

    np.testing.assert_array_equal(dicom.array, nifti.array)
    np.testing.assert_allclose(dicom.geometry.ijk_to_ras, nifti.geometry.ijk_to_ras, atol=1e-3)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (image(ramp((5, 6))), "is a 2D image.* Name the stack"),
        (sitk.JoinSeries([image(ramp((4, 5, 6)))] * 2), "is a 4D image.* time point"),
        (image(np.zeros((4, 5, 6, 3), np.uint8), isVector=True), "3 components"),
        (image(ramp((1, 5, 6))), "at least 2 along every axis"),
        (image(np.full((4, 5, 6), np.nan, np.float32)), "no finite voxel"),
        (image(np.full((4, 5, 6), 7.0, np.float32)), "constant: every finite voxel is 7"),
    ],
)
def test_images_that_are_no_usable_volume_are_refused(tmp_path: Path, content: sitk.Image, message: str) -> None:
    sitk.WriteImage(content, str(tmp_path / "scan.nrrd"))
    with pytest.raises(InputError, match=message):
        read_volume(tmp_path / "scan.nrrd")


@pytest.mark.parametrize("ending", [".nii", ".nii.gz", ".hdr", ".nrrd", ".mha"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_voxels_that_are_no_numbers_are_not_read_as_zeros(tmp_path: Path, ending: str, dtype: type) -> None:
    # More than a chunk, which a gzip's header shifts against the numbers.
    array: np.ndarray = np.random.default_rng(0).normal(size=(40, 90, 100)).astype(dtype)
    for number, value in enumerate((np.nan, np.inf, -np.inf)):
        array.reshape(-1)[number::1001] = value
    sitk.WriteImage(image(array), str(tmp_path / f"scan{ending}"))
    read = read_volume(tmp_path / f"scan{ending}").array
    np.testing.assert_array_equal(np.isfinite(read), np.isfinite(array))
    np.testing.assert_array_equal(read[np.isfinite(array)], array[np.isfinite(array)])


@pytest.mark.parametrize("unit", ["um", "µm", "\u03bcm", "m", "cm", "NM", "micrometers", "metre", "in"])
@pytest.mark.parametrize("field", ["space units", "units", "DistanceUnits"])
def test_sizes_in_other_units_are_not_taken_for_millimetres(tmp_path: Path, field: str, unit: str) -> None:
    with pytest.raises(InputError, match=f"gives its sizes in the unit '{unit}'; expected millimetres"):
        read_volume(written_in_unit(tmp_path, field, unit))


def test_a_unit_in_an_older_encoding_is_recognised(tmp_path: Path) -> None:
    path = written_in_unit(tmp_path, "space units", "µm")
    path.write_bytes(path.read_bytes().replace("µ".encode(), "µ".encode("latin-1")))
    with pytest.raises(InputError, match="in the unit 'µm'"):
        read_volume(path)


@pytest.mark.parametrize("unit", ["mm", "", "millimeters", "MM", "pixel", "?"])
@pytest.mark.parametrize("field", ["space units", "units", "DistanceUnits"])
def test_where_millimetres_or_no_length_is_written_it_is_millimetres(tmp_path: Path, field: str, unit: str) -> None:
    np.testing.assert_allclose(read_volume(written_in_unit(tmp_path, field, unit)).geometry.spacing_mm, [1.0, 1.0, 3.0])


def written_in_unit(folder: Path, field: str, unit: str) -> Path:
    """A file of 1 × 1 × 3 of a unit, which a field of an NRRD or MetaImage header names."""
    scan = stack()
    if field == "DistanceUnits":
        *fields, (last, voxels) = meta_fields(scan).items()
        path = folder / "scan.mha"
        path.write_bytes(meta({**dict(fields), field: unit, last: voxels}, scan.array.tobytes()))
        return path
    header = nrrd_fields(scan) | {field: f'"{unit}" "{unit}" "{unit}"'}
    if field == "units":  # Of axes that have spacings, and no directions in space.
        header = {name: value for name, value in header.items() if not name.startswith("space")} | {"spacings": "1 1 3"}
    path = folder / "scan.nrrd"
    path.write_bytes(nrrd(header, scan.array))
    return path


@pytest.mark.parametrize(
    ("sizes", "directions", "kinds", "advice"),
    [
        ("6 5 4 1", "(1,0,0) (0,1,0) (0,0,1) none", "space space space time", "Choose one channel or time point"),
        ("2 6 5 4", "none (1,0,0) (0,1,0) (0,0,1)", "time space space space", "Choose one channel or time point"),
        ("6 5", "(1,0,0) (0,1,0)", "space space", "Name the stack that it is a slice of"),
    ],
)
def test_axes_of_another_number_than_space_has_are_refused_in_words_for_users(
    tmp_path: Path, sizes: str, directions: str, kinds: str, advice: str
) -> None:
    axes = len(sizes.split())
    header = (
        f"NRRD0005\ntype: uchar\ndimension: {axes}\nspace: left-posterior-superior\nsizes: {sizes}\n"
        f"space directions: {directions}\nkinds: {kinds}\nencoding: raw\nspace origin: (0,0,0)\n\n"
    )
    voxels = math.prod(map(int, sizes.split()))
    (tmp_path / "scan.nrrd").write_bytes(header.encode() + bytes(range(voxels)))
    expected = f"its header has {axes} axes of space or time; expected the 3 of space. {advice}"
    with pytest.raises(InputError, match=re.escape(expected)):
        read_volume(tmp_path / "scan.nrrd")


@pytest.mark.parametrize("space", ["right-anterior-superior-time", "Left-Anterior-Superior-Time", "RAST"])
def test_axes_of_space_and_time_whose_sides_would_be_exchanged_are_refused(tmp_path: Path, space: str) -> None:
    """ITK takes the first one for the one to the left, whatever its name is, as long as there is one of time."""
    with pytest.raises(InputError, match=f"lies in the space '{space}', whose sides would be exchanged"):
        read_volume(of_space_and_time(tmp_path / "scan.nrrd", space))


def test_axes_of_space_and_time_to_the_left_the_back_and_up_lead_there(tmp_path: Path) -> None:
    axes = read_volume(of_space_and_time(tmp_path / "scan.nrrd", "LPST"), pytest.fail).geometry.ijk_to_ras[:3, :3]
    np.testing.assert_allclose(axes, np.diag([-1.0, -1.0, 1.0]))


def of_space_and_time(path: Path, space: str) -> Path:
    """Write an NRRD of one time point in this space."""
    header = (
        f"NRRD0005\ntype: uchar\ndimension: 4\nspace: {space}\nsizes: 6 5 4 1\nencoding: raw\n"
        "space directions: (1,0,0,0) (0,1,0,0) (0,0,1,0) (0,0,0,1)\n\n"
    )
    path.write_bytes(header.encode() + bytes(range(120)))
    return path


def test_a_volume_so_far_away_that_nothing_tells_its_voxels_apart_is_refused(tmp_path: Path) -> None:
    scan = image(ramp((4, 5, 6)))
    scan.SetOrigin([0.0, -1e12, 0.0])
    sitk.WriteImage(scan, str(tmp_path / "scan.nrrd"))
    with pytest.raises(InputError, match=r"lies 1e\+12 mm from the middle"):
        read_volume(tmp_path / "scan.nrrd")


def test_a_compressed_file_without_the_ending_for_it_is_told_which_it_needs(tmp_path: Path) -> None:
    sitk.WriteImage(image(ramp((4, 5, 6))), str(tmp_path / "scan.nii.gz"))
    (tmp_path / "scan.nii.gz").rename(tmp_path / "scan.nii")
    with pytest.raises(InputError, match=r"is compressed; give it the ending \.nii\.gz"):
        read_volume(tmp_path / "scan.nii")


def test_a_grid_without_right_angles_is_refused_in_words_for_users(tmp_path: Path) -> None:
    sitk.WriteImage(image(ramp((4, 5, 6))), str(tmp_path / "scan.nii"))
    content = bytearray((tmp_path / "scan.nii").read_bytes())
    # No qform; an sform in which slices are shifted along the first axis.
    struct.pack_into("<2h", content, 252, 0, 1)
    struct.pack_into("<12f", content, 280, 1, 0, 0.5, 0, 0, 1, 0, 0, 0, 0, 1, 0)
    (tmp_path / "scan.nii").write_bytes(content)
    with pytest.raises(InputError, match="its axes are not at right angles"):
        read_volume(tmp_path / "scan.nii")


@pytest.mark.parametrize("ending", [".nrrd", ".mha"])
def test_slices_that_are_shifted_against_each_other_are_put_on_a_straight_grid(tmp_path: Path, ending: str) -> None:
    scan = image(ramp((4, 5, 6)))
    scan.SetSpacing((1.0, 1.0, 5.0))
    scan.SetDirection((1.0, 0.0, 0.0, 0.0, 1.0, 0.6, 0.0, 0.0, 0.8))
    sitk.WriteImage(scan, str(tmp_path / f"scan{ending}"))
    warnings: list[str] = []

    volume = read_volume(tmp_path / f"scan{ending}", warnings.append)

    # Each is 4 mm above the one before, and three rows behind it.
    assert volume.array.shape == (4, 5 + 9, 6)
    np.testing.assert_allclose(volume.geometry.ijk_to_ras[:3, :3], np.diag([-1.0, -1.0, 4.0]), atol=1e-6)
    for k in range(4):
        np.testing.assert_array_equal(volume.array[k, 3 * k : 3 * k + 5], ramp((4, 5, 6))[k])
    assert ["shifted against each other by up to 9 mm" in warning for warning in warnings] == [True]


def test_what_is_no_image_is_refused(tmp_path: Path) -> None:
    (tmp_path / "scan.nrrd").write_text("no image")
    (tmp_path / "letter.txt").write_text("no image either")
    (tmp_path / "empty").mkdir()
    for name, message in (
        ("scan.nrrd", "cannot be read"),
        ("letter.txt", "of no known format"),
        ("empty", "no DICOM"),
        ("none", "no file"),
    ):
        with pytest.raises(InputError, match=message):
            read_volume(tmp_path / name)


@pytest.mark.parametrize("name", ["study.zip", "Study.ZIP", "study.tar.gz", "study.7z"])
def test_an_archive_is_to_be_unpacked(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"PK\x03\x04")
    with pytest.raises(InputError, match="is an archive"):
        read_volume(tmp_path / name)


def labels_of_two_segments() -> np.ndarray:
    labels = np.zeros((4, 5, 6), dtype=np.uint16)
    labels[1:3, 1:3, 1:4] = 1
    labels[3, 3:, 2:5] = 2
    return labels


@pytest.mark.parametrize("field", ["space directions", "sizes", "kinds"])
def test_an_nrrd_header_with_an_absurdly_long_field_is_refused(tmp_path: Path, field: str) -> None:
    fields = {"type": "short", "dimension": "3", "sizes": "2 2 2", "encoding": "raw", "endian": "little", field: "a" * 3000}
    header = "".join(f"{name}: {value}\n" for name, value in fields.items())
    (tmp_path / "scan.nrrd").write_bytes(f"NRRD0004\n{header}\n".encode() + bytes(16))
    with pytest.raises(InputError, match="3000 characters"):
        read_volume(tmp_path / "scan.nrrd")


NRRD = {"type": "short", "dimension": "3", "sizes": "4 3 2", "encoding": "raw", "endian": "little"}
SPACE = {"space": "left-posterior-superior", "space origin": "(0,0,0)"}
META = {"NDims": "3", "DimSize": "4 3 2", "ElementType": "MET_SHORT"}


def write_with_header(path: Path, fields: dict[str, str]) -> Path:
    nrrd = path.suffix == ".nrrd"
    start, separator, end = ("NRRD0004\n", ": ", "\n") if nrrd else ("", " = ", "ElementDataFile = LOCAL\n")
    lines = "".join(f"{field}{separator}{value}\n" for field, value in ((NRRD if nrrd else META) | fields).items())
    path.write_bytes(f"{start}{lines}{end}".encode() + ramp((2, 3, 4)).tobytes())
    return path


@pytest.mark.parametrize(
    ("ending", "fields"),
    [
        ("nrrd", {}),
        ("nrrd", {"spacings": "nan nan nan"}),
        ("nrrd", {"spacings": "1 1 NaN"}),
        ("nrrd", {"note:=spacings": "1 1 1"}),
        ("mha", {}),
    ],
)
def test_a_file_that_does_not_say_how_large_its_voxels_are_is_warned_of(
    tmp_path: Path, ending: str, fields: dict[str, str]
) -> None:
    warnings: list[str] = []
    volume = read_volume(write_with_header(tmp_path / f"scan.{ending}", fields), warnings.append)
    np.testing.assert_array_equal(volume.geometry.spacing_mm, 1.0)
    assert [text for text in warnings if "does not say how far apart its voxels are: 1 mm is taken" in text]


@pytest.mark.parametrize(
    ("ending", "fields"),
    [
        ("nrrd", {"spacings": "1 1 1"}),
        ("nrrd", {**SPACE, "space directions": "(1,0,0) (0,1,0) (0,0,1)"}),
        ("mha", {"ElementSpacing": "1 1 1"}),
        ("mha", {"ElementSize": "1 1 1"}),
    ],
)
def test_a_file_that_says_how_large_its_voxels_are_is_not_warned_of(
    tmp_path: Path, ending: str, fields: dict[str, str]
) -> None:
    warnings: list[str] = []
    read_volume(write_with_header(tmp_path / f"scan.{ending}", fields), warnings.append)
    assert not [text for text in warnings if "how far apart" in text]


@pytest.mark.parametrize(
    ("ending", "fields", "message"),
    [
        ("nrrd", {**SPACE, "space directions": "(1,0,0) (1,0,0) (0,0,1)"}, "two of its axes have one direction"),
        ("mha", {"TransformMatrix": "1 0 0 1 0 0 0 0 1"}, "two of its axes have one direction"),
        ("nrrd", {**SPACE, "space directions": "(1,0,0) (0,1,0) (0,0,0)"}, "its spacing is 1, 1, 0 mm; expected numbers above"),
        ("nrrd", {"spacings": "1 0 1"}, "its spacing is 0 mm; expected numbers above"),
        ("mha", {"ElementSpacing": "1 1 0"}, "its spacing is 1, 1, 0 mm; expected numbers above"),
    ],
)
def test_axes_that_span_no_space_are_refused_in_words_for_users(
    tmp_path: Path, ending: str, fields: dict[str, str], message: str
) -> None:
    with pytest.raises(InputError, match=f"{message}.*. Save it again from its source"):
        read_volume(write_with_header(tmp_path / f"scan.{ending}", fields))


@pytest.mark.parametrize("ending", [".seg.nrrd", ".nii.gz", ".nrrd"])
def test_a_segmentation_comes_back_as_it_was_written(tmp_path: Path, ending: str) -> None:
    labels, geometry = labels_of_two_segments(), Geometry((4, 5, 6), OBLIQUE_LEFT_HANDED)
    write_segmentation(tmp_path / f"out{ending}", labels, geometry, SEGMENTS)

    read, read_geometry, segments = read_segmentation(tmp_path / f"out{ending}")

    np.testing.assert_array_equal(read, labels)
    np.testing.assert_allclose(read_geometry.ijk_to_ras, geometry.ijk_to_ras, atol=1e-4)
    if ending == ".seg.nrrd":
        assert [segment.name for segment in segments] == [segment.name for segment in SEGMENTS]
        np.testing.assert_allclose([segment.color for segment in segments], [segment.color for segment in SEGMENTS])


def test_slicerio_reads_names_colours_and_voxels(tmp_path: Path) -> None:
    labels, geometry = labels_of_two_segments(), Geometry((4, 5, 6), OBLIQUE_LEFT_HANDED)
    write_segmentation(tmp_path / "out.seg.nrrd", labels, geometry, SEGMENTS)
    content = slicerio.read_segmentation(str(tmp_path / "out.seg.nrrd"))
    # slicerio's reader drops what is not ASCII; Slicer's own, below, does not.
    assert [entry["name"] for entry in content["segments"]] == ["left kidney", "Leber, gro"]
    np.testing.assert_array_equal(content["voxels"], labels.transpose(2, 1, 0))
    np.testing.assert_allclose(content["ijkToLPS"], LPS_TO_RAS @ OBLIQUE_LEFT_HANDED, atol=1e-6)


def test_slicer_itself_reads_the_segmentation_in_its_place(tmp_path: Path) -> None:
    trame_slicer = pytest.importorskip("trame_slicer.core", reason="slicer-core has no wheels for this Python")
    labels, geometry = labels_of_two_segments(), Geometry((4, 5, 6), OBLIQUE_LEFT_HANDED)
    write_segmentation(tmp_path / "out.seg.nrrd", labels, geometry, SEGMENTS)

    app = trame_slicer.SlicerApp()
    node = app.io_manager.load_segmentation(str(tmp_path / "out.seg.nrrd"))

    segmentation = node.GetSegmentation()
    assert [segmentation.GetNthSegment(index).GetName() for index in range(2)] == ["left kidney", "Leber, groß"]
    np.testing.assert_allclose(segmentation.GetNthSegment(1).GetColor(), SEGMENTS[1].color, atol=1e-6)
    for index in range(2):
        centre_ras = geometry.ijk_to_ras_points(np.argwhere(labels == index + 1)[:, ::-1]).mean(axis=0)
        centre = node.GetSegmentCenterRAS(segmentation.GetNthSegmentID(index))
        # Slicer's centre is that of the segment's box of voxels.
        np.testing.assert_allclose(centre, centre_ras, atol=geometry.spacing_mm.max())


def test_labels_of_a_cropped_segmentation_find_their_place_in_the_volume() -> None:
    target = Geometry((6, 8, 10), OBLIQUE_LEFT_HANDED)
    shift = np.eye(4)
    shift[:3, 3] = [3, 2, 1]
    labels = np.random.default_rng(0).integers(0, 3, (4, 5, 6)).astype(np.uint16)
    resampled = resample_labels(labels, Geometry(labels.shape, OBLIQUE_LEFT_HANDED @ shift), target)
    np.testing.assert_array_equal(resampled[1:5, 2:7, 3:9], labels)
    assert (resampled > 0).sum() == (labels > 0).sum()


@pytest.mark.parametrize("name", ["out", "out.png", "out.stl"])
def test_an_unknown_ending_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="no known ending"):
        write_segmentation(tmp_path / name, labels_of_two_segments(), Geometry((4, 5, 6), np.eye(4)), SEGMENTS)
    assert not list(tmp_path.iterdir())


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "out.seg.nrrd").write_text("precious")

    def full_disk(_: sitk.Image, path: str, **__: bool) -> None:
        Path(path).write_text("half")
        raise RuntimeError("ITK ERROR: write failed")

    monkeypatch.setattr(sitk, "WriteImage", full_disk)
    with pytest.raises(InputError, match="Cannot write"):
        write_segmentation(tmp_path / "out.seg.nrrd", labels_of_two_segments(), Geometry((4, 5, 6), np.eye(4)), SEGMENTS)
    assert [path.name for path in tmp_path.iterdir()] == ["out.seg.nrrd"]
    assert (tmp_path / "out.seg.nrrd").read_text() == "precious"


def test_what_lies_at_the_top_of_a_disk_has_a_name_all_the_same() -> None:
    """A patient's disk is D: on Windows."""
    assert _name(Path(Path.cwd().anchor)) == "volume"
