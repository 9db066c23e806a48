"""DICOM series whose slices are no stack on a grid: refused, or put on one with a word about it."""

from __future__ import annotations

import filecmp
import logging
import shutil
import struct
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from ViTTransferFunction.Logic.core.system import available_memory
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.files.dicom_folder import read_content
from ViTTransferFunction.Logic.files.series_choice import SeveralSeries
from ViTTransferFunction.Logic.files.volume_files import files_of, read_volume
from ViTTransferFunction.Testing.attack.scans import Scan, write_dicom, write_moved_dicom

SAGITTAL = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Axes of a right-handed stack, in columns."""


def stack(slices: int = 8, direction: np.ndarray | None = None, spacing: tuple[float, ...] = (1.0, 1.0, 3.0)) -> Scan:
    array = np.random.default_rng(0).integers(0, 100, (slices, 6, 7)).astype(np.int16)
    return Scan(array, np.array(spacing), np.eye(3) if direction is None else direction, np.zeros(3), ([0] * 3, [0] * 3))


def warnings_of(folder: Path) -> list[str]:
    warnings: list[str] = []
    read_volume(folder, warnings.append)
    return warnings


def write_moved(folder: Path, scan: Scan, step: tuple[float, float, float]) -> None:
    """Write a scan's slices each further away by `step` millimetres than they should be."""
    write_moved_dicom(folder, scan, np.arange(len(scan.array))[:, None] * step)


def change_a_bit(file: Path) -> None:
    """Of its last voxel."""
    content = bytearray(file.read_bytes())
    content[-1] ^= 1
    file.write_bytes(content)


@pytest.mark.parametrize("direction", [np.eye(3), SAGITTAL])
def test_of_a_regular_stack_there_is_nothing_to_say(tmp_path: Path, direction: np.ndarray) -> None:
    write_dicom(tmp_path, stack(direction=direction))
    assert warnings_of(tmp_path) == []


@pytest.mark.parametrize(
    "name", ["liver.seg.nrrd", "Liver.NII.GZ", "view.png", "turn.gif", "turn.mp4", "camera.json", ".DS_Store"]
)
def test_a_file_beside_the_slices_is_none_of_them_and_may_be_written_again(tmp_path: Path, name: str) -> None:
    paths = write_dicom(tmp_path, stack())
    (tmp_path / name).touch()
    assert files_of(tmp_path) == sorted(paths)


def test_slices_of_a_tilted_gantry_lie_where_they_were_taken_and_it_is_said_so(tmp_path: Path) -> None:
    write_moved(tmp_path, stack(), (0.0, 1.0, 0.0))
    warnings: list[str] = []

    volume = read_volume(tmp_path, warnings.append)

    (warning,) = warnings
    assert "shifted against each other by up to 7 mm, as with a tilted gantry" in warning
    assert "straight grid of 1 × 1 × 3 mm" in warning
    taken = stack().array
    for k in range(len(taken)):
        # DICOM's coordinates are LPS.
        points = np.array([[-i, -j - k, 3.0 * k] for j in range(6) for i in range(7)])
        at = tuple(volume.geometry.nearest_voxels(points).T)
        assert volume.array[at].tolist() == taken[k].ravel().tolist()
    assert volume.array.dtype == np.int16


def test_the_same_tilted_series_is_read_to_the_same_bits(tmp_path: Path) -> None:
    write_moved(tmp_path, stack(), (0.3, -0.7, 0.2))
    one, other = read_volume(tmp_path), read_volume(tmp_path)
    np.testing.assert_array_equal(one.array, other.array)
    np.testing.assert_array_equal(one.geometry.ijk_to_ras, other.geometry.ijk_to_ras)


def test_rounded_positions_are_no_shift(tmp_path: Path) -> None:
    write_moved(tmp_path, stack(), (0.0, 0.01, 0.0))
    assert warnings_of(tmp_path) == []


def test_copies_of_slices_are_passed_over(tmp_path: Path) -> None:
    paths = write_dicom(tmp_path / "disk", stack())
    once = read_volume(tmp_path / "disk", pytest.fail)
    shutil.copy(paths[3], tmp_path / "disk" / "again.dcm")
    np.testing.assert_array_equal(read_volume(tmp_path / "disk", pytest.fail).array, once.array)
    shutil.copytree(tmp_path / "disk", tmp_path / "disk copied")
    twice = read_volume(tmp_path, pytest.fail)
    np.testing.assert_array_equal(twice.array, once.array)
    np.testing.assert_array_equal(twice.geometry.ijk_to_ras, once.geometry.ijk_to_ras)


def test_slices_that_were_exported_twice_with_other_headers_are_read_once(tmp_path: Path) -> None:
    """As from two archives, which write their own names into the same slices."""
    write_dicom(tmp_path / "first", stack())
    once = read_volume(tmp_path, pytest.fail)
    write_dicom(tmp_path / "second", stack(), about={"0008|0080": "another hospital"})
    twice = read_volume(tmp_path, pytest.fail)
    np.testing.assert_array_equal(twice.array, once.array)
    np.testing.assert_array_equal(twice.geometry.ijk_to_ras, once.geometry.ijk_to_ras)


