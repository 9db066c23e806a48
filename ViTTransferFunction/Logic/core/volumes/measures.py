"""Lengths, places and volumes in figures, as fine as the scan is that they are of: a body's, or a small specimen's."""

from __future__ import annotations

import math

SMALLEST_ML = 0.00995
"""What is smaller is told in mm³: of a nodule of 3 mm, millilitres still have two figures."""

FINE_MM = 0.5
"""Of voxels that are smaller, as those of a tooth or of a small animal, many lie within a millimetre: it gets decimals."""


def two_figures(value: float, least_decimals: int = 0) -> str:
    """A number from 0 up with two figures that tell something, or more: "12", "1.2", "0.0012"."""
    return f"{value:.{decimals_of(value, 2, least_decimals)}f}"


def decimals_of(value: float, figures: int, least_decimals: int) -> int:
    """Digits after the point with which a number has so many figures that tell something, but `least_decimals` at least."""
    exponent = int(f"{value:.{figures - 1}e}".partition("e")[2])
    return max(figures - 1 - exponent, least_decimals) if value else least_decimals


def round_number(most: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is no larger than a number above 0."""
    power = 10.0 ** math.floor(math.log10(most))
    return next(step * power for step in (5, 2, 1) if step * power <= most or step == 1)


def millilitres_text(volume_ml: float) -> str:
    """A volume with its unit, such as "1512.3 ml", "0.014 ml", or, of small specimens, "0.40 mm³"."""
    if 0.0 < volume_ml < SMALLEST_ML:
        return f"{two_figures(1000.0 * volume_ml)} mm³"
    return f"{two_figures(volume_ml, least_decimals=1)} ml"


def position_decimals(spacing_mm: float) -> int:
    """Digits after the point with which positions tell voxels of this size apart, in millimetres; of usual ones none."""
    # Files in single precision have a little more or less.
    return 0 if spacing_mm >= FINE_MM else max(math.ceil(-math.log10(2.0 * spacing_mm) - 1e-6), 1)
