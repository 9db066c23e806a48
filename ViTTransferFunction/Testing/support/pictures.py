"""Volumes in many orientations, balls in them, and where those are in a picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ViTTransferFunction.CommandLine.canvas import PictureSegment
from ViTTransferFunction.Logic.core.classes.colors import Color
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.volume import Volume

RED, GREEN, BLUE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
CENTRE = np.array([12.0, -40.0, 300.0])
"""Middle of all test volumes in RAS millimetres; each is about 100 mm wide, deep and high."""


def geometry_about_the_centre(shape_ijk: Sequence[int], matrix: np.ndarray) -> Geometry:
    """A grid whose middle is `CENTRE`; the columns of `matrix` (3, 3) are the steps along I, J and K in millimetres."""
    ijk_to_ras = np.eye(4)
    ijk_to_ras[:3, :3] = matrix
    ijk_to_ras[:3, 3] = CENTRE - np.array(matrix) @ ((np.array(shape_ijk) - 1) / 2)
    i, j, k = (int(count) for count in shape_ijk)
    return Geometry((k, j, i), ijk_to_ras)


def _oblique_left_handed() -> Geometry:
    turn = np.radians(20.0)
    rotation = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    tilt = np.array([[1, 0, 0], [0, np.cos(0.2), -np.sin(0.2)], [0, np.sin(0.2), np.cos(0.2)]])
    # Columns: i runs down, j to the right, k to the front.
    axes = np.array([[0, 1, 0], [0, 0, 1], [-1, 0, 0]])
    assert np.linalg.det(axes) < 0
    return geometry_about_the_centre((60, 50, 24), rotation @ tilt @ axes @ np.diag([1.7, 2.0, 4.2]))


GEOMETRIES: dict[str, Callable[[], Geometry]] = {
    "RAS": lambda: geometry_about_the_centre((50, 50, 50), np.diag([2.0, 2.0, 2.0])),
    "LPS": lambda: geometry_about_the_centre((50, 50, 50), np.diag([-2.0, -2.0, 2.0])),
    "thick slices": lambda: geometry_about_the_centre((64, 64, 10), np.diag([-1.6, -1.6, 10.0])),
    "oblique, left-handed, anisotropic": _oblique_left_handed,
}


def dark_volume(geometry: Geometry) -> Volume:
    """Zero but for one voxel in a corner."""
    array = np.zeros(geometry.shape, dtype=np.int16)
    array[0, 0, 0] = -1
    return Volume(array, geometry)


def distance_mm(geometry: Geometry, offset_ras: Sequence[float] = (0, 0, 0)) -> np.ndarray:
    """Distance of every voxel from the volume's middle, or from a place beside it; (K, J, I)."""
    ijk = np.argwhere(np.ones(geometry.shape, dtype=bool))[:, ::-1]
    ras = geometry.ijk_to_ras_points(ijk) - CENTRE - np.array(offset_ras)
    return np.linalg.norm(ras, axis=1).reshape(geometry.shape)


def ball(
    geometry: Geometry,
    name: str,
    color: Color,
    offset_ras: Sequence[float] = (0, 0, 0),
    radius_mm: float = 12.0,
    opacity: float = 1.0,
) -> PictureSegment:
    """A ball in the middle of the volume, or beside it."""
    return PictureSegment(name, color, opacity, distance_mm(geometry, offset_ras) < radius_mm)


def landmarks(geometry: Geometry) -> list[PictureSegment]:
    """A red ball to the patient's right, a green one in front, a blue one on top."""
    return [
        ball(geometry, "right", RED, (30, 0, 0)),
        ball(geometry, "front", GREEN, (0, 30, 0)),
        ball(geometry, "top", BLUE, (0, 0, 30)),
    ]


def pixels_of(picture: np.ndarray, color: Color) -> np.ndarray:
    """(H, W) bool: pixels that clearly have the hue of `color`, bright or dark."""
    rgb = picture.astype(float)
    strength = rgb.max(axis=2) - rgb.min(axis=2)
    difference_degrees = (_hue_degrees(rgb) - _hue_degrees(np.array(color)) + 180.0) % 360.0 - 180.0
    return (strength > 40) & (abs(difference_degrees) < 14.0)


def _hue_degrees(rgb: np.ndarray) -> np.ndarray:
    red, green, blue = np.moveaxis(rgb, -1, 0)
    return np.degrees(np.arctan2(np.sqrt(3.0) * (green - blue), 2 * red - green - blue))


def place_of(picture: np.ndarray, color: Color) -> np.ndarray:
    """Mean (x, y) of the pixels of a colour, as a share of the picture's size, from the top left."""
    y, x = np.nonzero(pixels_of(picture, color))
    assert len(x) > 20, f"colour {color} is not in the picture"
    return np.array([x.mean() / picture.shape[1], y.mean() / picture.shape[0]])