@pytest.mark.parametrize(
    "about",
    [{"0008|0018": "1.2.826.0.1.3680043.2.1125.1.3.99"}, {"0008|0018": ""}, {"0018|0081": "4.6"}],
    ids=["other UID", "no UID", "other echo time"],
)
def test_slices_of_equal_pixels_that_may_be_others_are_no_copies(tmp_path: Path, about: dict[str, str]) -> None:
    """As the empty ones at the ends of several echoes are."""
    write_dicom(tmp_path / "first", stack(), about={"0018|0081": "2.3"} | {tag: "" for tag in about if not about[tag]})
    write_dicom(tmp_path / "second", stack(), about={"0018|0081": "2.3", "0008|0080": "another hospital"} | about)
    assert sum(len(series.slices) for series in read_content(tmp_path).series) == 16


def test_of_time_points_none_is_read_to_its_end_to_tell_it_from_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of three hundred, each would be compared with all others at its place."""
    for moment in range(3):
        write_slices(tmp_path, moment=moment)
    monkeypatch.setattr(filecmp, "cmp", lambda *_, **__: pytest.fail("compared"))
    assert [series.part for series in read_content(tmp_path).series] == ["time point 0", "time point 1", "time point 2"]


def test_a_slice_that_is_there_twice_and_not_the_same_is_named(tmp_path: Path) -> None:
    paths = write_dicom(tmp_path, stack())
    change_a_bit(Path(shutil.copy(paths[3], tmp_path / "again.dcm")))
    with pytest.raises(InputError, match=r"two slices at one place: 003\.dcm and again\.dcm"):
        read_volume(tmp_path)


def test_slices_of_another_size_are_named(tmp_path: Path) -> None:
    write_dicom(tmp_path, stack(3))
    smaller = Scan(stack(3).array[:, :5], np.array([1.0, 1.0, 3.0]), np.eye(3), np.array([0.0, 0.0, 9.0]), ([0] * 3, [0] * 3))
    write_dicom(tmp_path, smaller, first=3)
    with pytest.raises(InputError, match=r"000\.dcm with 7×6 and 003\.dcm with 7×5 pixels"):
        read_volume(tmp_path)


def test_slices_whose_pixels_differ_in_size_are_named(tmp_path: Path) -> None:
    """As of two reconstructions in one series; ITK takes the first one's size for all."""
    write_dicom(tmp_path, stack(3))
    larger = Scan(stack(3).array, np.array([2.0, 1.0, 3.0]), np.eye(3), np.array([0.0, 0.0, 9.0]), ([0] * 3, [0] * 3))
    write_dicom(tmp_path, larger, first=3)
    with pytest.raises(InputError, match=r"000\.dcm with 1 × 1 and 003\.dcm with 2 × 1 mm"):
        read_volume(tmp_path)


def test_sizes_of_pixels_may_be_rounded(tmp_path: Path) -> None:
    write_dicom(tmp_path, stack(3))
    rounded = Scan(stack(3).array, np.array([1.0001, 1.0, 3.0]), np.eye(3), np.array([0.0, 0.0, 9.0]), ([0] * 3, [0] * 3))
    write_dicom(tmp_path, rounded, first=3)
    assert warnings_of(tmp_path) == []


@pytest.mark.parametrize("directions", [SAGITTAL, np.diag([-1.0, -1.0, 1.0])], ids=["across", "turned by half"])
def test_slices_in_several_directions_are_no_volume(tmp_path: Path, directions: np.ndarray) -> None:
    write_dicom(tmp_path, stack(3))
    write_dicom(tmp_path, stack(3, directions), first=3)
    with pytest.raises(InputError, match="not parallel"):
        read_volume(tmp_path)


def test_distances_are_those_along_the_stack_whatever_order_the_files_have(tmp_path: Path) -> None:
    for number, path in enumerate(write_dicom(tmp_path, stack())):
        path.rename(tmp_path / f"{(5 * number) % 8}.dcm")
    assert warnings_of(tmp_path) == []
    (tmp_path / "2.dcm").unlink()
    missing, straightened = warnings_of(tmp_path)
    assert "slices seem to be missing between 5.dcm and 7.dcm, which are 6 mm apart" in missing
    assert "lie 3 to 6 mm apart" in straightened


def test_a_series_with_a_missing_slice_is_read_with_a_warning(
    tmp_path: Path, real_volume: Callable[[str], Path], caplog: pytest.LogCaptureFixture
) -> None:
    for index, file in enumerate(sorted(real_volume("torso_dicom").iterdir())):
        if index != 7:
            (tmp_path / file.name).write_bytes(file.read_bytes())
    with caplog.at_level(logging.WARNING):
        read_volume(tmp_path)
    assert "slices seem to be missing" in caplog.text


