"""A structure's transfer function, drawn over the histogram of its intensities: an SVG picture, for panel and page alike.

Its own intensities are in its colour, those around it in grey, each as high as the picture. The line is the opacity, the strip
below the colour, both by intensity; upright lines are the ends of its window.
"""

from __future__ import annotations

import numpy as np

from ..core.classes.colors import Color, hex_color
from .appearance import Appearance, effective
from .intensity_histogram import IntensityHistogram

WIDTH, HEIGHT = 400, 104
STRIP = 8
"""Height of the strip of colours."""

AROUND = "#8c8c8c"
LINE, HALO = "#202020", "#ffffff"
"""Of what has to be seen on any colour, in light windows and in dark ones."""


def histogram_svg(histogram: IntensityHistogram, window: tuple[float, float], look: Appearance) -> str:
    """The picture, WIDTH × HEIGHT.

    Args:
        histogram: of the structure.
        window: intensities at which its window begins and ends.
        look: of the structure.
    """
    first, last = histogram.ends
    low, high = (WIDTH * (value - first) / max(last - first, 1e-9) for value in window)
    style = effective(look)
    dark = tuple(channel * (1.0 - style.tone) for channel in look.color)
    parts = [
        _area(histogram.outside, AROUND, 0.55),
        _area(histogram.inside, hex_color(look.color), 0.8),
        *(_line([(x, 0.0), (x, 1.0)], AROUND, 1.5) for x in (low, high)),
        *(
            _line([(min(0.0, low), style.low), (low, style.low), (high, 1.0), (max(float(WIDTH), high), 1.0)], color, width)
            for color, width in ((HALO, 4.0), (LINE, 2.0))
        ),
        _strip(low, high, (dark[0], dark[1], dark[2]), look.color),
    ]
    size = f'width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size} preserveAspectRatio="none">{"".join(parts)}</svg>'


def _area(shares: np.ndarray, color: str, opacity: float) -> str:
    """Shares by bin as an area, the largest as high as the picture."""
    heights = shares / max(float(shares.max()), 1e-9)
    across = np.linspace(0.0, WIDTH, 2 * len(heights) + 1)[1::2]
    points = [(0.0, 0.0), *zip(across.tolist(), heights.tolist(), strict=True), (float(WIDTH), 0.0)]
    return f'<polygon points="{_places(points)}" fill="{color}" fill-opacity="{opacity:g}"/>'


def _line(points: list[tuple[float, float]], color: str, width: float) -> str:
    return f'<polyline points="{_places(points)}" fill="none" stroke="{color}" stroke-width="{width:g}"/>'


def _places(points: list[tuple[float, float]]) -> str:
    """Points, x in pixels and y from 0 to 1 upwards, as SVG has them."""
    margin, room = 3.0, HEIGHT - STRIP - 6.0
    return " ".join(f"{x:.1f},{margin + room * (1.0 - y):.1f}" for x, y in points)


def _strip(low: float, high: float, dark: Color, bright: Color) -> str:
    """The colours, from the one below the window to the one above."""
    ends = f'x1="{low:.1f}" y1="0" x2="{max(high, low + 0.1):.1f}" y2="0"'
    stops = f'<stop offset="0" stop-color="{hex_color(dark)}"/><stop offset="1" stop-color="{hex_color(bright)}"/>'
    gradient = f'<linearGradient id="colors" gradientUnits="userSpaceOnUse" {ends}>{stops}</linearGradient>'
    return f'<defs>{gradient}</defs><rect x="0" y="{HEIGHT - STRIP}" width="{WIDTH}" height="{STRIP}" fill="url(#colors)"/>'
