"""A smooth closed curve through a few points, as Slicer draws those of its module Markups."""

from __future__ import annotations

import numpy as np

_PLACES_BETWEEN = 10


def closed_curve_through(points: np.ndarray) -> np.ndarray:
    """Places along the periodic cubic spline through control points (N, 3), N ≥ 2, ten from each to the next: (10 N, 3)."""
    # Half a second to load, and hardly ever needed.
    from scipy.interpolate import CubicSpline

    closed = np.concatenate([points, points[:1]])
    spline = CubicSpline(np.arange(len(closed)), closed, bc_type="periodic")
    places: np.ndarray = spline(np.arange(_PLACES_BETWEEN * len(points)) / _PLACES_BETWEEN)
    return places
