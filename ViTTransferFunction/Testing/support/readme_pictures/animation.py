"""A picture that moves: frames with a pointer that clicks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

MOVE_FRAMES = 9
_MOVE_MS = 50
_PRESS_MS = 160
_QUALITY = 65
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
        """Write an endless WebP, a quarter of the size that a GIF has."""
        first, *others = self._frames
        durations = self._durations_ms
        # Of each frame, only what is new.
        first.save(path, save_all=True, append_images=others, duration=durations, loop=0, quality=_QUALITY, minimize_size=True)
