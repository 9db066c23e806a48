"""Sessions as files: what is saved comes back, and what is no session is refused."""

from __future__ import annotations

import errno
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

pytest.importorskip("trame_slicer")

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Testing.support.scenes import add_parameter_node, add_volume
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras
from ViTTransferFunction.WebApp import packing, scene_files


def archive(path: Path, **files: str) -> Path:
    with zipfile.ZipFile(path, "w") as written:
        for name, text in files.items():
            written.writestr(name, text)
    return path


def reopened(app: Any, path: Path, folder: Path) -> SceneSession:
    folder.mkdir()
    app.scene.Clear(0)
    scene_files.import_scene(app.scene, scene_files.unpacked_session(path, folder))
    return SceneSession(app.scene, app.app_logic, scene_files.parameter_node(app.scene))


def file_names(scene: Any) -> list[str | None]:
    """Of all that can be stored."""
    count = scene.GetNumberOfNodesByClass("vtkMRMLStorageNode")
    return [scene.GetNthNodeByClass(index, "vtkMRMLStorageNode").GetFileName() for index in range(count)]


def test_a_session_holds_no_file_whose_name_windows_refuses(slicer_app: Any, tmp_path: Path) -> None:
    session = SceneSession(slicer_app.scene, slicer_app.app_logic, scene_files.parameter_node(slicer_app.scene))
    names = ["a:b", "q?", "q*", "p|e", "b\\s", 'qu"ote', "<5 mm>", "L/2", "100 %", "CON", "dot.", "肝 ü"]
    for name in names:
        added = session.annotations.add_class(name)
        session.annotations.add_points(added.id, np.zeros((1, 3)), positive=True)
    session.close()
    scene_files.stage_session(slicer_app.scene, tmp_path / "session")
    assert set(file_names(slicer_app.scene)) == {None}
    written = [path.name for path in (tmp_path / "session" / "Data").iterdir()]
    assert len(written) >= len(names)
    assert [name for name in written if set(name) & set('<>:"|?*\\') or name.startswith("CON.")] == []
    packing.zip_folder(tmp_path / "session", tmp_path / "session.mrb")
    again = reopened(slicer_app, tmp_path / "session.mrb", tmp_path / "unpacked")
    assert [state.name for state in again.classes] == names
    assert all(len(state.positive) == 1 for state in again.classes)


@pytest.mark.parametrize("add_node", [scene_files.parameter_node, add_parameter_node], ids=["here", "in Slicer"])
def test_a_saved_session_comes_back_with_its_volume_structures_and_settings(
    slicer_app: Any, spheres: Spheres, tmp_path: Path, add_node: Callable[[Any], Any]
) -> None:
    session = SceneSession(slicer_app.scene, slicer_app.app_logic, add_node(slicer_app.scene))
    session.set_volume(add_volume(slicer_app.scene, spheres[0]))
    added = session.annotations.add_class("Ball <b>{{ 1 }}</b>", (0.2, 0.4, 0.6))
    session.annotations.add_points(added.id, centre_ras(spheres, 1), positive=True)
    session.annotations.set_class(added.id, proximity=0.25)
    session.parameters.set("rendering", "transfer function")
    before, voxels = session.classes, spheres[0].array
    session.close()
    scene_files.stage_session(slicer_app.scene, tmp_path / "session")
    packing.zip_folder(tmp_path / "session", tmp_path / "session.mrb")
    again = reopened(slicer_app, tmp_path / "session.mrb", tmp_path / "unpacked")
    (state,) = again.classes
    assert (state.id, state.name, state.proximity) == (added.id, before[0].name, 0.25)
    np.testing.assert_allclose(state.positive, before[0].positive, atol=1e-3)
    assert again.parameters.get("rendering") == "transfer function"
    volume = again.parameters.volume
    assert volume is not None
    assert volume.GetImageData().GetDimensions() == voxels.shape[::-1]
    again.close()


def test_voxels_are_not_compressed_where_the_page_stands_still_and_slicer_compresses_them_again(
    slicer_app: Any, spheres: Spheres, tmp_path: Path
) -> None:
    node = add_volume(slicer_app.scene, spheres[0])
    scene_files.stage_session(slicer_app.scene, tmp_path / "session")
    (voxels,) = (tmp_path / "session" / "Data").glob("*.nrrd")
    assert b"encoding: raw\n" in voxels.read_bytes()[:2000]
    assert node.GetStorageNode().GetUseCompression()
    packing.zip_folder(tmp_path / "session", tmp_path / "session.mrb")
    assert not voxels.exists()
    (tmp_path / "unpacked").mkdir()
    slicer_app.scene.Clear(0)
    scene_files.import_scene(slicer_app.scene, scene_files.unpacked_session(tmp_path / "session.mrb", tmp_path / "unpacked"))
    again = slicer_app.scene.GetFirstNodeByClass("vtkMRMLScalarVolumeNode")
    assert again.GetStorageNode().GetUseCompression()


