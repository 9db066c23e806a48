"""Writes films: MP4 (H.264) by the program ffmpeg, which the package imageio-ffmpeg contains, and GIF by Pillow.

Frames are requested one by one, so that a long film takes no more memory than a short one; only a GIF is kept in memory, as
palette indices.
"""

from __future__ import annotations

import math
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, Queue
from threading import Thread
from typing import IO, TYPE_CHECKING

import numpy as np

from ..core.system.atomic_file import replacing
from ..core.system.closed_pipe import is_closed_pipe
from ..core.system.errors import Cancelled, InputError
from ..core.system.progress import Progress, no_progress
from ..core.volumes.stepped_work import ADVANCE_S, Steps

if TYPE_CHECKING:
    from PIL import Image

ENDINGS = (".mp4", ".gif")

DEFAULT_FRAMES, DEFAULT_SECONDS = 96, 8.0
MOST_FRAMES = 10_000
FASTEST = {".mp4": 120.0, ".gif": 50.0}
"""Most frames a second. A GIF counts in hundredths of a second, and browsers slow down frames of less than two of them."""

_PALETTE_FRAMES = 6
"""Number of frames from which the palette of a GIF is chosen."""

_PALETTE_PIXELS = 200_000
"""Pixels of those frames that are used: all pixels would take minutes in a large film, and give nearly the same palette."""

_CONSTANT_RATE_FACTOR = 18
"""Quality of H.264: at 18 or less, no difference to the original can be seen."""


@dataclass(frozen=True)
class FilmPlan:
    """A film to be written.

    Attributes:
        path: path of the file, with one of `ENDINGS`.
        frames: number of frames.
        seconds: duration of the film.

    Raises:
        InputError: the ending is another one, or a number is out of range.
    """

    path: Path
    frames: int
    seconds: float

    @property
    def drawings(self) -> int:
        """How many pictures are requested until the film is written."""
        return self.frames + (min(_PALETTE_FRAMES, self.frames) if self.path.suffix.lower() == ".gif" else 0)

    def __post_init__(self) -> None:
        if self.path.suffix.lower() not in ENDINGS:
            raise InputError(f"{self.path}: expected the film's name to end in {' or '.join(ENDINGS)}.")
        if not 2 <= self.frames <= MOST_FRAMES:
            raise InputError(f"A film of {self.frames} frames cannot be made; expected 2 to {MOST_FRAMES}.")
        fastest = FASTEST[self.path.suffix.lower()]
        if not self.frames / fastest <= self.seconds <= 3600.0:
            raise InputError(
                f"{self.frames} frames cannot be shown in {self.seconds:g} seconds; expected {self.frames / fastest:g} to 3600 "
                f"seconds, as {self.path.suffix} shows at most {fastest:g} frames a second."
            )


def write_film(plan: FilmPlan, frame: Callable[[int], np.ndarray], progress: Progress = no_progress) -> None:
    """Write a film, whole or not at all; its folder is made if missing.

    Args:
        plan: of the film.
        frame: the picture (H, W, 3) uint8 by its number, all of one size. An MP4 of an odd number of rows or columns lacks the
            last one: its colours are stored for squares of four pixels.
        progress: called with frames done.

    Raises:
        InputError: the film cannot be written. What it is written by must be there (`check_film_writer`).
    """

    def shown(number: int) -> np.ndarray:
        picture = frame(number)
        progress(number + 1, plan.frames, "Filming")
        return picture

    progress(0, plan.frames, "Filming")
    with replacing(plan.path) as temporary:
        if plan.path.suffix.lower() == ".gif":
            _write_gif(temporary, plan, shown, _palette(plan, frame))
        else:
            _write_mp4(temporary, plan, shown)


def film_steps(plan: FilmPlan, frame: Callable[[int], np.ndarray]) -> Steps[None]:
    """As `write_film`, where an event loop waits: a step draws a picture, or waits a moment for those drawn to be written.

    Pictures are drawn by whoever takes the steps; they are written by a thread, which gets on while a step waits for it. Work
    that is given up (`close` of the generator) leaves nothing.
    """
    asked: Queue[int | None] = Queue()
    drawn: Queue[np.ndarray | None] = Queue()
    failed: list[Exception] = []

    def ask(number: int) -> np.ndarray:
        asked.put(number)
        picture = drawn.get()
        if picture is None:
            raise Cancelled
        return picture

    def write() -> None:
        try:
            write_film(plan, ask)
        except Exception as error:  # Raised where the steps are taken.
            failed.append(error)
        finally:
            asked.put(None)

    writer = Thread(target=write, daemon=True)
    writer.start()
    try:
        while True:
            try:
                number = asked.get(timeout=ADVANCE_S)
            except Empty:
                yield 0
                continue
            if number is None:
                break
            drawn.put(frame(number))
            yield 1
    finally:
        drawn.put(None)
        writer.join()
    if failed:
        raise failed[0]


