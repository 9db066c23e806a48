"""Messages arrive through a stream as they were sent, and a stream that ends early is noticed."""

from __future__ import annotations

import errno
import io
import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from ViTTransferFunction.Logic.compute import array_files
from ViTTransferFunction.Logic.compute.array_files import ArrayFiles
from ViTTransferFunction.Logic.compute.messages import ArraysNotWritten, Message, read_message, write_message
from ViTTransferFunction.Logic.compute.server import Server


@pytest.fixture
def files(tmp_path: Path) -> ArrayFiles:
    return ArrayFiles(tmp_path)


def test_content_and_arrays_arrive_as_they_were_sent(files: ArrayFiles, tmp_path: Path) -> None:
    arrays = (
        np.arange(24, dtype=np.int16).reshape(2, 3, 4),
        np.array([[1.5, np.nan], [np.inf, -0.0]], dtype=">f8"),
        np.zeros((0, 3), dtype=np.uint8),
        np.array([True, False]),
        np.arange(20, dtype=np.float32).reshape(4, 5).T,
    )
    stream = io.BytesIO()
    write_message(stream, Message({"what": "Größe\n", "points": [[1.0, 2.0, 3.0]], "iso": None}, arrays), files)
    write_message(stream, Message({"second": True}), files)
    stream.seek(0)
    first, second = read_message(stream, files), read_message(stream, files)
    assert first is not None
    assert second is not None
    assert first.content == {"what": "Größe\n", "points": [[1.0, 2.0, 3.0]], "iso": None}
    for sent, received in zip(arrays, first.arrays, strict=True):
        assert received.dtype == sent.dtype
        np.testing.assert_array_equal(received, sent)
    assert second.content == {"second": True}
    assert read_message(stream, files) is None
    assert list(tmp_path.iterdir()) == []


def test_the_stream_itself_carries_no_array(files: ArrayFiles) -> None:
    stream = io.BytesIO()
    write_message(stream, Message({"what": "labels"}, (np.zeros((100, 100, 100)),)), files)
    assert len(stream.getvalue()) < 200


@pytest.mark.parametrize("missing", [1, 10, 50])
def test_an_incomplete_message_is_not_returned(missing: int, files: ArrayFiles) -> None:
    stream = io.BytesIO()
    write_message(stream, Message({"what": "maps"}, (np.ones(32),)), files)
    assert read_message(io.BytesIO(stream.getvalue()[:-missing]), files) is None


@pytest.mark.parametrize("line", [b"nothing\n", b"[1, 2]\n", b'{"content": 3}\n'])
def test_what_is_no_message_is_refused(line: bytes, files: ArrayFiles) -> None:
    with pytest.raises(ValueError, match=r"not a message|Expecting value"):
        read_message(io.BytesIO(line), files)


def test_a_file_that_is_too_short_is_noticed(files: ArrayFiles, tmp_path: Path) -> None:
    stream = io.BytesIO()
    write_message(stream, Message({"what": "maps"}, (np.ones(32),)), files)
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:-1])
    stream.seek(0)
    with pytest.raises(OSError, match="ends after 255 of 256 bytes"):
        read_message(stream, files)


def test_a_message_names_no_file_of_another_folder(tmp_path: Path) -> None:
    folder = tmp_path / "private"
    folder.mkdir()
    secret = tmp_path / "secret"
    secret.write_bytes(b"12345678")
    with pytest.raises(FileNotFoundError):
        ArrayFiles(folder).take({"file": "../secret", "arrays": [{"dtype": "<f8", "shape": [1]}]})
    assert secret.exists()


def test_where_there_is_no_room_nothing_is_said(tmp_path: Path) -> None:
    stream = io.BytesIO()
    with pytest.raises(ArraysNotWritten):
        write_message(stream, Message({"what": "maps"}, (np.ones(32),)), ArrayFiles(tmp_path / "gone"))
    assert stream.getvalue() == b""


@pytest.mark.parametrize("code", [errno.EPIPE, errno.EINVAL], ids=["a broken pipe", "an invalid argument, as Windows says"])
def test_where_nobody_reads_the_replies_any_more_no_voxel_is_left(
    code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Unread(io.BytesIO):
        def write(self, _: object) -> int:
            raise OSError(code, os.strerror(code))

    def exited(status: int) -> None:
        raise SystemExit(status)

    monkeypatch.setattr(os, "_exit", exited)
    folder = tmp_path / "arrays"
    folder.mkdir()
    (folder / "1-0").write_bytes(b"voxels")
    with pytest.raises(SystemExit) as ended:
        Server(io.BytesIO(), Unread(), ArrayFiles(folder)).serve()
    assert (ended.value.code, list(tmp_path.iterdir())) == (0, [])


def test_where_files_that_are_in_use_cannot_be_removed_they_are_read_instead(
    files: ArrayFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on Windows."""
    monkeypatch.setattr(array_files, "_CALL_BYTES", 100)
    array = np.arange(300, dtype=np.float32).reshape(3, 100)
    described = files.put([array, array[1]])
    monkeypatch.setattr(array_files, "mmap", None)
    monkeypatch.setattr(array_files, "os", SimpleNamespace(name="nt"))
    first, second = files.take(described)
    np.testing.assert_array_equal(first, array)
    np.testing.assert_array_equal(second, array[1])
    first[0] = 7.0
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "short").write_bytes(bytes(100))
    with pytest.raises(OSError, match="ends after 100 of 1200 bytes"):
        files.take({"file": "short", "arrays": [{"dtype": "<f4", "shape": [3, 100], "start": 0}]})
    (tmp_path / "empty").touch()
    (nothing,) = files.take({"file": "empty", "arrays": [{"dtype": "<f4", "shape": [0, 3], "start": 0}]})
    assert nothing.shape == (0, 3)
