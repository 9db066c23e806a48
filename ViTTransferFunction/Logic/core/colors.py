"""Colours of classes."""

from __future__ import annotations

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


def default_color(index: int) -> Color:
    """The colour of the index-th class whose colour nobody chose."""
    return DEFAULT_COLORS[index % len(DEFAULT_COLORS)]


def hex_color(color: tuple[float, ...]) -> str:
    """A colour as web pages and pictures write it, "#rrggbb"."""
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in color)