def check_film_writer(path: Path) -> None:
    """Raise InputError if the library that a film of this name needs is missing."""
    gif = path.suffix.lower() == ".gif"
    package = "pillow" if gif else "imageio-ffmpeg"
    try:
        if gif:
            import PIL.Image  # noqa: F401
        else:
            import imageio_ffmpeg

            imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError) as error:
        instead = "" if gif else " A .gif needs no such package."
        raise InputError(
            f"A {path.suffix} film needs the package {package}, which is not there ({error}): pip install {package}, or in "
            f"Slicer's Python console slicer.util.pip_install('{package}').{instead}"
        ) from error


def _write_gif(path: Path, plan: FilmPlan, frame: Callable[[int], np.ndarray], palette: Image.Image) -> None:
    from PIL import Image

    def indexed(number: int) -> Image.Image:
        return Image.fromarray(frame(number)).quantize(palette=palette, dither=Image.Dither.NONE)

    # Ends of frames in whole hundredths of a second; durations are their differences, so that rounding does not accumulate.
    ends = np.rint(np.arange(plan.frames + 1) * 100.0 * plan.seconds / plan.frames)
    indexed(0).save(
        path,
        format="GIF",
        save_all=True,
        append_images=(indexed(number) for number in range(1, plan.frames)),
        duration=(10 * np.diff(ends)).astype(int).tolist(),
        loop=0,
        optimize=False,
    )


def _palette(plan: FilmPlan, frame: Callable[[int], np.ndarray]) -> Image.Image:
    """A palette of 256 colours for all frames, so that still parts of the picture do not flicker."""
    from PIL import Image

    count = min(_PALETTE_FRAMES, plan.frames)

    def sample(picture: np.ndarray) -> np.ndarray:
        step = max(1, math.ceil(math.sqrt(count * picture.shape[0] * picture.shape[1] / _PALETTE_PIXELS)))
        return picture[::step, ::step]

    some = np.concatenate([sample(frame(number * plan.frames // count)) for number in range(count)])
    return Image.fromarray(some).quantize(256, method=Image.Quantize.MEDIANCUT, kmeans=1)


def _write_mp4(path: Path, plan: FilmPlan, frame: Callable[[int], np.ndarray]) -> None:
    first = _even(frame(0))
    height, width = first.shape[:2]
    with _encoder(path, width, height, plan.frames / plan.seconds) as raw:
        raw.write(first.tobytes())
        for number in range(1, plan.frames):
            raw.write(_even(frame(number)).tobytes())


def _even(picture: np.ndarray) -> np.ndarray:
    height, width = picture.shape[:2]
    return picture[: height - height % 2, : width - width % 2]


@contextmanager
def _encoder(path: Path, width: int, height: int, frames_per_second: float) -> Iterator[IO[bytes]]:
    """A pipe that takes the pixels of one frame after the other; the file is complete at the end of the `with` statement."""
    import imageio_ffmpeg

    command = [
        imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-y",
        "-f", "rawvideo", "-pixel_format", "rgb24", "-video_size", f"{width}x{height}",
        "-framerate", f"{frames_per_second:.6f}", "-i", "pipe:0",
        # Options that every player and browser supports, also before the file is downloaded completely.
        "-codec:v", "libx264", "-crf", str(_CONSTANT_RATE_FACTOR), "-pix_fmt", "yuv420p", "-movflags", "+faststart",
        "-f", "mp4", str(path),
    ]  # fmt: skip
    with tempfile.TemporaryFile() as errors:
        # So that no console window appears on Windows.
        flags = getattr(subprocess, "CREATE_NO_WINDOW", 0)
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=errors, creationflags=flags
        )
        assert process.stdin is not None
        try:
            with _until_it_ends():
                yield process.stdin
                process.stdin.close()
            code = process.wait()
        finally:
            process.kill()
            process.wait()
        if code:
            errors.seek(0)
            said = errors.read().decode(errors="replace").strip().splitlines() or [f"exit code {code}"]
            raise InputError(
                f"The film could not be written: {said[-1][:200]}. Is the disk full? A .gif is made without ffmpeg."
            )


@contextmanager
def _until_it_ends() -> Iterator[None]:
    """Ignore the closed pipe of a program that has ended early: its exit code and messages say why."""
    try:
        yield
    except OSError as error:
        if not is_closed_pipe(error):
            raise
