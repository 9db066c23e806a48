"""Colours of classes."""

from __future__ import annotations

import colorsys
from functools import lru_cache
from itertools import product

import numpy as np

Color = tuple[float, float, float]
"""Red, green and blue, each 0 to 1."""

# Anatomy-like hues that stay apart from each other, also for the common colour deficiencies, in the order handed out.
DEFAULT_COLORS: tuple[Color, ...] = (
    (0.87, 0.36, 0.29),
    (0.34, 0.71, 0.91),
    (0.95, 0.77, 0.06),
    (0.0, 0.62, 0.45),
    (0.8, 0.47, 0.74),
    (0.94, 0.89, 0.7),
    (0.9, 0.55, 0.13),
    (0.3, 0.45, 0.85),
    (0.6, 0.8, 0.3),
    (0.55, 0.4, 0.3),
)

MOST_FURTHER_COLORS = 54
"""Beyond those; more would look like one of them."""
DARKEST = 45.0
"""Lightness in CIELAB, of 100."""


def default_color(index: int) -> Color:
    """The colour of the index-th class whose colour nobody chose: another one for each, as long as eyes can tell them apart."""
    colors = (*DEFAULT_COLORS, *_further_colors())
    return colors[index % len(colors)]


@lru_cache(maxsize=1)
def _further_colors() -> tuple[Color, ...]:
    """Colours in the order in which each is least like all before it."""
    hues = np.arange(24) / 24
    candidates = np.array([colorsys.hsv_to_rgb(*hsv) for hsv in product(hues, (0.35, 0.55, 0.75), (0.6, 0.75, 0.95))])
    # Seen on a dark image as well.
    candidates = candidates[_as_seen(candidates)[:, 0] >= DARKEST]
    places = _as_seen(candidates)
    distances = np.linalg.norm(places[:, None] - _as_seen(np.array(DEFAULT_COLORS)), axis=-1).min(axis=1)
    chosen: list[int] = []
    for _ in range(MOST_FURTHER_COLORS):
        chosen.append(int(distances.argmax()))
        distances = np.minimum(distances, np.linalg.norm(places - places[chosen[-1]], axis=-1))
    return tuple((float(red), float(green), float(blue)) for red, green, blue in candidates[chosen].round(2))


def _as_seen(colors: np.ndarray) -> np.ndarray:
    """Colours (N, 3) in CIELAB, where colours that look alike are near each other; white is D65."""
    linear = np.where(colors <= 0.04045, colors / 12.92, ((colors + 0.055) / 1.055) ** 2.4)
    xyz = linear @ np.array([[0.4124, 0.2126, 0.0193], [0.3576, 0.7152, 0.1192], [0.1805, 0.0722, 0.9505]])
    x, y, z = np.cbrt(np.maximum(xyz / [0.9505, 1.0, 1.089], 0.008856)).T
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=-1)


def hex_color(color: tuple[float, ...]) -> str:
    """A colour as web pages and pictures write it, "#rrggbb"."""
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in color)