@pytest.mark.parametrize("cut_off", [True, False], ids=["Slicer's own writing", "writing it again"])
def test_a_disk_that_is_full_when_the_scene_itself_is_written_is_told(
    slicer_app: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cut_off: bool
) -> None:
    def full(scene_file: Path) -> None:
        if not cut_off:
            raise OSError(errno.ENOSPC, "No space left on device")
        scene_file.write_bytes(scene_file.read_bytes()[:1000])

    monkeypatch.setattr(scene_files, "_escape_ampersands", full)
    with pytest.raises(InputError, match=r"could not be saved\. Make room"):
        scene_files.stage_session(slicer_app.scene, tmp_path / "session")


def test_voxels_of_more_bytes_than_plain_archives_take_are_packed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module, name in ((zipfile, "ZIP64_LIMIT"), (packing, "_ZIP64_BYTES")):
        monkeypatch.setattr(module, name, 1000)  # Two gigabytes, but for the time that they take.
    (tmp_path / "session").mkdir()
    (tmp_path / "session" / "CT.nrrd").write_bytes(b"voxels" * 1000)
    packing.zip_folder(tmp_path / "session", tmp_path / "session.mrb")
    with zipfile.ZipFile(tmp_path / "session.mrb") as archive:
        assert archive.read("session/CT.nrrd") == b"voxels" * 1000


def test_packing_a_segmentation_keeps_its_voxels_and_segments(tmp_path: Path) -> None:
    voxels = np.zeros((30, 40, 50), dtype=np.uint8)
    voxels[10:20, 10:20, 10:20] = 3
    image = sitk.GetImageFromArray(voxels)
    image.SetMetaData("Segment0_Name", "ball")
    sitk.WriteImage(image, str(tmp_path / "raw.seg.nrrd"), useCompression=False)
    seen: list[tuple[int, int]] = []
    packing.gzip_nrrd(
        tmp_path / "raw.seg.nrrd", tmp_path / "packed.seg.nrrd", lambda done, total, _: seen.append((done, total))
    )
    assert seen[-1] == ((tmp_path / "raw.seg.nrrd").stat().st_size,) * 2
    again = sitk.ReadImage(str(tmp_path / "packed.seg.nrrd"))
    np.testing.assert_array_equal(sitk.GetArrayFromImage(again), voxels)
    assert again.GetMetaData("Segment0_Name") == "ball"
    assert (tmp_path / "packed.seg.nrrd").stat().st_size < voxels.size / 20


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.uint32, np.float64])
def test_segments_whose_last_voxels_found_no_room_on_the_disk_are_not_packed(tmp_path: Path, dtype: type[np.generic]) -> None:
    raw, packed = tmp_path / "raw.seg.nrrd", tmp_path / "packed.seg.nrrd"
    sitk.WriteImage(sitk.GetImageFromArray(np.ones((3, 4, 5), dtype)), str(raw), useCompression=False)
    packing.gzip_nrrd(raw, packed)
    raw.write_bytes(raw.read_bytes()[:-1])
    with pytest.raises(OSError, match="No space left"):
        packing.gzip_nrrd(raw, tmp_path / "again.seg.nrrd")


def test_the_parameter_node_is_made_once(slicer_app: Any) -> None:
    assert scene_files.parameter_node(slicer_app.scene) is scene_files.parameter_node(slicer_app.scene)


