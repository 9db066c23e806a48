"""Where NIfTI files lie, by headers that say it in one way, in two, in none, and in other units."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Testing.attack.scans import nifti, nifti_header
from ViTTransferFunction.Testing.files.test_dicom_series import stack

NO_AXES = np.zeros((3, 4))
FLAT = np.array([[1.0, 0.0, 1.0, 0.0], [0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
HALF_A_TURN = {"qform_code": 1, "quatern": [0.0, 0.0, 1.0], "qoffset": [5.0, 6.0, 7.0]}
METRES, MILLIMETRES, MICROMETRES = 1, 2, 3


def written(folder: Path, **fields: Any) -> Path:
    """A file with 1 × 1 × 3 mm voxels by its `sform`, and with other fields."""
    scan = stack()
    header = nifti_header(scan)
    for name, value in fields.items():
        header[name] = value
    path = folder / "scan.nii"
    path.write_bytes(nifti(header, scan.array))
    return path


@pytest.mark.parametrize(
    "fields",
    [{"sform_code": 0}, {"sform_code": -1}, {"magic": b"", "vox_offset": 0}],
    ids=["none", "below zero", "Analyze"],
)
def test_a_file_that_does_not_say_how_it_lies_is_read_with_a_warning(tmp_path: Path, fields: dict[str, Any]) -> None:
    path = written(tmp_path, **fields)
    if "magic" in fields:
        header = path.rename(tmp_path / "scan.hdr")
        (tmp_path / "scan.img").write_bytes(header.read_bytes()[352:])
        path = header
    warnings: list[str] = []
    volume = read_volume(path, warnings.append)
    np.testing.assert_allclose(volume.geometry.ijk_to_ras[:3, :3], np.diag([-1.0, -1.0, 3.0]))
    assert [f"{path.name} does not say how it lies in the patient" in warning for warning in warnings] == [True]


@pytest.mark.parametrize("axes", [NO_AXES, FLAT], ids=["zeros", "flat"])
def test_a_matrix_without_three_axes_is_refused_for_that(tmp_path: Path, axes: np.ndarray) -> None:
    with pytest.raises(InputError, match=r"does not say where it lies: its header's sform gives its axes as \((0|1), 0, 0\)"):
        read_volume(written(tmp_path, srow=axes))


@pytest.mark.parametrize("axes", [NO_AXES, FLAT], ids=["zeros", "flat"])
def test_where_the_matrix_has_no_three_axes_a_rotation_says_where_it_lies(tmp_path: Path, axes: np.ndarray) -> None:
    volume = read_volume(written(tmp_path, srow=axes, **HALF_A_TURN))
    np.testing.assert_allclose(
        volume.geometry.ijk_to_ras, [[-1, 0, 0, 5], [0, -1, 0, 6], [0, 0, 3, 7], [0, 0, 0, 1]], atol=1e-6
    )


@pytest.mark.parametrize(
    "matrix", [{"sform_code": 0}, {"srow": NO_AXES}, {"sform_code": 2}, {"sform_code": 4}], ids=["no matrix", "zeros", "2", "4"]
)
def test_a_quaternion_that_is_no_rotation_is_refused(tmp_path: Path, matrix: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="the quaternion 1, 0, 1, which is no rotation"):
        read_volume(written(tmp_path, qform_code=1, quatern=[1.0, 0.0, 1.0], **matrix))


def test_a_quaternion_that_is_no_rotation_does_not_matter_beside_a_matrix(tmp_path: Path) -> None:
    volume = read_volume(written(tmp_path, qform_code=1, quatern=[1.0, 0.0, 1.0]))
    np.testing.assert_allclose(volume.geometry.spacing_mm, [1.0, 1.0, 3.0])


@pytest.mark.parametrize(("code", "half_a_turn"), [(1, False), (2, True), (4, True)])
def test_where_matrix_and_rotation_differ_it_lies_where_slicer_shows_it(tmp_path: Path, code: int, half_a_turn: bool) -> None:
    """By the rotation where the matrix leads into an atlas or to another scan."""
    trame_slicer = pytest.importorskip("trame_slicer.core", reason="slicer-core has no wheels for this Python")
    file = written(tmp_path, sform_code=code, **HALF_A_TURN)
    app = trame_slicer.SlicerApp()
    (node,) = app.io_manager.load_volumes(str(file))
    origin = node.GetOrigin()

    volume = read_volume(file)

    np.testing.assert_allclose(volume.geometry.ijk_to_ras[:3, 3], origin, atol=1e-6)
    assert bool(np.allclose(origin, [5.0, 6.0, 7.0])) == half_a_turn


@pytest.mark.parametrize("form", ["sform", "qform"])
@pytest.mark.parametrize(("units", "in_a_millimetre"), [(METRES, 1e-3), (MILLIMETRES, 1.0), (MICROMETRES, 1e3)])
def test_sizes_and_places_in_any_unit_are_read_in_millimetres(
    tmp_path: Path, units: int, in_a_millimetre: float, form: str
) -> None:
    ijk_to_ras = np.array([[1.0, 0.0, 0.0, 50.0], [0.0, 1.0, 0.0, 60.0], [0.0, 0.0, 3.0, 70.0]])
    stored = ijk_to_ras * in_a_millimetre
    fields = {"sform_code": 0, "qform_code": 0, f"{form}_code": 1, "srow": stored, "qoffset": stored[:, 3]}
    spacing = np.diag(stored)
    volume = read_volume(written(tmp_path, xyzt_units=units, pixdim=[1, *spacing, 0, 0, 0, 0], **fields))
    np.testing.assert_allclose(volume.geometry.ijk_to_ras[:3], ijk_to_ras, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize(("units", "in_a_millimetre"), [(METRES, 1e-3), (MILLIMETRES, 1.0)])
def test_of_a_tilted_gantry_that_only_the_matrix_tells_of_there_is_a_warning(
    tmp_path: Path, units: int, in_a_millimetre: float
) -> None:
    """ITK goes by the rotation then, and so does Slicer."""
    slanted = np.array([[-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, -0.9, 0.0], [0.0, 0.0, 3.0, 0.0]]) * in_a_millimetre
    voxel = np.array([1.0, 1.0, 3.0]) * in_a_millimetre
    fields = {"xyzt_units": units, "pixdim": [1, *voxel, 0, 0, 0, 0], "qform_code": 1}
    warnings: list[str] = []
    volume = read_volume(written(tmp_path, srow=slanted, **fields), warnings.append)
    np.testing.assert_allclose(volume.geometry.spacing_mm, [1.0, 1.0, 3.0])
    assert ["shifted against each other by up to 6.3 mm" in warning for warning in warnings] == [True]


@pytest.mark.parametrize(("units", "in_a_millimetre"), [(METRES, 1e-3), (MILLIMETRES, 1.0)])
def test_of_a_rotation_that_leads_elsewhere_than_the_matrix_there_is_a_warning(
    tmp_path: Path, units: int, in_a_millimetre: float
) -> None:
    """As after a registration by SPM, which changes the matrix alone: FSL and nibabel go by that."""
    moved = np.array([[1.0, 0.0, 0.0, 4.0], [0.0, 1.0, 0.0, -3.0], [0.0, 0.0, 3.0, 0.0]]) * in_a_millimetre
    in_place = {"xyzt_units": units, "pixdim": [1, *np.diag(moved), 0, 0, 0, 0], "qform_code": 1, "quatern": [0.0, 0.0, 0.0]}
    warnings: list[str] = []

    read_volume(written(tmp_path, srow=moved, sform_code=2, qoffset=[0.0, 0.0, 0.0], **in_place), warnings.append)

    assert ["two places by its header, up to 5.0 mm apart. It is read by the qform" in text for text in warnings] == [True]
    # Nobody is told where the matrix is gone by, nor where both say the same.
    read_volume(written(tmp_path, srow=moved, sform_code=1, qoffset=[0.0, 0.0, 0.0], **in_place), pytest.fail)
    read_volume(written(tmp_path, srow=moved, sform_code=2, qoffset=moved[:, 3], **in_place), pytest.fail)


@pytest.mark.parametrize(("units", "in_a_millimetre"), [(METRES, 1e-3), (MILLIMETRES, 1.0)])
@pytest.mark.parametrize("codes", [(0, 1), (0, 2), (1, 1)], ids=str)
def test_of_voxels_that_have_two_sizes_there_is_a_warning_that_tells_both(
    tmp_path: Path, codes: tuple[int, int], units: int, in_a_millimetre: float
) -> None:
    """As from programs that write a matrix and leave 1 mm in place of the sizes, by which ITK goes whatever the matrix says."""
    larger = np.array([[0.8, 0.0, 0.0, 4.0], [0.0, 0.8, 0.0, -3.0], [0.0, 0.0, 3.0, 0.0]]) * in_a_millimetre
    sizes = np.array([1.0, 1.0, 3.0]) * in_a_millimetre
    fields = {"xyzt_units": units, "pixdim": [1, *sizes, 0, 0, 0, 0], "qform_code": codes[0], "quatern": [0.0, 0.0, 0.0]}
    warnings: list[str] = []

    volume = read_volume(written(tmp_path, srow=larger, sform_code=codes[1], **fields), warnings.append)

    np.testing.assert_allclose(volume.geometry.spacing_mm, [1.0, 1.0, 3.0], rtol=1e-6)
    told = "voxels of two sizes by its header: 1 × 1 × 3 mm in pixdim, and 0.8 × 0.8 × 3 mm by its sform"
    assert [told in text for text in warnings] == [True]


def test_a_matrix_that_enlarges_a_scan_onto_an_atlas_is_a_second_place_and_no_second_size(tmp_path: Path) -> None:
    onto_atlas = np.array([[1.2, 0.0, 0.0, 0.0], [0.0, 1.2, 0.0, 0.0], [0.0, 0.0, 3.3, 0.0]])
    warnings: list[str] = []
    read_volume(written(tmp_path, srow=onto_atlas, sform_code=4, qform_code=1), warnings.append)
    assert ["two places by its header" in text for text in warnings] == [True]


def test_what_a_header_said_before_the_image_was_moved_and_saved_in_another_format_does_not_count(tmp_path: Path) -> None:
    """ITK writes all of it into NRRD."""
    image = sitk.ReadImage(str(written(tmp_path)))
    assert image.HasMetaDataKey("srow_x")
    image.SetOrigin([50.0, 0.0, 0.0])
    image.SetMetaData("pixdim[1]", "-1")
    sitk.WriteImage(image, str(tmp_path / "moved.nrrd"))
    read_volume(tmp_path / "moved.nrrd", pytest.fail)


@pytest.mark.parametrize("place", [{}, {"sform_code": 0, **HALF_A_TURN}], ids=["matrix", "rotation"])
def test_a_size_below_zero_by_which_a_scan_is_mirrored_is_warned_of(tmp_path: Path, place: dict[str, Any]) -> None:
    warnings: list[str] = []
    straight = read_volume(written(tmp_path, **place), warnings.append)
    assert not warnings
    mirrored = read_volume(written(tmp_path, pixdim=[1, -1, 1, 3, 0, 0, 0, 0], **place), warnings.append)
    np.testing.assert_allclose(mirrored.geometry.ijk_to_ras[:, 0], -straight.geometry.ijk_to_ras[:, 0])
    assert [text for text in warnings if "below zero along i. It is read mirrored there, as 3D Slicer does" in text]
