"""Files as browsers send them, and as nobody should, over real sockets."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Sequence
from pathlib import Path, PurePosixPath

import pytest

pytest.importorskip("aiohttp")
from aiohttp import web
from aiohttp.test_utils import TestClient, TestServer

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Testing.support.disks import set_free_space
from ViTTransferFunction.WebApp import uploads

DICOM = b"\0" * 128 + b"DICM" + b"slice"
NRRD = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 1 1 1\nencoding: raw\n\n\0"
BOUNDARY = "----edge"


def body(files: Sequence[tuple[str, bytes]]) -> bytes:
    """What a browser sends for `files`: names and contents."""
    parts = []
    for name, content in files:
        quoted = name.replace("\\", "\\\\")
        head = f'--{BOUNDARY}\r\nContent-Disposition: form-data; name="files"; filename="{quoted}"\r\n\r\n'
        parts.append(head.encode(errors="surrogateescape"))
        parts.append(content + b"\r\n")
    return b"".join(parts) + f"--{BOUNDARY}--\r\n".encode()


Send = Callable[..., list[Path] | str]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "uploads"
    path.mkdir()
    return path


@pytest.fixture
def send(folder: Path) -> Send:
    """Sends files to `folder`; returns the paths that they were received at, or the message that refuses them."""

    def deliver(*files: tuple[str, bytes], data: bytes | None = None, content_type: str | None = None) -> list[Path] | str:
        outcome: list[list[Path] | str] = []

        async def receive(request: web.Request) -> web.Response:
            try:
                outcome.append(await uploads.receive_files(request, folder))
            except InputError as error:
                outcome.append(str(error))
            return web.Response()

        async def exchange() -> None:
            app = web.Application()
            app.router.add_post("/upload", receive)
            headers = {"Content-Type": content_type or f"multipart/form-data; boundary={BOUNDARY}"}
            async with TestClient(TestServer(app)) as client:
                await client.post("/upload", data=body(files) if data is None else data, headers=headers)

        asyncio.run(exchange())
        return outcome[0]

    return deliver


def refused(outcome: list[Path] | str, folder: Path) -> str:
    """The message of a refusal, of which nothing is left."""
    assert isinstance(outcome, str)
    assert not list(folder.iterdir())
    return outcome


def meta_header(voxels: str) -> bytes:
    """A header whose voxels are in a file named `voxels`."""
    return f"ObjectType = Image\nNDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\nElementDataFile = {voxels}\n".encode()


def test_files_arrive_whole_under_their_names(send: Send, folder: Path) -> None:
    voxels = bytes(range(256)) * 20_000
    header = meta_header("scan.raw")
    assert send(("scan.mhd", header), ("scan.raw", voxels)) == [folder / "scan.mhd", folder / "scan.raw"]
    assert (folder / "scan.raw").read_bytes() == voxels


@pytest.mark.parametrize("voxels", ["scan.dat", "scan", "scan.bin"])
def test_voxels_may_have_any_name_that_their_header_says(send: Send, folder: Path, voxels: str) -> None:
    sent = [(voxels, bytes(8)), ("scan.mhd", meta_header(voxels))]
    assert send(*sent) == [folder / voxels, folder / "scan.mhd"]
    assert (folder / voxels).read_bytes() == bytes(8)


def test_if_a_header_names_other_voxels_than_were_sent_those_are_asked_for(send: Send, folder: Path) -> None:
    message = refused(send(("scan.mhd", meta_header("scan.dat")), ("renamed.dat", bytes(8))), folder)
    assert "scan.mhd has its voxels in another file, scan.dat, which is not there." in message
    assert "Put both into one folder" in message


@pytest.mark.parametrize(
    ("name", "kept"),
    [("../../escaped.raw", "escaped.raw"), ("/etc/cron.d/job.raw", "job.raw"), ("..\\..\\windows.raw", "windows.raw"),
     ("C:\\scan.raw", "scan.raw"), ("folder/scan.raw", "scan.raw"), (".bashrc.raw", "bashrc.raw"), ("-rf.raw", "rf.raw"),
     ("a b;$(c)`d`.raw", "a b;$(c)`d`.raw"), ("na\u0308me\u202e.raw", "näme_.raw"), ("con.raw", "_con.raw"),
     ("nul.raw", "_nul.raw"), ("x" * 300 + ".raw", "x" * 196 + ".raw"),
     ("Schädel-CT (Müller) 肝.raw", "Schädel-CT (Müller) 肝.raw"), ("肝" * 300 + ".raw", "肝" * 65 + ".raw"),
     ("com².raw", "_com².raw"), ("scan.raw... ", "scan.raw"), ("Sch\udce4del.raw", "Sch_del.raw"),
     ("%2e%2e%2fscan.raw", "%2e%2e%2fscan.raw"), ('<scan>:"1"?*|.raw', "_scan___1____.raw")],
)  # fmt: skip
def test_names_lead_nowhere_and_stay_harmless(send: Send, folder: Path, name: str, kept: str) -> None:
    received = send((name, b"voxels"))[0]
    assert isinstance(received, Path)
    assert received.parent == folder
    assert received.name == kept
    assert [path for path in folder.parent.rglob("*") if path.is_file()] == [received]


@pytest.mark.parametrize("name", ["..", ".", "/", "...", ""])
def test_names_that_are_none_are_passed_over_or_replaced(send: Send, folder: Path, name: str) -> None:
    outcome = send((name, DICOM))
    inside = [path for path in folder.iterdir() if path.is_file()]
    assert outcome in ("No file was sent.", inside)
    assert [path for path in folder.parent.rglob("*") if path.is_file()] == inside


def test_nothing_is_overwritten_and_slices_of_equal_names_all_arrive(send: Send, folder: Path) -> None:
    first = send(("a/IM1", DICOM + b"1"), ("b/IM1", DICOM + b"2"))
    second = send(("c/IM1", DICOM + b"3"))
    assert [path.name for path in (*first, *second) if isinstance(path, Path)] == ["IM1", "IM1-2", "IM1-3"]
    assert [(folder / name).read_bytes()[-1:] for name in ("IM1", "IM1-2", "IM1-3")] == [b"1", b"2", b"3"]


@pytest.mark.skipif(os.name == "nt", reason="Windows lets few users make links")
def test_a_link_at_the_place_of_a_file_is_not_followed(send: Send, folder: Path, tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_bytes(b"mine")
    (folder / "scan.raw").symlink_to(precious)
    send(("scan.raw", b"theirs"))
    assert precious.read_bytes() == b"mine"


def test_points_beside_slices_are_passed_over_and_by_themselves_they_are_kept(send: Send) -> None:
    series = send(("s/IM1", DICOM), ("s/annotations.json", b"{}"))
    assert [path.name for path in series if isinstance(path, Path)] == ["IM1"]
    alone = send(("scan.annotations.json", b"{}"))
    assert [path.name for path in alone if isinstance(path, Path)] == ["scan.annotations.json"]


@pytest.mark.parametrize(
    "name", ["points.json", "run.sh", "page.html", "module.py", "weights.pth", "scan.raw.exe", "scene.mrml", "noending"]
)
def test_what_is_no_image_is_refused(send: Send, folder: Path, name: str) -> None:
    assert "no known format" in refused(send(("good.raw", b"voxels"), (name, b"#!/bin/sh")), folder)


@pytest.mark.parametrize("name", ["study.zip", "export/Study.ZIP", "study.tar.gz"])
def test_of_an_archive_it_is_said_what_to_do(send: Send, folder: Path, name: str) -> None:
    assert f"{PurePosixPath(name).name} is an archive. Unpack it" in refused(send((name, b"PK")), folder)


@pytest.mark.parametrize("name", ["SCAN.NRRD", "CT.RAW", "SESSION.MRB"])
def test_files_are_known_by_endings_in_capitals_as_well(send: Send, folder: Path, name: str) -> None:
    assert send((name, NRRD)) == [folder / name]


def test_slices_of_dicom_need_no_ending(send: Send, folder: Path) -> None:
    assert send(("IM0001", DICOM)) == [folder / "IM0001"]


def test_what_lies_beside_slices_of_dicom_is_passed_over(send: Send, folder: Path) -> None:
    sent = [(".DS_Store", b"\0\0\0\1Bud1"), ("IM1", DICOM), ("viewer.exe", b"MZ"), ("readme.txt", b"a note"), ("IM2", DICOM)]
    assert send(*sent) == [folder / "IM1", folder / "IM2"]
    assert sorted(path.name for path in folder.iterdir()) == ["IM1", "IM2"]


@pytest.mark.parametrize("name", ["._scan.nrrd", ".DS_Store", "sub/Thumbs.db", "desktop.ini", "scans\\._scan.nrrd"])
def test_what_systems_put_into_a_folder_is_passed_over(send: Send, folder: Path, name: str) -> None:
    assert send((name, b"icons"), ("scan.nrrd", NRRD)) == [folder / "scan.nrrd"]
    assert [path.name for path in folder.iterdir()] == ["scan.nrrd"]


def test_a_file_that_windows_does_not_remove_goes_with_its_folder(
    send: Send, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(path: Path, missing_ok: bool = False) -> None:
        raise PermissionError(13, "The process cannot access the file", str(path))

    monkeypatch.setattr(Path, "unlink", refused)
    assert send(("notes.txt", b"notes"), ("slice", DICOM)) == [folder / "slice"]
    assert "of no known format" in send(("notes.txt", b"notes"))


def test_files_that_are_too_large_are_refused_before_they_are_read(
    send: Send, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uploads, "LARGEST_UPLOAD", 1000)
    monkeypatch.setattr(uploads, "_receive", pytest.fail)
    assert "larger than" in refused(send(("scan.raw", b"v" * 1001)), folder)


def test_files_that_are_larger_than_was_said_are_refused_while_they_are_read(
    send: Send, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uploads, "LARGEST_UPLOAD", 1000)
    monkeypatch.setattr(web.Request, "content_length", None)
    assert "larger than" in refused(send(("a.raw", b"v" * 600), ("b.raw", b"v" * 600)), folder)


def test_too_many_files_are_refused(send: Send, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uploads, "MOST_FILES", 2)
    assert "More than 2 files" in refused(send(*[("IM1", DICOM)] * 3), folder)


def test_a_disk_that_is_nearly_full_stays_as_it_is(send: Send, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    set_free_space(monkeypatch, uploads.DISK_TO_SPARE - 1)
    assert "is full" in refused(send(("scan.raw", b"voxels")), folder)


def test_where_files_cannot_be_kept_that_is_said(send: Send, folder: Path) -> None:
    folder.rmdir()
    # The reason that follows is worded by the system.
    assert "The files cannot be kept: " in str(send(("scan.raw", b"voxels")))


@pytest.mark.parametrize("absolute", [True, False])
def test_a_header_cannot_name_another_file_of_the_computer(send: Send, folder: Path, absolute: bool) -> None:
    secret = folder.parent / "secret.raw"
    secret.write_bytes(b"secrets!")
    voxels = secret if absolute else "../secret.raw"
    header = meta_header(str(voxels))
    assert "names a file elsewhere" in refused(send(("scan.mhd", header)), folder)


@pytest.mark.skipif(os.name == "nt", reason="Windows lets few users make links")
def test_a_header_and_its_voxels_are_taken_in_a_folder_behind_a_link(send: Send, folder: Path, tmp_path: Path) -> None:
    """As that of temporary files is on a Mac."""
    folder.rmdir()
    (tmp_path / "elsewhere").mkdir()
    folder.symlink_to(tmp_path / "elsewhere")
    header = meta_header("scan.raw")
    assert send(("scan.mhd", header), ("scan.raw", bytes(8))) == [folder / "scan.mhd", folder / "scan.raw"]


@pytest.mark.parametrize(
    "cut", [b"", b"------edge\r\n", body([("scan.raw", b"voxels")])[:-20], b"nothing of the kind", b"------edge\r\nX" * 50]
)
def test_what_is_cut_off_or_damaged_is_refused_in_a_sentence(send: Send, folder: Path, cut: bytes) -> None:
    message = refused(send(data=cut), folder)
    assert message in ("No file was sent.", "The files did not arrive whole; send them again.")


def test_what_is_no_form_is_refused(send: Send, folder: Path) -> None:
    assert "expected multipart/form-data" in refused(send(data=b"voxels", content_type="text/plain"), folder)


def test_fields_that_are_no_files_are_passed_over(send: Send, folder: Path) -> None:
    data = f'--{BOUNDARY}\r\nContent-Disposition: form-data; name="files"\r\n\r\nvoxels\r\n--{BOUNDARY}--\r\n'.encode()
    assert refused(send(data=data), folder) == "No file was sent."
