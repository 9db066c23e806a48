"""Image files that were cut off, damaged, misnamed or made up: refused in one sentence, or read as they were named."""

from __future__ import annotations

import gzip
import os
import re
import struct
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.files.segmentation_files import read_segmentation
from ViTTransferFunction.Logic.files.volume_files import read_volume

VOXELS = np.random.default_rng(0).integers(1, 1000, (9, 10, 11)).astype(np.int16)

META_HEADER = "ObjectType = Image\nNDims = 3\nBinaryData = True\nDimSize = 11 10 9\nElementType = MET_SHORT\n"

ENDINGS = [".nii", ".nii.gz", ".hdr", ".mha", ".mhd", ".nrrd", ".nhdr"]


def written(folder: Path, name: str, *, compressed: bool, voxels: np.ndarray = VOXELS) -> Path:
    """An image file as ITK writes it; returns the file that holds the voxels."""
    folder.mkdir(exist_ok=True)
    sitk.WriteImage(sitk.GetImageFromArray(voxels), str(folder / name), useCompression=compressed)
    return max(folder.iterdir(), key=lambda path: path.stat().st_size)


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("ending", ENDINGS)
def test_a_file_that_was_cut_off_is_refused_wherever_it_was_cut(tmp_path: Path, ending: str, compressed: bool) -> None:
    holder = written(tmp_path / "scan", f"scan{ending}", compressed=compressed)
    whole = holder.read_bytes()
    np.testing.assert_array_equal(read_volume(tmp_path / "scan" / f"scan{ending}").array, VOXELS)
    for length in (0, 10, 347, len(whole) // 2, len(whole) - 2):
        holder.write_bytes(whole[:length])
        with pytest.raises(InputError):
            read_volume(tmp_path / "scan" / f"scan{ending}")


@pytest.mark.parametrize("ending", [".nii.gz", ".mha", ".nrrd"])
def test_a_compressed_file_with_a_wrong_byte_is_refused(tmp_path: Path, ending: str) -> None:
    holder = written(tmp_path / "scan", f"scan{ending}", compressed=True)
    content = bytearray(holder.read_bytes())
    content[-200] ^= 0x10
    holder.write_bytes(content)
    with pytest.raises(InputError, match=re.escape(str(holder))):
        read_volume(holder)


def test_what_follows_the_voxels_is_no_damage(tmp_path: Path) -> None:
    holder = written(tmp_path / "scan", "scan.nii", compressed=False)
    content = holder.read_bytes()
    (tmp_path / "longer.nii").write_bytes(content + b"more")
    (tmp_path / "longer.nii.gz").write_bytes(gzip.compress(content + b"more"))
    (tmp_path / "two_streams.nii.gz").write_bytes(gzip.compress(content[:1000]) + gzip.compress(content[1000:]))
    (tmp_path / "not_compressed.nii.gz").write_bytes(content)
    for path in tmp_path.glob("*.nii*"):
        np.testing.assert_array_equal(read_volume(path).array, VOXELS)


def test_a_header_that_promises_more_than_any_disk_holds_is_refused(tmp_path: Path) -> None:
    holder = written(tmp_path / "scan", "scan.nii", compressed=False)
    content = bytearray(holder.read_bytes())
    struct.pack_into("<3h", content, 42, 32767, 32767, 32767)
    holder.write_bytes(content)
    with pytest.raises(InputError, match="is cut off: it holds 1980 of the 70362"):
        read_volume(holder)


@pytest.mark.parametrize(("name", "other"), [("scan.nii.gz", "scan.nii"), ("scan.nii", "scan.nii.gz")])
def test_just_the_named_file_is_read_where_another_has_nearly_its_name(tmp_path: Path, name: str, other: str) -> None:
    for file, voxels in ((name, VOXELS), (other, VOXELS + 1)):
        sitk.WriteImage(sitk.GetImageFromArray(voxels), str(tmp_path / file))
    volume = read_volume(tmp_path / name)
    np.testing.assert_array_equal(volume.array, VOXELS)
    assert volume.name == "scan"


@pytest.mark.parametrize(
    "name", ["SCAN.NII.GZ", "Scan.Nii.gz", "scan.nii.GZ", "S.NII", "S.Nii", "S.MHA", "S.Mha", "S.Seg.Nrrd"]
)
def test_an_ending_is_known_in_any_case(tmp_path: Path, name: str) -> None:
    written(tmp_path / "scan", name.lower(), compressed=True).rename(tmp_path / name)
    np.testing.assert_array_equal(read_volume(tmp_path / name).array, VOXELS)


@pytest.mark.parametrize(("ending", "missing", "what"), [(".hdr", "s.img", "voxels"), (".img", "s.hdr", "header")])
def test_half_of_a_pair_of_files_is_told_what_is_missing(tmp_path: Path, ending: str, missing: str, what: str) -> None:
    sitk.WriteImage(sitk.GetImageFromArray(VOXELS), str(tmp_path / "s.hdr"), imageIO="NiftiImageIO")
    (tmp_path / missing).unlink()
    with pytest.raises(
        InputError, match=rf"s\{ending} has its {what} in another file, {re.escape(missing)}, which is not there"
    ):
        read_volume(tmp_path / f"s{ending}")


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("ElementDataFile = %s%s%s\n", "expected the name of one file"),
        ("ElementDataFile = scan%03d.raw 1 9 1\n", "expected the name of one file"),
        ("ElementDataFile = LIST\nscan.raw\n", "expected the name of one file"),
        ("ElementDataFile = \n", "expected the name of one file"),
        (
            "ElementDataFile = missing.raw\n",
            r"scan\.mha has its voxels in another file, missing\.raw, .* Put both into one folder",
        ),
        ("ElementDataFile = .\n", "is a folder"),
        ("HeaderSize = 10\nElementDataFile = LOCAL\n", "HeaderSize"),
        ("NDims = -1\nElementDataFile = LOCAL\n", "'-1' dimensions"),
        (f"NDims = {'a' * 3000}\nElementDataFile = LOCAL\n", r"'a+\.\.\.a+' dimensions"),
        ("BinaryData = False\nElementDataFile = LOCAL\n", "as text"),
        ("", "no line 'ElementDataFile"),
    ],
)
def test_headers_of_metaimage_that_itk_must_not_see_are_refused(tmp_path: Path, lines: str, message: str) -> None:
    (tmp_path / "scan.mha").write_bytes((META_HEADER + lines).encode() + VOXELS.tobytes())
    with pytest.raises(InputError, match=message):
        read_volume(tmp_path / "scan.mha")


