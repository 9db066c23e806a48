"""Images written where there is no room: told, the old file intact, and nothing else left behind."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.files.segmentation_files import write_image, write_segmentation
from ViTTransferFunction.Testing.support.programs import run

ENDINGS = [".nii", ".nii.gz", ".nrrd", ".seg.nrrd", ".mha"]

NOISE = np.random.default_rng(0).random((20, 30, 40)).astype(np.float32)
"""Does not become much smaller when it is compressed."""

GEOMETRY = Geometry(NOISE.shape, np.diag([1.0, 2.0, 3.0, 1.0]))


@pytest.fixture(scope="module")
def small_disk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A file system of 64 kB."""
    folder = tmp_path_factory.mktemp("disk")
    command = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)]
    if shutil.which("mount") is None or subprocess.run(command, capture_output=True, check=False).returncode != 0:
        pytest.skip("a small file system may not be mounted here")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_full_disk_is_told_and_the_old_file_is_kept(small_disk: Path, ending: str) -> None:
    path = small_disk / f"map{ending}"
    path.write_text("precious")
    with pytest.raises(InputError, match="the disk is full") as refusal:
        write_image(path, NOISE, GEOMETRY)
    assert str(path) in str(refusal.value)
    assert [entry.name for entry in small_disk.iterdir()] == [path.name]
    assert path.read_text() == "precious"
    path.unlink()


LIMITED = """
import resource, signal
from pathlib import Path
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Testing.files.test_full_disk import ENDINGS, GEOMETRY, NOISE, write_image
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))
for ending in ENDINGS:
    path = Path("map" + ending)
    path.write_text("precious")
    try:
        write_image(path, NOISE, GEOMETRY)
        print("written", ending)
    except InputError as error:
        print(error)
"""


def test_a_file_that_may_not_become_so_large_is_told_and_the_old_one_is_kept(tmp_path: Path) -> None:
    pytest.importorskip("resource", reason="Windows knows no such limit")
    lines = run(LIMITED, tmp_path).splitlines()
    assert len(lines) == len(ENDINGS)
    for line, ending in zip(lines, ENDINGS, strict=True):
        assert line.startswith(f"Cannot write map{ending}: the disk is full, or your share of it.")
        assert (tmp_path / f"map{ending}").read_text() == "precious"
    assert len(list(tmp_path.iterdir())) == len(ENDINGS)


@pytest.mark.parametrize("damage", ["cut", "byte", "header"])
@pytest.mark.parametrize("ending", ENDINGS)
def test_what_does_not_read_back_as_it_was_written_does_not_take_the_files_place(
    tmp_path: Path, ending: str, damage: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / f"map{ending}"
    path.write_text("precious")
    write = sitk.WriteImage

    def badly(image: sitk.Image, name: str, useCompression: bool) -> None:
        write(image, name, useCompression=useCompression)
        content = bytearray(Path(name).read_bytes())
        if damage == "byte":
            content[-100] ^= 1
        Path(name).write_bytes({"cut": content[:-40], "byte": content, "header": content[:100]}[damage])

    monkeypatch.setattr(sitk, "WriteImage", badly)
    with pytest.raises(InputError, match="does not give back what was written"):
        write_image(path, NOISE, GEOMETRY)
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
    assert path.read_text() == "precious"


@pytest.mark.parametrize("name", ["OUT.MHA", "Out.NII.GZ", "out.Nii", "OUT.SEG.NRRD"])
def test_an_ending_in_any_case_says_the_format_and_nothing_is_left_beside(tmp_path: Path, name: str) -> None:
    labels = (NOISE > 0.5).astype(np.uint8)
    write_segmentation(tmp_path / name, labels, GEOMETRY, [])
    assert [entry.name for entry in tmp_path.iterdir()] == [name]
    (tmp_path / name).rename(tmp_path / name.lower())
    np.testing.assert_array_equal(sitk.GetArrayFromImage(sitk.ReadImage(str(tmp_path / name.lower()))), labels)


def test_a_format_that_cannot_hold_sheared_axes_is_not_given_them(tmp_path: Path) -> None:
    sheared = np.array([[1.0, 0.5, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    with pytest.raises(InputError, match="its format cannot hold where"):
        write_image(tmp_path / "map.nii.gz", NOISE, Geometry(NOISE.shape, sheared))
    assert not list(tmp_path.iterdir())
