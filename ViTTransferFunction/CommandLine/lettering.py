"""Text as pixels: in the font that comes with VTK, which has Latin letters alone, or in one of the system's with its letters.

VTK sets one letter after the other, from left to right: what is written from the right is put into that order before.
"""

from __future__ import annotations

import logging
import os
import sys
import unicodedata
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkRenderingCore import vtkTextProperty, vtkTextRenderer
from vtkmodules.vtkRenderingFreeType import vtkFreeTypeTools  # noqa: F401  (importing it gives vtkTextRenderer its fonts)

from ViTTransferFunction.CommandLine.right_to_left import can_be_set, set_from_the_left

logger = logging.getLogger(__name__)

FONTS = (
    "DejaVuSans.ttf",  # Linux: Greek, Cyrillic and others.
    "LiberationSans-Regular.ttf",
    "NotoSans-Regular.*",
    "NotoSansCJK*-Regular.*",  # Chinese, Japanese, Korean.
    "DroidSansFallback*.ttf",
    "wqy-*.ttc",
    "Arial.ttf",  # macOS; Windows does not mind the case.
    "Arial Unicode.ttf",
    "PingFang.ttc",
    "Hiragino Sans GB.ttc",
    "AppleSDGothicNeo.ttc",
    "segoeui.ttf",  # Windows
    "msyh.ttc",
    "YuGothR.ttc",
    "msgothic.ttc",
    "malgun.ttf",
    "NotoSans*-Regular.*",  # Of one alphabet each.
)
"""Upright ones without serifs, as VTK's own; where several have the letters, the first is taken."""
_FROM_A_FILE = 4
"""VTK_FONT_FILE, which Python is not told of."""
_IN_NO_FONT = "\U0010ffff"
_SAMPLE_PIXELS = 24


def text_coverage(text: str, size: int) -> np.ndarray:
    """How much of each pixel a line of `text` covers, (h, w) float32, 0 to 1; its letters change no line's height."""
    text = unicodedata.normalize("NFC", text)  # Macs write a letter and its accent apart.
    return _coverage(set_from_the_left(text), size, font_of(text) or "")


def legible_names(names: Sequence[str]) -> list[str]:
    """The names as they can be drawn here: one with letters that cannot is its number, from 1, which a warning tells."""
    drawn = [name if font_of(name) is not None else f"No. {number}" for number, name in enumerate(names, start=1)]
    replaced = [f"{shown} is {name}" for name, shown in zip(names, drawn, strict=True) if name != shown]
    if replaced:
        logger.warning(
            "No font of this computer has the letters of some names, or they cannot be drawn; in the picture, %s.",
            ", ".join(replaced),
        )
    return drawn


@lru_cache(maxsize=1000)
def font_of(text: str) -> str | None:
    """The file of a font that has all letters of a text; "" for VTK's own; None where there is none."""
    if not can_be_set(text):
        return None
    seen = set_from_the_left(text)
    letters = sorted({letter for letter in seen if not letter.isspace() and unicodedata.category(letter) not in ("Mn", "Cf")})
    return next((font for font in _fonts() if all(_has(font, letter) for letter in letters)), None)


def _fonts() -> Iterator[str]:
    """As `font_of` names them; the system's are only looked for where VTK's own will not do."""
    yield ""
    yield from map(str, _system_fonts())


@lru_cache(maxsize=10_000)
def _has(font: str, letter: str) -> bool:
    """Whether a font has a letter: for what it lacks, all fonts have one and the same sign."""
    drawn, lacking = (_coverage(each, _SAMPLE_PIXELS, font) for each in (letter, _IN_NO_FONT))
    return not np.array_equal(drawn, lacking)


@lru_cache(maxsize=1)
def _system_fonts() -> tuple[Path, ...]:
    """Those of `FONTS` that are on this computer, in that order."""
    files = [path for folder in _font_folders() for path in sorted(folder.rglob("*.[tToO][tT][fFcC]")) if path.is_file()]
    found = (path for pattern in FONTS for path in files if path.match(pattern))
    return tuple(dict.fromkeys(found))


def _font_folders() -> Iterator[Path]:
    if sys.platform == "win32":
        yield Path(os.environ.get("WINDIR", r"C:\Windows"), "Fonts")
        if "LOCALAPPDATA" in os.environ:
            yield Path(os.environ["LOCALAPPDATA"], "Microsoft", "Windows", "Fonts")
    elif sys.platform == "darwin":
        yield from (Path("/System/Library/Fonts"), Path("/Library/Fonts"), Path("~/Library/Fonts").expanduser())
    else:
        yield from (Path("/usr/share/fonts"), Path("/usr/local/share/fonts"))
        yield from (Path("~/.local/share/fonts").expanduser(), Path("~/.fonts").expanduser())


def _coverage(text: str, size: int, font: str) -> np.ndarray:
    """`text_coverage` in a font: the file of one, or "" for VTK's own."""
    style = vtkTextProperty()
    style.SetFontFamilyToArial()
    if font:
        style.SetFontFamily(_FROM_A_FILE)
        style.SetFontFile(font)
    style.SetFontSize(size)
    style.SetColor(1.0, 1.0, 1.0)
    image = vtkImageData()
    dimensions = [0, 0]
    # A bar after the text gives every line the same height and so the same baseline; it is cut off again. By itself, VTK takes
    # a text with bars or dollar signs for mathematics, where there is Matplotlib.
    backend = vtkTextRenderer.FreeType
    if not vtkTextRenderer.GetInstance().RenderString(style, f"{text}  |", image, dimensions, 72, backend):
        return np.zeros((size, 1), dtype=np.float32)
    columns, rows, _ = image.GetDimensions()
    rgba = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(rows, columns, 4)
    coverage = rgba[: dimensions[1], : dimensions[0], 3][::-1].astype(np.float32) / 255.0
    blank = np.flatnonzero(~coverage.any(axis=0))
    bar_start = blank[blank < np.flatnonzero(coverage.any(axis=0))[-1]][-1]
    inked = np.flatnonzero(coverage[:, :bar_start].any(axis=0))
    return coverage[:, : inked[-1] + 1] if inked.size else coverage[:, :bar_start]
