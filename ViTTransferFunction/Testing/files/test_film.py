"""Films: what is written has the frames, the size and the time that were asked for, and the frames show what they should."""

from __future__ import annotations

import errno
import subprocess
import sys
from pathlib import Path
from threading import get_ident
from typing import Any

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.system.errors import Cancelled, InputError
from ViTTransferFunction.Logic.files.film import FilmPlan, check_film_writer, film_steps, write_film

COLORS = [(200, 30, 30), (30, 200, 30), (30, 30, 200), (200, 200, 30), (30, 200, 200), (200, 30, 200)]


def plain(number: int, width: int = 64, height: int = 48) -> np.ndarray:
    """A frame of one colour, another for each number."""
    return np.broadcast_to(np.array(COLORS[number], dtype=np.uint8), (height, width, 3)).copy()


def frames_of(path: Path) -> tuple[list[np.ndarray], float]:
    """The frames (H, W, 3) of a film, and the seconds that it takes."""
    if path.suffix == ".gif":
        image = pytest.importorskip("PIL.Image").open(path)
        frames, hundredths = [], 0
        for number in range(image.n_frames):
            image.seek(number)
            frames.append(np.asarray(image.convert("RGB")))
            hundredths += image.info["duration"] // 10
        return frames, hundredths / 100.0
    reader = pytest.importorskip("imageio_ffmpeg").read_frames(str(path))
    about = next(reader)
    width, height = about["size"]
    return [np.frombuffer(frame, np.uint8).reshape(height, width, 3) for frame in reader], about["duration"]