@pytest.mark.parametrize(
    ("files", "why"),
    [
        ({"a/../../evil.mrml": "<MRML/>"}, "outside"),
        ({"..\\evil.mrml": "<MRML/>"}, "outside"),
        ({"readme.txt": "no scene"}, "no scene"),
        ({"scene.mrml": "<MRML><not closed></MRML>"}, "damaged"),
        ({"scene.mrml": '<MRML><VolumeArchetypeStorage uri="http://elsewhere/ct.nrrd"/></MRML>'}, "network"),
        ({"scene.mrml": '<MRML><VolumeArchetypeStorage fileName="/home/other/ct.nrrd"/></MRML>'}, "outside"),
        ({"scene.mrml": '<MRML><VolumeArchetypeStorage fileName="Data/../../ct.nrrd"/></MRML>'}, "outside"),
        ({"scene.mrml": '<MRML><VolumeArchetypeStorage fileName="C:/ct.nrrd"/></MRML>'}, "outside"),
        ({"scene.mrml": r'<MRML><VolumeArchetypeStorage fileListMember0="\\server\ct.nrrd"/></MRML>'}, "outside"),
    ],
)
def test_what_is_no_session_or_reaches_out_is_refused(files: dict[str, str], why: str, tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "unpacked"
    folder.mkdir(parents=True)
    with pytest.raises(InputError, match=why):
        scene_files.unpacked_session(archive(tmp_path / "session.mrb", **files), folder)
    assert not list(tmp_path.rglob("evil*"))


NRRD, META_IMAGE = "NRRD0004\ntype: short\ndimension: 3\n", "ObjectType = Image\nNDims = 3\n"


@pytest.mark.parametrize(
    ("name", "header"),
    [
        ("ct.nrrd", f"{NRRD}data file: /etc/hostname\n"),
        ("ct.nrrd", f"{NRRD}content: {'x' * (1 << 20)}\nDataFile: ../../secret.raw\n\n"),
        ("ct.nrrd", f"{NRRD}data file: /home/other/%03d.raw 1 9 1\n"),
        ("ct.nrrd", f"{NRRD}data file: LIST\n/etc/hostname\n"),
        ("ct.nrrd", f"{NRRD}data file: -\n"),
        ("ct.seg.nrrd", f"{NRRD}data file: C:\\secret.raw\n"),
        ("ct.of_no_ending", f"{NRRD}data file: /etc/hostname\n"),
        ("CT.MHD", f"{META_IMAGE}ElementDataFile = /etc/hostname\n"),
        ("ct.mha", f"{META_IMAGE}ElementDataFile = LIST\n/etc/hostname\n"),
    ],
)
def test_a_session_whose_images_have_their_voxels_elsewhere_is_refused(name: str, header: str, tmp_path: Path) -> None:
    """Any file of the computer would be opened, and saved with the session."""
    session = archive(tmp_path / "session.mrb", **{"s/scene.mrml": "<MRML/>", f"s/Data/{name}": header})
    (tmp_path / "unpacked").mkdir()
    with pytest.raises(InputError, match=rf"outside of it \('{name}'"):
        scene_files.unpacked_session(session, tmp_path / "unpacked")


def test_a_session_whose_images_have_their_voxels_beside_them_is_opened(tmp_path: Path) -> None:
    headers = {"a.nhdr": f"{NRRD}data file: a.raw\n", "b.mhd": f"{META_IMAGE}ElementDataFile = b.raw\n", "c.nrrd": f"{NRRD}\n"}
    files = {f"s/Data/{name}": header for name, header in headers.items()}
    session = archive(tmp_path / "session.mrb", **{"s/scene.mrml": "<MRML/>", **files, "s/Data/a.raw": "", "s/Data/b.raw": ""})
    (tmp_path / "unpacked").mkdir()
    assert scene_files.unpacked_session(session, tmp_path / "unpacked").name == "scene.mrml"


def test_a_session_that_unpacks_to_more_than_fits_is_refused_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scene_files, "LARGEST_SCENE", 1000)
    folder = tmp_path / "unpacked"
    folder.mkdir()
    with pytest.raises(InputError, match="open its volume"):
        scene_files.unpacked_session(archive(tmp_path / "bomb.mrb", **{"scene.mrml": " " * 1001}), folder)
    assert not list(folder.iterdir())


def damaged_within(path: Path) -> None:
    """An archive whose list of files is as it should be, and the compressed content of one is not."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as written:
        written.writestr("scene.mrml", "<MRML>" + "ab" * 1000 + "</MRML>")
    content = bytearray(path.read_bytes())
    start = 30 + len("scene.mrml")
    content[start : start + 4] = b"\xff" * 4
    path.write_bytes(content)


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda path: None, "There is no file"),
        (lambda path: path.mkdir(), "is a folder"),
        (damaged_within, "damaged"),
        (lambda path: archive(path, **{"scene.mrml": '<?xml version="1.0" encoding="shift-jis"?><MRML/>'}), "damaged"),
        (lambda path: archive(path, **{"scene.mrml": '<?xml version="1.0" encoding="of-none"?><MRML/>'}), "damaged"),
        (lambda path: archive(path, **{"x" * 300: "", "scene.mrml": "<MRML/>"}), "could not be unpacked to"),
    ],
)
def test_whatever_is_wrong_with_a_session_is_said_in_a_sentence(make: Callable[[Path], Any], why: str, tmp_path: Path) -> None:
    make(tmp_path / "session.mrb")
    (tmp_path / "unpacked").mkdir()
    with pytest.raises(InputError, match=why):
        scene_files.unpacked_session(tmp_path / "session.mrb", tmp_path / "unpacked")


def test_a_file_that_is_no_archive_is_refused(tmp_path: Path) -> None:
    (tmp_path / "session.mrb").write_bytes(b"PK no archive at all")
    with pytest.raises(InputError, match="no session"):
        scene_files.unpacked_session(tmp_path / "session.mrb", tmp_path)