def test_a_series_whose_last_slice_was_cut_off_is_read_with_a_warning(
    tmp_path: Path, real_volume: Callable[[str], Path], caplog: pytest.LogCaptureFixture
) -> None:
    files = [Path(name) for name in sitk.ImageSeriesReader.GetGDCMSeriesFileNames(str(real_volume("torso_dicom")))]
    for file in files:
        content = file.read_bytes()
        (tmp_path / file.name).write_bytes(content if file != files[-1] else content[:3000])
    with caplog.at_level(logging.WARNING):
        assert read_volume(tmp_path).shape[0] == len(files) - 1
    assert f"without a slice that can be read: 1, such as {files[-1].name}" in caplog.text


def shorten_pixels(file: Path) -> None:
    """As where a program has read a file that was cut off, and written what there was: 8 bytes are missing."""
    content = file.read_bytes()
    tag = content.rindex(b"\xe0\x7f\x10\x00")
    begin = tag + (8 if content[tag + 4 : tag + 6] == b"OW" else 4)
    length = int.from_bytes(content[begin : begin + 4], "little") - 8
    file.write_bytes(content[:begin] + length.to_bytes(4, "little") + content[begin + 4 : -8])


def test_a_slice_with_fewer_pixels_than_it_promises_is_passed_over_with_a_warning(tmp_path: Path) -> None:
    """ITK makes pixels of whatever lies in memory behind them."""
    shorten_pixels(write_dicom(tmp_path, stack())[-1])
    warnings: list[str] = []
    np.testing.assert_array_equal(read_volume(tmp_path, warnings.append).array, stack().array[:-1])
    assert ["without a slice that can be read: 1, such as 007.dcm" in text for text in warnings] == [True]


@pytest.mark.parametrize("alone", [True, False], ids=["a file", "a folder"])
@pytest.mark.parametrize("frames", [True, False], ids=["frames, types explicit", "slice, types implicit"])
def test_where_all_slices_have_too_few_pixels_the_reason_is_said(tmp_path: Path, frames: bool, alone: bool) -> None:
    file = tmp_path / "000.dcm"
    if frames:
        write_frames(file, [0.0, 2.0, 4.0])
    else:
        write_dicom(tmp_path, stack(1))
    shorten_pixels(file)
    with pytest.raises(InputError, match=r"000\.dcm is cut off: it has fewer pixels than its header promises"):
        read_volume(file if alone else tmp_path)


@pytest.mark.parametrize("left", [b"", bytes(100), bytes(3000), None], ids=["nothing", "zeros", "many zeros", "a link"])
@pytest.mark.parametrize("below", ["", "CT"])
def test_a_series_whose_last_slice_was_not_copied_but_by_its_name_is_read_with_a_warning(
    tmp_path: Path, below: str, left: bytes | None
) -> None:
    last = write_slices(tmp_path / below) / "4.dcm"
    last.unlink()
    if left is None:
        last.symlink_to("not_copied/4.dcm")
    else:
        last.write_bytes(left)
    (last.parent / "notes.json").touch()
    warnings: list[str] = []

    assert read_volume(tmp_path, warnings.append).shape[0] == 4

    (warning,) = warnings
    assert f"empty, or links that lead nowhere: 1, such as {last.relative_to(tmp_path)}. If they were slices" in warning


ASCENDING = [0.0, 2.0, 4.0, 6.0, 8.0]
ROUNDED = [0.0, 0.62, 1.25, 1.88, 2.5]
"""Of frames 0.625 mm apart."""
ENHANCED_CT, ULTRASOUND = "1.2.840.10008.5.1.4.1.1.2.1", "1.2.840.10008.5.1.4.1.1.3.1"
OCT = "1.2.840.10008.5.1.4.1.1.77.1.5.4"
AXIAL, CORONAL, A_QUARTER_TURN = "1\\0\\0\\0\\1\\0", "1\\0\\0\\0\\0\\-1", "0\\1\\0\\-1\\0\\0"


def element(group: int, number: int, kind: str, value: bytes | str | int) -> bytes:
    """A data element in explicit little endian."""
    if isinstance(value, int):
        value = struct.pack("<H", value)
    content = value.encode() if isinstance(value, str) else value
    content += (b"\0" if kind == "UI" else b" ") * (len(content) % 2)
    long = kind in ("OB", "OW", "SQ")
    return struct.pack(f"<HH2s{'2xL' if long else 'H'}", group, number, kind.encode(), len(content)) + content


def sequence(group: int, number: int, *items: bytes) -> bytes:
    return element(group, number, "SQ", b"".join(b"\xfe\xff\x00\xe0" + struct.pack("<L", len(item)) + item for item in items))


