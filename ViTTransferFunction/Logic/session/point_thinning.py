"""Reduces very many points, as of a painted structure or a mask, to fewer with the same information."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..core.classes.class_request import ClassRequest, different_places
from ..core.volumes.geometry import Geometry

MOST_POINTS = 500
"""Largest number of points of all classes together. Each takes time and megabytes of memory, and fewer define a structure."""
_GROWTH = 1.25


def thinned(requests: Sequence[ClassRequest], geometry: Geometry) -> list[ClassRequest]:
    """The same classes with at most `MOST_POINTS` points in total, or one point per list if there are more lists.

    Equal points of a list are always reduced to one: a double click carries no more information than a click. If there are too
    many points, each list keeps one in each voxel; if these are still more than its share, one in each cube, of the smallest
    cubes that suffice. A close-up is enlarged for all points first, since otherwise its features would be computed again
    whenever other points are kept.

    Args:
        requests: the classes, whose points lie in the volume.
        geometry: grid of the volume.
    """
    requests = [_without_repeated(request) for request in requests]
    lists = [points for request in requests for points in (request.positive, request.negative) if len(points)]
    if sum(map(len, lists)) <= MOST_POINTS:
        return requests
    share = max(1, MOST_POINTS // len(lists))
    return [
        replace(
            request,
            positive=_thin(request.positive, geometry, share),
            negative=_thin(request.negative, geometry, share),
            close_up=request.close_up and request.close_up.enlarged(geometry, request.positive),
        )
        for request in requests
    ]


def _without_repeated(request: ClassRequest) -> ClassRequest:
    """The class without repeated points in its lists; the same object if there are none."""
    positive, negative = (different_places(points) for points in (request.positive, request.negative))
    if (len(positive), len(negative)) == (len(request.positive), len(request.negative)):
        return request
    return replace(request, positive=request.positive[positive], negative=request.negative[negative])


def _thin(points_ras: np.ndarray, geometry: Geometry, most: int) -> np.ndarray:
    """The first point (x, y, z) in each cell, in the order of the points (N, 3)."""
    if len(points_ras) <= most:
        return points_ras
    # Voxels first; then cubes in millimetres, whose borders do not move with the points.
    cells, edge_mm = geometry.nearest_voxels(points_ras), float(geometry.spacing_mm.max())
    # Points of a face may be rounded to before it, where no cube, however large, would join them to the others.
    places_mm = np.maximum(geometry.ras_to_ijk(points_ras) + 0.5, 0.0) * geometry.spacing_mm
    while True:
        # Cells by one number each, because NumPy's `unique` of rows takes tens of times as long.
        _, first = np.unique(np.ravel_multi_index(tuple(cells.T), tuple(cells.max(axis=0) + 1)), return_index=True)
        if len(first) <= most:
            return points_ras[np.sort(first)]
        cells = np.floor(places_mm / edge_mm).astype(int)
        edge_mm *= _GROWTH
