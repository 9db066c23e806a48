"""How each structure looks in 3D: its transfer function, in a few numbers that a renderer's shader (`shader`) reads.

Nothing of it is in the volume that is rendered: to change it is to draw another picture, not to compute.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..core.classes.colors import Color
from .shader import ROWS, capacity

LEAST_WINDOW = 1.0 / 255.0
"""The narrowest window, of the range of intensities that are told apart."""


class Style(NamedTuple):
    """A preset of a structure's transfer function.

    Attributes:
        wall: opacity of its surface, of what the structure's opacity is.
        rim: how much of that is seen only where the surface turns away, as on glass.
        tone: how much darker its colour is at the low end of its intensity window than at the high end, in [0, 1].
        density: of its inside, per unit of length; 0: it is a surface alone.
        low: opacity at the low end of the window, of that at the high end.
        begin: where its window begins, of the range of its own intensities.
        edges: how much of its inside is seen only where intensities change.
        lit: how much the light matters inside.
    """

    wall: float
    rim: float = 0.0
    tone: float = 0.0
    density: float = 0.0
    low: float = 1.0
    begin: float = 0.0
    edges: float = 0.0
    lit: float = 0.0


STYLES: dict[str, Style] = {
    "surface": Style(wall=1.0),
    "glass": Style(wall=1.0, rim=1.0),
    "X-ray": Style(wall=0.35, rim=1.0, tone=0.5, density=0.04, low=0.1),
    "vessels": Style(wall=0.12, rim=1.0, tone=0.55, density=0.9, low=0.0, begin=0.5, lit=1.0),
    "as scanned": Style(wall=0.0, tone=0.85, density=0.35, low=0.15, lit=0.8),
}
"""By name; the first is what structures have unless somebody chose."""

DEFAULT_STYLE = "surface"


@dataclass(frozen=True)
class Appearance:
    """How a structure looks. What is None is as its style says.

    Attributes:
        color: red, green, blue in [0, 1].
        opacity: in [0, 1]; at 0 the structure is as if it were not there.
        style: one of `STYLES`.
        low: intensity at which its window begins; None: where most of its own voxels begin.
        high: intensity at which its window ends; None likewise.
        ramp: opacity at the low end of the window, of that at the high end.
        edges: how much of its inside is seen only where intensities change, in [0, 1].
        tone: how much darker it is at the low end of the window, in [0, 1].
    """

    color: Color
    opacity: float = 1.0
    style: str = DEFAULT_STYLE
    low: float | None = None
    high: float | None = None
    ramp: float | None = None
    edges: float | None = None
    tone: float | None = None


OF_STYLE = ("ramp", "edges", "tone")
"""The fields of an `Appearance` that its style decides unless somebody does."""

UNSEEN = Appearance((0.0, 0.0, 0.0), opacity=0.0)
"""Of a structure that is not shown."""

DETAIL_TONE = 0.3
"""How much darker surfaces are where the image is, where the image's own detail is to be seen on them."""


def detailed(look: Appearance) -> Appearance:
    """A look that shows the image's own detail, unless somebody chose otherwise."""
    return replace(look, tone=DETAIL_TONE) if look.style == DEFAULT_STYLE and look.tone is None else look


def effective(look: Appearance) -> Style:
    """A look's style, with what was chosen otherwise."""
    chosen = {"low": look.ramp, "edges": look.edges, "tone": look.tone}
    return STYLES[look.style]._replace(**{name: value for name, value in chosen.items() if value is not None})


def appearance_rows(
    appearances: Sequence[Appearance], own_levels: np.ndarray, levels: np.ndarray, unit_voxels: float
) -> np.ndarray:
    """What the shader reads, (capacity, ROWS, 4) float64; the first is of no structure.

    Args:
        appearances: of the structures, in the order of their numbers.
        own_levels: (N, 2) grey levels, 0 to 255, between which most of each structure's voxels lie.
        levels: (256,), the intensity that each grey level stands for.
        unit_voxels: the length that densities are for, in voxels.
    """
    rows = np.zeros((capacity(len(appearances)), ROWS, 4))
    for number, (look, own) in enumerate(zip(appearances, own_levels, strict=True), start=1):
        style = effective(look)
        low, high = (level / 255.0 for level in window_levels(look, own, levels))
        rows[number] = (
            (*look.color, look.opacity),
            (style.wall, style.rim, style.tone, style.density / unit_voxels),
            (low, max(high, low + LEAST_WINDOW), style.low, style.edges),
            (style.lit, 0.0, 0.0, 0.0),
        )
    return rows


def window_levels(look: Appearance, own: np.ndarray, levels: np.ndarray) -> tuple[float, float]:
    """The grey levels between which a structure gets brighter and more opaque.

    Args:
        look: of the structure.
        own: (2,) grey levels between which most of its voxels lie.
        levels: (256,), the intensity that each grey level stands for.
    """
    begin = own[0] + STYLES[look.style].begin * (own[1] - own[0])
    low, high = (
        float(level) if chosen is None else float(np.interp(chosen, levels, np.arange(256)))
        for chosen, level in ((look.low, begin), (look.high, own[1]))
    )
    return low, high