@pytest.mark.parametrize(("header_size", "before"), [("-1", b"before"), ("6", b"before"), ("0", b"")])
def test_a_metaimage_of_two_files_is_read(tmp_path: Path, header_size: str, before: bytes) -> None:
    (tmp_path / "my voxels.raw").write_bytes(before + VOXELS.tobytes())
    lines = f"HeaderSize = {header_size}\r\nElementDataFile = my voxels.raw\r\n"
    (tmp_path / "scan.mhd").write_bytes((META_HEADER + lines).encode())
    np.testing.assert_array_equal(read_volume(tmp_path / "scan.mhd").array, VOXELS)


@pytest.mark.parametrize(
    ("encoding", "message"),
    [
        *((text, "voxels as text") for text in ("ascii", "text", "txt", "hex", "ASCII")),
        *((bzip2, "compressed by bzip2; expected gzip") for bzip2 in ("bzip2", "bz2", "BZ2")),
    ],
)
def test_an_nrrd_whose_voxels_are_text_or_compressed_by_bzip2_is_refused(tmp_path: Path, encoding: str, message: str) -> None:
    header = f"NRRD0004\ntype: short\ndimension: 3\nsizes: 11 10 9\nencoding: {encoding}\nendian: little\n\n"
    (tmp_path / "scan.nrrd").write_bytes(header.encode() + VOXELS.tobytes())
    with pytest.raises(InputError, match=message):
        read_volume(tmp_path / "scan.nrrd")


@pytest.mark.parametrize("name", ["-", "scan%d.raw 1 9 1", "LIST"])
def test_an_nrrd_that_names_anything_but_one_file_is_refused(tmp_path: Path, name: str) -> None:
    header = f"NRRD0004\ntype: short\ndimension: 3\nsizes: 11 10 9\nencoding: raw\nendian: little\ndata file: {name}\n"
    (tmp_path / "scan.nhdr").write_text(header)
    with pytest.raises(InputError, match="expected the name of one file"):
        read_volume(tmp_path / "scan.nhdr")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no pipes among its files")
