"""Pictures put together of several, with a caption, and written small. A picture is (H, W, 3) uint8."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

GAP = 2
_QUALITY = 88
"""Of 100: letters are sharp, and thin lines keep their colours."""
CAPTION_HEIGHT = 34
_CAPTION_TEXT = 18
_CAPTION_BACKGROUND = (38, 42, 50)


def row(*pictures: np.ndarray) -> np.ndarray:
    """Pictures of one height, side by side."""
    return _joined(pictures, axis=1)


def column(*pictures: np.ndarray) -> np.ndarray:
    """Pictures of one width, one below the other."""
    return _joined(pictures, axis=0)


def captioned(text: str, picture: np.ndarray) -> np.ndarray:
    """A picture under one line of text."""
    caption = Image.new("RGB", (picture.shape[1], CAPTION_HEIGHT), _CAPTION_BACKGROUND)
    font = ImageFont.load_default(_CAPTION_TEXT)
    ImageDraw.Draw(caption).text((12, CAPTION_HEIGHT / 2), text, fill="white", font=font, anchor="lm")
    return np.concatenate([np.asarray(caption), picture])


def save_small(picture: np.ndarray, path: Path) -> None:
    """Write a WebP, a third of the size of a PNG of 256 colours: the history keeps every version of every picture."""
    Image.fromarray(picture).save(path, quality=_QUALITY, method=6)


def _joined(pictures: tuple[np.ndarray, ...], axis: int) -> np.ndarray:
    across = 1 - axis
    parts = [pictures[0]]
    for picture in pictures[1:]:
        shape = [0, 0, 3]
        shape[axis], shape[across] = GAP, picture.shape[across]
        parts += [np.zeros(shape, np.uint8), picture]
    return np.concatenate(parts, axis=axis)