def write_frames(
    path: Path,
    heights: list[float],
    orientations: list[str] | None = None,
    kind: str = ENHANCED_CT,
    placed: bool = True,
    shift: float = 0.0,
    scales: Sequence[tuple[float, float]] = (),
    pixel_sizes: Sequence[str] = (),
) -> Path:
    """Write an image with a frame at each height, shifted by a share of that, whose stored voxels are ten times as many.

    `scales` has the slope and intercept of each frame, where not all have 1 and 0, and `pixel_sizes` has theirs.
    """
    thickness = element(0x18, 0x50, "DS", "2")
    measures, *own_measures = (
        sequence(0x28, 0x9110, thickness + element(0x28, 0x30, "DS", size)) for size in ("1.5\\1.25", *pixel_sizes)
    )
    frames = [
        sequence(0x20, 0x9113, element(0x20, 0x32, "DS", f"10\\{20 + shift * height}\\{height}"))
        + sequence(0x20, 0x9116, element(0x20, 0x37, "DS", orientation))
        for height, orientation in zip(heights, orientations or [AXIAL] * len(heights), strict=True)
    ]
    for index, scale in enumerate(scales):
        frames[index] += rescaling(*scale)
    for index, measured in enumerate(own_measures):
        frames[index] += measured
    voxels = np.repeat(10 * np.array(heights), 42).astype("<i2").tobytes()
    shared = (b"" if own_measures else measures) + (b"" if scales else rescaling(1, 0))
    functional_groups = [sequence(0x5200, 0x9229, shared), sequence(0x5200, 0x9230, *frames)]
    pixels = pixel_format(len(heights)) + element(0x28, 0x103, "US", 1)
    return write_elements(
        path, kind, "1.2.3", pixels, *functional_groups[: 2 if placed else 1], element(0x7FE0, 0x10, "OW", voxels)
    )


def rescaling(slope: float, intercept: float) -> bytes:
    """How stored numbers become intensities, as functional groups have it."""
    scale = element(0x28, 0x1052, "DS", str(intercept)) + element(0x28, 0x1053, "DS", str(slope))
    return sequence(0x28, 0x9145, scale)


def write_scaled_slice(path: Path, k: int, slope: float) -> Path:
    """Write a slice of PET, whose pixels are stored as 1001."""
    place = element(0x20, 0x32, "DS", f"0\\0\\{2 * k}") + element(0x20, 0x37, "DS", AXIAL)
    scale = element(0x28, 0x103, "US", 1) + element(0x28, 0x1052, "DS", "0") + element(0x28, 0x1053, "DS", str(slope))
    voxels = element(0x7FE0, 0x10, "OW", np.full(42, 1001, "<i2").tobytes())
    return write_elements(path, "1.2.840.10008.5.1.4.1.1.128", f"1.2.3.{k}", place, pixel_format(1), scale, voxels)


def pixel_format(frames: int) -> bytes:
    """Of 7×6 pixels of 16 bits, up to whether they have a sign."""
    numbers = {0x10: 6, 0x11: 7, 0x100: 16, 0x101: 16, 0x102: 15}
    kind = element(0x28, 2, "US", 1) + element(0x28, 4, "CS", "MONOCHROME2") + element(0x28, 8, "IS", str(frames))
    return kind + b"".join(element(0x28, number, "US", value) for number, value in numbers.items())


def write_elements(path: Path, kind: str, name: str, *elements: bytes, about: bytes = b"") -> Path:
    """Write a DICOM file of the elements behind those that say what it is, `about` before all, and of what series."""
    meta = element(2, 2, "UI", kind) + element(2, 3, "UI", name) + element(2, 0x10, "UI", "1.2.840.10008.1.2.1")
    head = about + element(8, 0x16, "UI", kind) + element(8, 0x18, "UI", name) + element(8, 0x60, "CS", "CT")
    series = element(0x20, 0x0D, "UI", "1.2.4") + element(0x20, 0x0E, "UI", "1.2.5")
    content = b"".join((element(2, 0, "UL", struct.pack("<L", len(meta))), meta, head, series, *elements))
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(bytes(128) + b"DICM" + content)
    return path


POSITION, ORIENTATION, PIXEL_SIZE = (0x20, 0x32), (0x20, 0x37), (0x28, 0x30)


def write_slices(
    folder: Path,
    *,
    without: tuple[int, int] | None = None,
    pixel_size: str = "1.5\\1.25",
    orientation: str = AXIAL,
    moment: int = 0,
    kind: str = "1.2.840.10008.5.1.4.1.1.2",
    distance: str = "",
) -> Path:
    """Write five slices of a time point, that lack an element of those that say where their pixels lie."""
    for k in range(5):
        place = {POSITION: f"10\\20\\{2 * k}", ORIENTATION: orientation, PIXEL_SIZE: pixel_size}
        said = {tag: element(*tag, "DS", value) for tag, value in place.items() if tag != without}
        between = element(0x18, 0x88, "DS", distance)
        pixels = pixel_format(1) + said.pop(PIXEL_SIZE, b"") + element(0x28, 0x103, "US", 1)
        voxels = element(0x7FE0, 0x10, "OW", np.arange(k, k + 42, dtype="<i2").tobytes())
        name, time_point = 10 * moment + k, element(0x20, 0x100, "IS", str(moment))
        elements = (between, *said.values(), time_point, pixels, voxels)
        write_elements(folder / f"{name}.dcm", kind, f"1.2.3.{name}", *elements)
    return folder


