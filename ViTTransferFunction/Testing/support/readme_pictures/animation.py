"""A picture that moves: frames with a pointer that clicks, in a GIF that shows in every browser."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

MOVE_FRAMES = 9
_MOVE_MS = 50
_PRESS_MS = 160
_GREYS = 86
"""In steps of three."""
_GREYEST = 10
"""Difference between a colour's red, green and blue up to which a grey will do."""
_POINTER = [(0, 0), (0, 21), (5, 16.5), (8.5, 24), (12, 22.5), (8.5, 15), (15, 15)]
"""Corners of the arrow, in pixels from its tip."""


class Animation:
    """Collects frames, each with how long it is shown.

    Attributes:
        pointer: where the tip of the pointer is, (x, y) in pixels from the top left corner.
    """

    def __init__(self, pointer: tuple[float, float]) -> None:
        self.pointer = pointer
        self._frames: list[Image.Image] = []
        self._durations_ms: list[int] = []

    def show(self, picture: np.ndarray, milliseconds: int, pressed: bool = False) -> None:
        """Add a frame (H, W, 3) uint8 with the pointer; `pressed` draws the rings of a click around its tip."""
        frame = Image.fromarray(picture)
        draw = ImageDraw.Draw(frame)
        x, y = self.pointer
        for radius in (7, 13) if pressed else ():
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), outline=(255, 230, 80), width=2)
        draw.polygon([(x + dx, y + dy) for dx, dy in _POINTER], fill=(255, 255, 255), outline=(0, 0, 0))
        self._frames.append(frame)
        self._durations_ms.append(milliseconds)

    def move(self, picture: np.ndarray, target: tuple[float, float]) -> None:
        """Let the pointer go to a place, slower at both ends."""
        start = np.array(self.pointer)
        for share in np.linspace(0.0, np.pi, MOVE_FRAMES)[1:]:
            x, y = start + (np.array(target) - start) * (1.0 - np.cos(share)) / 2.0
            self.pointer = float(x), float(y)
            self.show(picture, _MOVE_MS)

    def click(self, picture: np.ndarray) -> None:
        """Press the button where the pointer is."""
        self.show(picture, _PRESS_MS, pressed=True)

    def save(self, path: Path) -> None:
        """Write an endless GIF. All frames have one palette, made of the last, which has every colour."""
        palette = _palette_of(np.asarray(self._frames[-1]))
        first, *others = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in self._frames)
        first.save(path, save_all=True, append_images=others, duration=self._durations_ms, loop=0, optimize=False)


def _palette_of(picture: np.ndarray) -> Image.Image:
    """256 colours for a picture: greys from black to white, and others that are near to every colour that there is.

    By how often colours occur, all would go to the grey of tissue, and none to the shades of a small surface.
    """
    every = np.unique(picture.reshape(-1, 3), axis=0)
    colored = every[np.ptp(every.astype(int), axis=1) > _GREYEST]
    palette = np.repeat(np.rint(np.linspace(0, 255, _GREYS)).astype(np.uint8), 3).tolist()
    if len(colored):
        found = Image.fromarray(colored[None]).quantize(256 - _GREYS, method=Image.Quantize.MAXCOVERAGE)
        palette += (found.getpalette() or [])[: 3 * (256 - _GREYS)]
    image = Image.new("P", (1, 1))
    image.putpalette(palette)
    return image
