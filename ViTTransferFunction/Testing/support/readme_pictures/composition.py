"""Pictures put together of several, with a caption, and written small. A picture is (H, W, 3) uint8."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

GAP = 2
_GREYS = 86
"""In steps of three."""
_GREYEST = 10
"""Difference between a colour's red, green and blue up to which a grey will do."""
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
    """Write a PNG of 256 colours, a third of the size of one of all colours."""
    image = Image.fromarray(picture)
    image.quantize(palette=palette_of(picture), dither=Image.Dither.FLOYDSTEINBERG).save(path, optimize=True)


def palette_of(picture: np.ndarray) -> Image.Image:
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


def _joined(pictures: tuple[np.ndarray, ...], axis: int) -> np.ndarray:
    across = 1 - axis
    parts = [pictures[0]]
    for picture in pictures[1:]:
        shape = [0, 0, 3]
        shape[axis], shape[across] = GAP, picture.shape[across]
        parts += [np.zeros(shape, np.uint8), picture]
    return np.concatenate(parts, axis=axis)