@pytest.mark.parametrize("given", [{"without": PIXEL_SIZE}, {"pixel_size": "1.5\\0"}])
def test_of_slices_that_do_not_say_how_large_their_pixels_are_there_is_a_warning(tmp_path: Path, given: dict[str, Any]) -> None:
    (warning,) = warnings_of(write_slices(tmp_path / "scan", **given))
    assert "do not say how far apart their pixels are: 1 mm is taken" in warning


def test_pixels_have_the_size_that_slices_say_whatever_kind_they_are_of(tmp_path: Path) -> None:
    """ITK looks elsewhere in those of angiography."""
    volume = read_volume(write_slices(tmp_path / "scan", kind="1.2.840.10008.5.1.4.1.1.12.1"), pytest.fail)
    np.testing.assert_allclose(volume.geometry.spacing_mm, [1.25, 1.5, 2.0])


def test_slices_that_say_they_are_no_distance_apart_are_refused_in_words_for_users(tmp_path: Path) -> None:
    """ITK does not read them, though their positions say better."""
    with pytest.raises(InputError, match=r"its spacing is 1.25, 1.5, 0 mm; expected numbers above 0"):
        read_volume(write_slices(tmp_path / "scan", distance="0"))


def test_pixel_sizes_that_are_no_numbers_are_refused(tmp_path: Path) -> None:
    """ITK takes 1 mm on Linux, and what was in the memory before on Windows."""
    with pytest.raises(InputError, match=r"pixel spacing \(0028,0030\) of its slices is no number"):
        warnings_of(write_slices(tmp_path / "scan", pixel_size="none"))


@pytest.mark.parametrize(
    "given",
    [
        {"without": ORIENTATION},
        {"orientation": "none"},
        {"orientation": "1\\0\\0"},
        {"orientation": "0\\0\\0\\0\\0\\0"},
        {"orientation": "0\\1\\0\\0\\1\\0"},
        {"orientation": "0\\1\\0\\nan\\0\\-1"},
    ],
)
def test_of_slices_that_do_not_say_how_they_are_turned_or_cannot_be_so_there_is_a_warning(
    tmp_path: Path, given: dict[str, Any]
) -> None:
    (warning,) = warnings_of(write_slices(tmp_path / "scan", **given))
    assert "taken for axial ones, as 3D Slicer does, and left and right may be exchanged" in warning


@pytest.mark.parametrize("orientation", ["0.71\\0.71\\0\\-0.71\\0.71\\0", "0.9998\\0.017\\0\\-0.017\\0.9998\\0"])
def test_of_slices_that_say_so_in_rounded_numbers_there_is_none(tmp_path: Path, orientation: str) -> None:
    assert warnings_of(write_slices(tmp_path / "scan", orientation=orientation)) == []


def test_slices_that_do_not_say_where_they_lie_are_no_copies_of_each_other(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"do not say where they lie, such as 0\.dcm or 1\.dcm; expected a position"):
        read_volume(write_slices(tmp_path / "scan", without=POSITION))


@pytest.mark.parametrize("slopes", [[1, 2, 3], [1, 0.25, 0.5]])
def test_a_series_that_memory_has_no_room_for_is_refused_before_its_voxels_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, slopes: list[float]
) -> None:
    for k, slope in enumerate(slopes):
        write_scaled_slice(tmp_path / f"{k}.dcm", k, slope)
    needed = read_volume(tmp_path).array.nbytes
    monkeypatch.setattr(available_memory, "available_memory_bytes", lambda: needed - 1)
    with pytest.raises(InputError, match=r"Opening .* takes at least .* Close other programs"):
        read_volume(tmp_path)
    monkeypatch.setattr(available_memory, "available_memory_bytes", lambda: needed)
    assert read_volume(tmp_path).array.nbytes == needed


@pytest.mark.parametrize("slopes", [[1, 0.25, 0.5], [1, 60, 100], [0.5, 1, 2]])
def test_slices_that_are_scaled_each_in_its_own_way_keep_their_values(tmp_path: Path, slopes: list[float]) -> None:
    for k, slope in enumerate(slopes):
        write_scaled_slice(tmp_path / f"{k}.dcm", k, slope)
    assert read_volume(tmp_path).array[:, 3, 3].tolist() == [1001 * slope for slope in slopes]


@pytest.mark.parametrize("as_folder", [False, True])
@pytest.mark.parametrize("heights", [ASCENDING, ASCENDING[::-1]])
def test_frames_of_one_file_lie_where_they_say(tmp_path: Path, heights: list[float], as_folder: bool) -> None:
    file = write_frames(tmp_path / "scan" / "1.dcm", heights)
    warnings: list[str] = []

    volume = read_volume(file.parent if as_folder else file, warnings.append)

    centres = volume.geometry.ijk_to_ras_points(np.array([[0, 0, k] for k in range(5)]))
    np.testing.assert_allclose(centres, [[-10, -20, height] for height in heights], atol=1e-6)
    assert volume.array[:, 3, 3].tolist() == [10 * height for height in heights]
    assert not warnings