@pytest.fixture(params=[".gif", ".mp4"])
def path(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    pytest.importorskip({".gif": "PIL", ".mp4": "imageio_ffmpeg"}[request.param])
    return tmp_path / "new" / f"film{request.param}"


def test_a_film_has_its_frames_in_order_and_takes_its_time(path: Path) -> None:
    write_film(FilmPlan(path, frames=len(COLORS), seconds=1.3), plain)
    frames, seconds = frames_of(path)
    assert len(frames) == len(COLORS)
    assert seconds == pytest.approx(1.3, abs=0.011)
    for frame, color in zip(frames, COLORS, strict=True):
        assert frame.shape == (48, 64, 3)
        np.testing.assert_allclose(frame[24, 32], color, atol=12)


def test_an_odd_size_loses_at_most_a_pixel(path: Path) -> None:
    write_film(FilmPlan(path, frames=3, seconds=1.0), lambda number: plain(number, 65, 47))
    height, width, _ = frames_of(path)[0][0].shape
    assert (width, height) in ((65, 47), (64, 46))


def test_the_colours_of_a_large_film_are_chosen_by_some_of_its_pixels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    image = pytest.importorskip("PIL.Image")
    looked_at: list[int] = []
    quantize = image.Image.quantize

    def count(self: Any, *arguments: Any, **options: Any) -> Any:
        if "palette" not in options:
            looked_at.append(self.width * self.height)
        return quantize(self, *arguments, **options)

    monkeypatch.setattr(image.Image, "quantize", count)
    picture = np.zeros((600, 700, 3), np.uint8)
    picture[:, 350:] = 200, 100, 50
    write_film(FilmPlan(tmp_path / "f.gif", 2, 1.0), lambda number: picture)
    assert 50_000 < looked_at[0] <= 200_000
    frames, _ = frames_of(tmp_path / "f.gif")
    assert np.abs(frames[0].astype(int) - picture).max() <= 2


def test_a_film_that_is_given_up_leaves_nothing(path: Path) -> None:
    def frame(number: int) -> np.ndarray:
        if number == 2:
            raise Cancelled
        return plain(number)

    path.parent.mkdir()
    path.write_bytes(b"an older film")
    with pytest.raises(Cancelled):
        write_film(FilmPlan(path, frames=5, seconds=1.0), frame)
    assert path.read_bytes() == b"an older film"
    assert list(path.parent.iterdir()) == [path]


def test_a_film_shot_in_steps_is_that_shot_at_once_and_drawn_by_who_takes_the_steps(path: Path) -> None:
    plan = FilmPlan(path, frames=len(COLORS), seconds=1.0)
    write_film(plan, plain)
    at_once = path.read_bytes()
    path.unlink()
    threads = set()

    def frame(number: int) -> np.ndarray:
        threads.add(get_ident())
        return plain(number)

    assert sum(film_steps(plan, frame)) == plan.drawings
    assert path.read_bytes() == at_once
    assert threads == {get_ident()}


def test_a_film_given_up_between_steps_leaves_nothing(path: Path) -> None:
    steps = film_steps(FilmPlan(path, frames=len(COLORS), seconds=1.0), plain)
    while next(steps) == 0:
        pass
    steps.close()
    assert list(path.parent.iterdir()) == []


def test_what_goes_wrong_while_a_film_is_written_is_raised_where_its_steps_are_taken(path: Path) -> None:
    path.mkdir(parents=True)
    with pytest.raises(InputError, match="is a folder"):
        sum(film_steps(FilmPlan(path, frames=3, seconds=1.0), plain))


def test_a_frame_that_cannot_be_drawn_ends_the_film(path: Path) -> None:
    def frame(number: int) -> np.ndarray:
        raise InputError("no view")

    with pytest.raises(InputError, match="no view"):
        sum(film_steps(FilmPlan(path, frames=3, seconds=1.0), frame))
    assert list(path.parent.iterdir()) == []


def test_a_film_whose_writer_is_missing_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(InputError, match=r"pip install imageio-ffmpeg.*slicer\.util\.pip_install.*\.gif needs no such"):
        check_film_writer(Path("film.mp4"))


def test_progress_counts_frames(path: Path) -> None:
    seen = []
    write_film(FilmPlan(path, frames=4, seconds=1.0), plain, lambda done, total, what: seen.append((done, total)))
    assert seen == [(done, 4) for done in range(5)]


def test_an_encoder_that_fails_is_an_input_error(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    with pytest.raises(InputError, match="could not be written"):
        # No encoder takes frames of no width.
        write_film(FilmPlan(tmp_path / "film.mp4", frames=3, seconds=1.0), lambda number: plain(number, width=1))
    assert not list(tmp_path.iterdir())


def test_on_windows_an_encoder_gets_no_window_and_one_that_has_ended_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("imageio_ffmpeg")
    no_window, start = 0x08000000, subprocess.Popen

    class EndedPipe:
        def write(self, _: bytes) -> int:
            raise OSError(errno.EINVAL, "Invalid argument")

        def close(self) -> None:
            pass

    def popen(*arguments: Any, creationflags: int = 0, **options: Any) -> Any:
        assert creationflags == no_window
        process: Any = start(*arguments, **options)
        process.stdin.close()
        process.stdin = EndedPipe()
        return process

    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(subprocess, "CREATE_NO_WINDOW", no_window, raising=False)
    monkeypatch.setattr(subprocess, "Popen", popen)
    with pytest.raises(InputError, match="could not be written"):
        write_film(FilmPlan(tmp_path / "film.mp4", frames=3, seconds=1.0), lambda number: plain(number, width=1))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "frames", "seconds"),
    [
        ("f.avi", 10, 1.0),
        ("f", 10, 1.0),
        ("f.mp4", 1, 1.0),
        ("f.mp4", 10**6, 3600.0),
        ("f.gif", 60, 1.0),
        ("f.mp4", 10, 0.0),
        ("f.mp4", 10, float("nan")),
        ("f.mp4", 10, 1e9),
    ],
)
def test_a_film_that_cannot_be_is_refused(name: str, frames: int, seconds: float) -> None:
    with pytest.raises(InputError):
        FilmPlan(Path(name), frames, seconds)