@pytest.mark.parametrize("kind", ["pipe", "device"])
def test_a_pipe_or_a_device_is_refused_and_not_waited_for(tmp_path: Path, kind: str) -> None:
    special = tmp_path / "special"
    if kind == "pipe":
        os.mkfifo(special)
    else:
        special.symlink_to("/dev/zero")
    header = "NRRD0004\ntype: short\ndimension: 3\nsizes: 11 10 9\nencoding: raw\nendian: little\ndata file: special\n"
    (tmp_path / "names_it.nhdr").write_text(header)
    (tmp_path / "names_it.mhd").write_text(META_HEADER + "ElementDataFile = special\n")
    (tmp_path / "series").mkdir()
    for link in (*(tmp_path / f"scan{ending}" for ending in ENDINGS), tmp_path / "series" / "slice"):
        link.symlink_to(special)
    for path in tmp_path.iterdir():
        with pytest.raises(InputError, match="a pipe, a device or a socket"):
            read_volume(path)
        if not path.is_dir():
            with pytest.raises(InputError, match="a pipe, a device or a socket"):
                read_segmentation(path)


NIFTI_DAMAGE = {
    "spacing 0": (80, "f", 0.0),
    "spacing NaN": (84, "f", float("nan")),
    "qform NaN": (260, "f", float("nan")),
    "sform NaN": (284, "f", float("nan")),
    "sform infinite": (284, "f", float("inf")),
    "size 0": (44, "h", 0),
    "size negative": (42, "h", -5),
    "type unknown": (70, "h", 77),
    "voxels nowhere": (108, "f", float("nan")),
    "half of a pair": (344, "4s", b"ni1\0"),
    "signature": (344, "4s", b"abcd"),
    "length": (0, "i", 349),
    "version 2": (0, "i", 540),
}


@pytest.mark.parametrize("damage", NIFTI_DAMAGE)
def test_a_nifti_header_of_which_itk_would_guess_a_part_is_refused(tmp_path: Path, damage: str) -> None:
    image = sitk.GetImageFromArray(VOXELS)
    image.SetOrigin([1.0, 2.0, 3.0])
    sitk.WriteImage(image, str(tmp_path / "scan.nii"))
    content = bytearray((tmp_path / "scan.nii").read_bytes())
    assert min(struct.unpack_from("<2h", content, 252)) > 0
    offset, kind, value = NIFTI_DAMAGE[damage]
    struct.pack_into("<" + kind, content, offset, value)
    (tmp_path / "scan.nii").write_bytes(content)
    with pytest.raises(InputError, match=re.escape(str(tmp_path / "scan.nii"))):
        read_volume(tmp_path / "scan.nii")


@pytest.mark.parametrize(("kind", "told"), [(128, "holds colours"), (2304, "holds colours"), (32, "holds complex numbers")])
def test_a_nifti_file_of_no_intensities_is_refused_for_what_it_holds(tmp_path: Path, kind: int, told: str) -> None:
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, 3, 11, 10, 9, 1, 1, 1, 1)
    struct.pack_into("<h", header, 70, kind)
    header[344:348] = b"n+1\0"
    (tmp_path / "scan.nii").write_bytes(bytes(header) + bytes(16 * VOXELS.size))
    with pytest.raises(InputError, match=f"{told}; expected one intensity a voxel"):
        read_volume(tmp_path / "scan.nii")


def test_a_nifti_file_with_a_slope_and_of_the_other_byte_order_is_read(tmp_path: Path) -> None:
    header = bytearray(352)
    struct.pack_into(">i", header, 0, 348)
    struct.pack_into(">8h", header, 40, 3, 11, 10, 9, 1, 1, 1, 1)
    struct.pack_into(">2h", header, 70, 4, 16)
    struct.pack_into(">8f", header, 76, 1, 1, 1, 1, 1, 1, 1, 1)
    struct.pack_into(">3f", header, 108, 352, 2, 1)
    header[344:348] = b"n+1\0"
    (tmp_path / "scan.nii").write_bytes(header + VOXELS.astype(">i2").tobytes())
    np.testing.assert_array_equal(read_volume(tmp_path / "scan.nii").array, 2.0 * VOXELS + 1.0)


@pytest.mark.parametrize(
    ("spacing", "message"),
    [(0.0005, "saved in metres"), (1e-5, "saved in metres"), (1e5, "micrometres"), (1e30, "micrometres")],
)
@pytest.mark.parametrize("ending", [".nii", ".nrrd", ".mha"])
def test_a_volume_that_is_not_in_millimetres_is_refused(tmp_path: Path, ending: str, spacing: float, message: str) -> None:
    image = sitk.GetImageFromArray(VOXELS)
    image.SetSpacing([spacing] * 3)
    sitk.WriteImage(image, str(tmp_path / f"scan{ending}"))
    with pytest.raises(InputError, match=message if spacing != 1e-5 else "saved in metres|where it lies"):
        read_volume(tmp_path / f"scan{ending}")