@pytest.mark.parametrize("as_folder", [False, True])
@pytest.mark.parametrize("heights", [ROUNDED, ROUNDED[::-1]])
def test_frames_whose_places_were_rounded_lie_where_they_say(tmp_path: Path, heights: list[float], as_folder: bool) -> None:
    """Of these, ITK loses the spacing, and that they descend: the scan would be its own mirror image."""
    file = write_frames(tmp_path / "scan" / "1.dcm", heights)
    warnings: list[str] = []

    volume = read_volume(file.parent if as_folder else file, warnings.append)

    centres = volume.geometry.ijk_to_ras_points(np.array([[0, 0, k] for k in range(5)]))
    np.testing.assert_allclose(centres, [[-10, -20, height] for height in heights], atol=0.006)
    assert volume.array[:, 3, 3].tolist() == [int(10 * height) for height in heights]
    assert not warnings


@pytest.mark.parametrize("heights", [[0.0, 1.002, 2.0, 3.0, 4.0], [4.0, 3.0, 2.0, 1.002, 0.0], [0.0, 1.0, 2.0, 3.0, 4.0]])
def test_frames_that_are_a_millimetre_apart_have_pixels_of_the_size_that_they_say(tmp_path: Path, heights: list[float]) -> None:
    """A millimetre is what ITK makes of a spacing that it has lost, too."""
    volume = read_volume(write_frames(tmp_path / "1.dcm", heights), pytest.fail)

    np.testing.assert_allclose(volume.geometry.spacing_mm, [1.25, 1.5, 1.0])
    centres = volume.geometry.ijk_to_ras_points(np.array([[0, 0, k] for k in range(5)]))
    np.testing.assert_allclose(centres, [[-10, -20, height] for height in heights], atol=0.006)


@pytest.mark.parametrize("as_folder", [False, True])
@pytest.mark.parametrize(
    ("heights", "orientations"),
    [
        ([4.0, 0.0, 8.0, 2.0, 6.0], None),
        ([0.0, 2.0, 4.0, 0.0, 2.0, 4.0], None),
        ([0.0, 2.0, 4.0, 6.0], [AXIAL, AXIAL, CORONAL, CORONAL]),
    ],
    ids=["in any order", "two phases", "two directions"],
)
def test_frames_that_are_no_stack_are_refused(
    tmp_path: Path, heights: list[float], orientations: list[str] | None, as_folder: bool
) -> None:
    file = write_frames(tmp_path / "scan" / "1.dcm", heights, orientations)
    with pytest.raises(InputError, match="no stack of slices"):
        read_volume(file.parent if as_folder else file)


@pytest.mark.parametrize("heights", [ASCENDING, ASCENDING[::-1]])
def test_frames_of_a_kind_whose_places_itk_passes_over_lie_where_they_say(tmp_path: Path, heights: list[float]) -> None:
    file = write_frames(tmp_path / "1.dcm", heights, [A_QUARTER_TURN] * 5, kind=OCT)

    volume = read_volume(file, pytest.fail)

    centres = volume.geometry.ijk_to_ras_points(np.array([[0, 0, k] for k in range(5)]))
    np.testing.assert_allclose(centres, [[-10, -20, height] for height in heights], atol=1e-6)
    np.testing.assert_allclose(volume.geometry.ijk_to_ras[:3, :2], [[0.0, 1.5], [-1.25, 0.0], [0.0, 0.0]], atol=1e-6)


def test_frames_whose_pixels_differ_in_size_are_refused(tmp_path: Path) -> None:
    file = write_frames(tmp_path / "1.dcm", ASCENDING, pixel_sizes=["1.5\\1.25"] * 4 + ["1.5\\1.5"])
    with pytest.raises(InputError, match="no stack of slices"):
        read_volume(file)


@pytest.mark.parametrize("as_folder", [False, True])
@pytest.mark.parametrize("heights", [[0.0, 2.0, 4.0, 8.0, 10.0], [10.0, 8.0, 4.0, 2.0, 0.0]])
def test_frames_of_which_one_is_missing_lie_where_they_say(tmp_path: Path, heights: list[float], as_folder: bool) -> None:
    """ITK makes a millimetre of all their spacings."""
    file = write_frames(tmp_path / "scan" / "1.dcm", heights)
    warnings: list[str] = []

    volume = read_volume(file.parent if as_folder else file, warnings.append)

    centres = volume.geometry.ijk_to_ras_points(np.array([[0, 0, k] for k in range(6)]))
    full = [*ASCENDING, 10.0][:: 1 if heights[0] == 0.0 else -1]
    np.testing.assert_allclose(centres, [[-10, -20, height] for height in full], atol=1e-6)
    np.testing.assert_allclose(volume.geometry.spacing_mm, [1.25, 1.5, 2.0])
    assert volume.array[:, 3, 3].tolist() == [10 * height for height in full]
    missing, straightened = warnings
    names = "frame 3 and frame 4" if heights[0] == 0.0 else "frame 2 and frame 3"
    assert f"missing between {names}, which are 4 mm apart" in missing
    assert "lie 2 to 4 mm apart" in straightened


