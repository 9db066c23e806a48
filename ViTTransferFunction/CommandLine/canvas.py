"""What every picture is made of: the segments to show, shapes and text drawn on an array of pixels, a legend.

A picture is an array (H, W, 3) uint8, its first row on top. Drawing needs no screen and no OpenGL.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ViTTransferFunction.CommandLine.lettering import text_coverage
from ViTTransferFunction.Logic.core.classes.colors import Color

BACKGROUND: Color = (0.055, 0.063, 0.078)
TEXT: Color = (0.86, 0.88, 0.91)
FAINT_TEXT: Color = (0.55, 0.58, 0.63)


@dataclass(frozen=True, eq=False)
class PictureSegment:
    """One class to show.

    Attributes:
        name: what the legend calls it.
        color: its colour.
        opacity: how much its surface hides what lies behind it, 0 (nothing) to 1 (everything).
        mask: the class's voxels, (K, J, I) bool, on the grid of the volume it is shown with.
        similarity: optional similarity map, (K, J, I); the 3D picture then places the surface between the voxels where
            the map crosses `iso`, instead of smoothing the mask.
        iso: the value of `similarity` at the surface; needed where `similarity` is given.

    Raises:
        ValueError: opacity out of range, or `similarity` without `iso` or of another shape than `mask`.
    """

    name: str
    color: Color
    opacity: float
    mask: np.ndarray
    similarity: np.ndarray | None = None
    iso: float | None = None

    def __post_init__(self) -> None:
        if not 0.0 <= self.opacity <= 1.0:
            raise ValueError(f"segment '{self.name}' has opacity {self.opacity}; expected 0 to 1")
        if self.similarity is not None and (self.iso is None or self.similarity.shape != self.mask.shape):
            raise ValueError(f"segment '{self.name}' needs an iso value and a similarity map of its mask's shape")


def check_segments(segments: Sequence[PictureSegment], shape: tuple[int, int, int]) -> None:
    """Raise ValueError unless every segment's mask has `shape` (K, J, I)."""
    for segment in segments:
        if segment.mask.shape != shape:
            raise ValueError(f"segment '{segment.name}' has a mask of shape {segment.mask.shape}, its volume is {shape}")


class Canvas:
    """Pixels to draw on, anti-aliased.

    Positions are (x, y) in pixels from the top left corner, lengths are in pixels.

    Attributes:
        pixels: (H, W, 3) float32, 0 to 1.
    """

    def __init__(self, width: int, height: int, background: Color = BACKGROUND) -> None:
        self.pixels = np.empty((height, width, 3), dtype=np.float32)
        self.pixels[:] = background

    def picture(self) -> np.ndarray:
        """The canvas as a picture (H, W, 3) uint8."""
        return np.rint(np.clip(self.pixels, 0.0, 1.0) * 255.0).astype(np.uint8)

    def blend(self, left: int, top: int, coverage: np.ndarray, color: Color) -> None:
        """Paint `color` over the rectangle at (left, top), as strongly as `coverage` (h, w), 0 to 1; clipped at the edges."""
        height, width = self.pixels.shape[:2]
        y0, y1 = max(top, 0), min(top + coverage.shape[0], height)
        x0, x1 = max(left, 0), min(left + coverage.shape[1], width)
        if y0 >= y1 or x0 >= x1:
            return
        alpha = coverage[y0 - top : y1 - top, x0 - left : x1 - left, None].astype(np.float32)
        region = self.pixels[y0:y1, x0:x1]
        region += alpha * (np.asarray(color, dtype=np.float32) - region)

    def disc(self, x: float, y: float, radius: float, color: Color) -> None:
        """A filled circle around (x, y)."""
        left, top, dx, dy = _offsets(x, y, radius)
        self.blend(left, top, _inside(radius - np.hypot(dx, dy)), color)

    def bar(self, x: float, y: float, width: float, height: float, color: Color) -> None:
        """A filled rectangle centred at (x, y)."""
        left, top, dx, dy = _offsets(x, y, max(width, height) / 2)
        self.blend(left, top, _inside(np.minimum(width / 2 - abs(dx), height / 2 - abs(dy))), color)

    def text(self, x: float, y: float, text: str, size: int, color: Color = TEXT, anchor: str = "left") -> None:
        """One line of `text`, vertically centred at `y`; `anchor` says which part of it is at `x`: left, center or right."""
        coverage = text_coverage(text, size)
        shift = {"left": 0.0, "center": 0.5, "right": 1.0}[anchor] * coverage.shape[1]
        self.blend(round(x - shift), round(y - coverage.shape[0] / 2), coverage, color)

    def label(self, x: float, y: float, text: str, size: int, color: Color = TEXT, anchor: str = "left") -> None:
        """As `text`, with a dark outline, readable over any image."""
        for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1)):
            self.text(x + dx, y + dy, text, size, (0.0, 0.0, 0.0), anchor)
        self.text(x, y, text, size, color, anchor)


def legend_height(segments: Sequence[PictureSegment], width: int, text_size: int) -> int:
    """Height in pixels of the legend that `draw_legend` draws in a picture `width` pixels wide."""
    return len(_legend_rows(segments, width, text_size)) * round(1.9 * text_size)


def draw_legend(canvas: Canvas, top: int, segments: Sequence[PictureSegment], text_size: int) -> None:
    """Draw a colour swatch and the name of every segment in centred rows below `top`; nothing where there is none."""
    y = top + 0.95 * text_size
    for row in _legend_rows(segments, canvas.pixels.shape[1], text_size):
        x = (canvas.pixels.shape[1] - sum(width for *_, width in row)) / 2
        for name, color, width in row:
            canvas.bar(x + 0.5 * text_size, y, text_size, text_size, color)
            canvas.text(x + 1.5 * text_size, y, name, text_size)
            x += width
        y += 1.9 * text_size


def _legend_rows(segments: Sequence[PictureSegment], width: int, text_size: int) -> list[list[tuple[str, Color, int]]]:
    """Names and colours of the segments in rows that fit into `width`, each with the width that it takes."""
    rows: list[list[tuple[str, Color, int]]] = [[]]
    room = width - 2 * text_size
    for segment in segments:
        name = _fitting(segment.name, text_size, room - 3 * text_size)
        entry = name, segment.color, text_coverage(name, text_size).shape[1] + 3 * text_size
        if rows[-1] and sum(taken for *_, taken in rows[-1]) + entry[2] > room:
            rows.append([])
        rows[-1].append(entry)
    return rows


def _fitting(text: str, size: int, width: int) -> str:
    """The text, or as much of its beginning as fits into `width` pixels with an ellipsis after it."""
    if text_coverage(text, size).shape[1] <= width:
        return text
    # Few letters are narrower than a sixth of their size, and each takes time to measure.
    shortened = text[: 6 * max(width, 0) // size]
    while shortened and text_coverage(f"{shortened}…", size).shape[1] > width:
        shortened = shortened[: -max(1, len(shortened) // 20)]
    return f"{shortened}…"


def _offsets(x: float, y: float, reach: float) -> tuple[int, int, np.ndarray, np.ndarray]:
    """Left and top of the square of pixels within `reach` of (x, y), and its pixels' distances from there along x and y."""
    margin = int(np.ceil(reach)) + 2
    left, top = round(x) - margin, round(y) - margin
    steps = np.arange(2 * margin + 1)
    return left, top, (left + steps - x)[None, :], (top + steps - y)[:, None]


def _inside(depth: np.ndarray) -> np.ndarray:
    """Coverage of pixels that lie `depth` pixels inside an edge (negative: outside)."""
    return np.clip(depth + 0.5, 0.0, 1.0)