@pytest.mark.parametrize(("spacing", "warned"), [(0.01, True), (0.1, True), (0.2, False)])
def test_a_specimen_under_a_microscope_is_read_and_where_it_may_be_a_body_in_metres_one_is_told(
    tmp_path: Path, spacing: float, warned: bool
) -> None:
    image = sitk.GetImageFromArray(VOXELS)
    image.SetSpacing([spacing] * 3)
    sitk.WriteImage(image, str(tmp_path / "scan.nrrd"))
    warnings: list[str] = []
    volume = read_volume(tmp_path / "scan.nrrd", warnings.append)
    assert volume.geometry.spacing_mm == pytest.approx([spacing] * 3)
    told = [f"scan.nrrd is {11 * spacing:.3g} mm long" in text and "If it was saved in metres" in text for text in warnings]
    assert told == [True] * warned


@pytest.mark.parametrize(("spacing", "warned"), [(200.0, False), (300.0, True), (9000.0, True)])
@pytest.mark.parametrize("ending", [".nii", ".nrrd", ".mha"])
def test_a_scan_longer_than_any_patient_may_be_in_micrometres_and_one_is_told(
    tmp_path: Path, ending: str, spacing: float, warned: bool
) -> None:
    """A tooth of a micro-CT, say, with voxels of 10 µm that were saved as 10: it would be metres long."""
    image = sitk.GetImageFromArray(VOXELS)
    image.SetSpacing([spacing] * 3)
    sitk.WriteImage(image, str(tmp_path / f"scan{ending}"))
    warnings: list[str] = []
    read_volume(tmp_path / f"scan{ending}", warnings.append)
    told = [f"is {11 * spacing:g} mm long" in text and "saved in micrometres" in text for text in warnings]
    assert told == [True] * warned


@pytest.mark.parametrize(
    "vectors",
    ["(nan,0,0) (0,1,0) (0,0,1)", "(0,0,0) (0,1,0) (0,0,1)", "(1,0,0) (1,0,0) (0,0,1)", "(1e400,0,0) (0,1,0) (0,0,1)"],
)
def test_axes_that_lead_nowhere_are_refused(tmp_path: Path, vectors: str) -> None:
    header = "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 11 10 9\n"
    header += f"space directions: {vectors}\nencoding: raw\nendian: little\n\n"
    (tmp_path / "scan.nrrd").write_bytes(header.encode() + VOXELS.tobytes())
    with pytest.raises(InputError, match=re.escape(str(tmp_path / "scan.nrrd"))):
        read_volume(tmp_path / "scan.nrrd")


@pytest.mark.parametrize(
    ("labels", "message"),
    [
        (np.where(VOXELS > 500, np.nan, 1.0), "no whole numbers"),
        (np.where(VOXELS > 500, np.inf, 1.0), "no whole numbers"),
        (VOXELS / 2.0, "no whole numbers"),
        (np.where(VOXELS > 500, -31, 5), "numbers below zero, down to -31"),
        (np.arange(2000).reshape(20, 10, 10).astype(np.int16), "1999 different numbers"),
        (
            np.random.default_rng(0).normal(128, 20, (20, 10, 10)).clip(0, 255).astype(np.uint8),
            "numbers are strewn, as in a scan",
        ),
    ],
)
def test_what_is_no_label_map_is_refused_as_one(tmp_path: Path, labels: np.ndarray, message: str) -> None:
    sitk.WriteImage(sitk.GetImageFromArray(labels), str(tmp_path / "labels.nrrd"))
    with pytest.raises(InputError, match=message):
        read_segmentation(tmp_path / "labels.nrrd")


def test_a_name_too_long_or_of_no_text_is_refused(tmp_path: Path) -> None:
    for name in ("a" * 300 + ".nii", "a\0b.nii"):
        with pytest.raises(InputError):
            read_volume(tmp_path / name)


@pytest.mark.parametrize(
    "extremes", [(-1e308, 1e308), (0.0, 1e39), (-3e38, 3e38), (0.0, 1e-60), (0.0, 1e-36), (1e9, 1e9 + 1e-3)]
)
def test_intensities_that_single_precision_cannot_hold_are_refused(tmp_path: Path, extremes: tuple[float, float]) -> None:
    sitk.WriteImage(sitk.GetImageFromArray(np.where(VOXELS > 500, *extremes)), str(tmp_path / "scan.nrrd"))
    with pytest.raises(InputError, match="single precision"):
        read_volume(tmp_path / "scan.nrrd")