def test_frames_of_a_tilted_gantry_lie_where_they_say(tmp_path: Path) -> None:
    file = write_frames(tmp_path / "1.dcm", ASCENDING, shift=0.75)
    warnings: list[str] = []

    volume = read_volume(file, warnings.append)

    pixels = np.array([[-10 - 1.25 * 3, -20 - 0.75 * height - 1.5 * 3, height] for height in ASCENDING])
    assert volume.array[tuple(volume.geometry.nearest_voxels(pixels).T)].tolist() == [10 * height for height in ASCENDING]
    assert ["shifted against each other by up to 6 mm" in warning for warning in warnings] == [True]


@pytest.mark.parametrize("as_folder", [False, True])
@pytest.mark.parametrize(
    "scales",
    [
        [(3, 5), (1, 0), (0.25, -7), (100, 0), (2, 1000)],
        [(2, 0), (1, 0), (3, 0), (2, 0), (2, 0)],
        [(2, 0), (2, 0), (2, -1000), (2, 0), (2, 7)],
    ],
    ids=["both", "slopes", "intercepts"],
)
def test_frames_that_are_scaled_each_in_its_own_way_keep_their_values(
    tmp_path: Path, scales: list[tuple[float, float]], as_folder: bool
) -> None:
    """ITK takes the scale of the first frame for all."""
    file = write_frames(tmp_path / "scan" / "1.dcm", ASCENDING, scales=scales)

    volume = read_volume(file.parent if as_folder else file, pytest.fail)

    expected = [slope * 10 * height + intercept for height, (slope, intercept) in zip(ASCENDING, scales, strict=True)]
    np.testing.assert_allclose(volume.array[:, 3, 3], expected, rtol=1e-6)
    centres = volume.geometry.ijk_to_ras_points(np.array([[0, 0, k] for k in range(5)]))
    np.testing.assert_allclose(centres, [[-10, -20, height] for height in ASCENDING], atol=1e-6)


DEFLATED, BIG_ENDIAN = "1.2.840.10008.1.2.1.99", "1.2.840.10008.1.2.2"


@pytest.mark.parametrize("encoding", [DEFLATED, BIG_ENDIAN])
def test_frames_are_understood_in_every_encoding(tmp_path: Path, encoding: str) -> None:
    """ITK makes a millimetre of all spacings where distances differ, and takes the scale of the first frame for all."""
    scales = [(3, 5), (1, 0), (0.25, -7), (100, 0), (2, 1000)]
    heights = [0.0, 2.0, 4.0, 8.0, 10.0]
    file = recoded(write_frames(tmp_path / "1.dcm", heights, scales=scales), encoding)
    warnings: list[str] = []

    volume = read_volume(file, warnings.append)

    np.testing.assert_allclose(volume.geometry.spacing_mm, [1.25, 1.5, 2.0])
    measured = [slope * 10 * height + intercept for height, (slope, intercept) in zip(heights, scales, strict=True)]
    np.testing.assert_allclose(volume.array[[0, 1, 2, 4, 5], 3, 3], measured, rtol=1e-6)
    assert "missing between frame 3 and frame 4" in warnings[0]
    recoded(write_frames(file, [4.0, 0.0, 8.0, 2.0, 6.0]), encoding)
    with pytest.raises(InputError, match="no stack of slices"):
        read_volume(file)


@pytest.mark.parametrize("as_folder", [False, True])
def test_a_deflated_file_that_memory_has_no_room_for_is_refused_before_itk_unpacks_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, as_folder: bool
) -> None:
    file = recoded(write_frames(tmp_path / "scan" / "1.dcm", ASCENDING), DEFLATED)
    monkeypatch.setattr("ViTTransferFunction.Logic.core.system.available_memory.available_memory_bytes", lambda: 1000)
    with pytest.raises(InputError, match=r"Unpacking .*1\.dcm takes at least"):
        read_volume(file.parent if as_folder else file)


def recoded(file: Path, encoding: str) -> Path:
    """A file that was written in little-endian order, in another encoding."""
    content = file.read_bytes()
    start = 144 + int.from_bytes(content[140:144], "little")
    meta = content[144:start].replace(element(2, 0x10, "UI", "1.2.840.10008.1.2.1"), element(2, 0x10, "UI", encoding))
    packer = zlib.compressobj(wbits=-zlib.MAX_WBITS)
    data = in_big_endian(content[start:]) if encoding == BIG_ENDIAN else packer.compress(content[start:]) + packer.flush()
    file.write_bytes(content[:140] + len(meta).to_bytes(4, "little") + meta + data)
    return file


def in_big_endian(elements: bytes) -> bytes:
    """Data elements, or items of a sequence, in the other order of bytes."""
    written, place = b"", 0
    while place < len(elements):
        group, number, kind = struct.unpack_from("<HH2s", elements, place)
        is_item, is_long = group == 0xFFFE, kind in (b"OB", b"OW", b"SQ")
        written += struct.pack(">HH", group, number) + (b"" if is_item else kind + bytes(2 * is_long))
        place += 4 if is_item else 6 + 2 * is_long
        size = "L" if is_item or is_long else "H"
        (length,) = struct.unpack_from(f"<{size}", elements, place)
        place += struct.calcsize(f"<{size}")
        value = elements[place : place + length]
        place += length
        if is_item or kind == b"SQ":
            value = in_big_endian(value)
        elif kind in (b"US", b"OW"):
            value = np.frombuffer(value, "<u2").astype(">u2").tobytes()
        written += struct.pack(f">{size}", len(value)) + value
    return written


def test_slices_without_the_bytes_before_dicms_letters_are_read(tmp_path: Path) -> None:
    """As some programs send them."""
    scan = stack()
    for file in write_dicom(tmp_path, scan):
        file.write_bytes(file.read_bytes()[132:])
    np.testing.assert_array_equal(read_volume(tmp_path, pytest.fail).array, scan.array)


@pytest.mark.parametrize("as_folder", [False, True])
def test_of_a_scan_that_itk_inverts_there_is_a_warning(tmp_path: Path, as_folder: bool) -> None:
    file = write_frames(tmp_path / "scan" / "1.dcm", ASCENDING)
    file.write_bytes(file.read_bytes().replace(b"MONOCHROME2", b"MONOCHROME1"))
    warnings: list[str] = []

    volume = read_volume(file.parent if as_folder else file, warnings.append)

    assert (np.diff(volume.array[:, 3, 3]) < 0).all()
    assert ["(MONOCHROME1), and is read inverted, as 3D Slicer does" in warning for warning in warnings] == [True]


def test_frames_of_one_scale_keep_their_type(tmp_path: Path) -> None:
    file = write_frames(tmp_path / "1.dcm", ASCENDING, scales=[(2, 0)] * 5)
    volume = read_volume(file, pytest.fail)
    assert volume.array[:, 3, 3].tolist() == [20 * height for height in ASCENDING]
    assert volume.array.dtype.kind == "i"


def test_frames_of_which_not_all_have_a_scale_are_refused_where_scales_differ(tmp_path: Path) -> None:
    file = write_frames(tmp_path / "1.dcm", ASCENDING, scales=[(2, 0), (1, 0), (3, 0)])
    with pytest.raises(InputError, match="does not say of each of its 5 frames how it is scaled"):
        read_volume(file)


def test_of_frames_that_do_not_say_where_they_lie_there_is_a_warning(tmp_path: Path) -> None:
    write_frames(tmp_path / "1.dcm", ASCENDING, kind=ULTRASOUND, placed=False)
    assert ["do not say where they lie" in warning for warning in warnings_of(tmp_path)] == [True]


def test_of_several_files_of_several_frames_each_is_a_volume(tmp_path: Path) -> None:
    """As time points of Siemens' and Philips' MR are."""
    for number in (1, 2, 3):
        write_frames(tmp_path / f"{number}.dcm", [height + number for height in ASCENDING])

    with pytest.raises(SeveralSeries) as several:
        read_volume(tmp_path)

    assert several.value.lines == tuple(f"without a name, file {number}.dcm (CT, 7×6×5)" for number in (1, 2, 3))
    for number, line in zip((1, 2, 3), several.value.lines, strict=True):
        volume = read_volume(tmp_path, pytest.fail, line)
        assert volume.array[:, 3, 3].tolist() == [10 * (height + number) for height in ASCENDING]


def test_of_slices_that_say_where_they_lie_as_frames_do_there_is_no_warning(tmp_path: Path) -> None:
    """Of enhanced images, with a single frame each."""
    for height in ASCENDING:
        write_frames(tmp_path / f"{height:.0f}.dcm", [height], [A_QUARTER_TURN])

    volume = read_volume(tmp_path, pytest.fail)

    axes = np.array([[0.0, 1.5, 0.0], [-1.25, 0.0, 0.0], [0.0, 0.0, 2.0]])
    np.testing.assert_allclose(volume.geometry.ijk_to_ras[:3, :3], axes, atol=1e-6)


def test_of_two_such_slices_at_one_place_it_is_the_place_that_is_wrong(tmp_path: Path) -> None:
    for name, height in {"a": 0.0, "b": 2.0, "c": 4.0, "copy of b": 2.0}.items():
        write_frames(tmp_path / f"{name}.dcm", [height])
    change_a_bit(tmp_path / "copy of b.dcm")
    with pytest.raises(InputError, match=r"has two slices at one place: b\.dcm and copy of b\.dcm"):
        read_volume(tmp_path)


def test_beside_a_file_of_several_frames_a_scout_of_its_series_is_passed_over(tmp_path: Path) -> None:
    write_frames(tmp_path / "1.dcm", ASCENDING)
    write_scaled_slice(tmp_path / "2.dcm", 0, 1.0)
    (warning,) = warnings_of(tmp_path)
    assert "file 1.dcm (CT, 7×6×5) is read; passed over, since they are no volumes: without a name (CT, 7×6×1)" in warning


def test_an_enhanced_image_that_lacks_what_it_must_have_is_refused(tmp_path: Path) -> None:
    write_frames(tmp_path / "1.dcm", ASCENDING, placed=False)
    with pytest.raises(InputError, match="cannot be read"):
        read_volume(tmp_path)
