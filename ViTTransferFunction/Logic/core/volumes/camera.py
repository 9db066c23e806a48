"""Where a 3D picture is taken from: directions in degrees, and the frame around what is shown.

A camera is relative to what it sees: its places are RAS millimetres from the middle of the segments. Each scanner, and each
way of lying in it, has an origin of its own, so that a place in scanner coordinates would show one patient's liver and another
one's ceiling; relative to the segments, several cases are seen from one side, at one distance and so at one scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..system.errors import InputError, shown
from .geometry import Geometry

DEFAULT_HEIGHT = 1000
SMALLEST_SIDE, LARGEST_SIDE = 16, 8192
"""Pixels of a picture's side; above, software OpenGL begins to refuse."""

VIEW_ANGLE_DEGREES = 20.0
MARGIN = 1.05
NARROWEST, WIDEST = 0.75, 1.6
"""Width by height of a picture whose size nobody gave: neither a strip nor a panorama."""

TURNS = 24
"""Directions of a full turn that a film's frame is fitted to."""

Vector = tuple[float, float, float]
Size = tuple[int, int]
"""Width and height in pixels."""


@dataclass(frozen=True)
class Direction:
    """From which side something is seen.

    Attributes:
        towards: unit vector from it to the camera, RAS.
        up: unit vector that points up in the picture, RAS; at right angles to `towards`.
    """

    towards: Vector
    up: Vector


def direction(azimuth_degrees: float, elevation_degrees: float) -> Direction:
    """The direction at angles around the patient.

    Args:
        azimuth_degrees: 0 from the front, 90 from the patient's left, 180 from the back, −90 from the right.
        elevation_degrees: 0 level, 90 from above, −90 from below.
    """
    azimuth, elevation = np.radians(azimuth_degrees), np.radians(elevation_degrees)
    right, front = -float(np.sin(azimuth)), float(np.cos(azimuth))
    level, above = float(np.cos(elevation)), float(np.sin(elevation))
    return Direction((level * right, level * front, above), (-above * right, -above * front, level))


DEFAULT_DEGREES = 0.0, 8.0
"""Azimuth and elevation of pictures of which nobody said where from."""

DEFAULT_DIRECTION = direction(*DEFAULT_DEGREES)


@dataclass(frozen=True)
class Camera:
    """A camera, relative to what it sees.

    Attributes:
        position_mm: where it is, RAS from the middle of the segments.
        focal_point_mm: what it looks at, RAS from there.
        view_up: direction that points up in the picture, RAS, of any length.
        size: of its pictures.
        view_angle_degrees: between the picture's lower and upper edge.
    """

    position_mm: Vector
    focal_point_mm: Vector
    view_up: Vector
    size: Size
    view_angle_degrees: float = VIEW_ANGLE_DEGREES

    def turned(self, degrees: float) -> Camera:
        """This camera, moved around what it looks at, about the axis from the patient's feet to the head; like an azimuth."""
        focal_point = np.array(self.focal_point_mm)
        rotation = _rotation(degrees)
        position = focal_point + rotation @ (np.array(self.position_mm) - focal_point)
        return replace(self, position_mm=vector(position), view_up=vector(rotation @ np.array(self.view_up)))


def middle_of(geometry: Geometry, masks: Sequence[np.ndarray]) -> np.ndarray:
    """The middle of the box along R, A and S that holds the voxels of all masks (K, J, I), (3,) RAS millimetres.

    At least one mask has voxels.
    """
    ends = np.concatenate([geometry.ijk_to_ras_points(_ends_of_rows(mask)) for mask in masks])
    middle: np.ndarray = (ends.min(axis=0) + ends.max(axis=0)) / 2
    return middle


def _ends_of_rows(mask: np.ndarray) -> np.ndarray:
    """The first and the last voxel of each row of a mask, (N, 3) as (i, j, k): no other voxel reaches further."""
    k, j = np.nonzero(mask.any(axis=2))
    rows = mask[k, j]
    first, last = rows.argmax(axis=1), rows.shape[1] - 1 - rows[:, ::-1].argmax(axis=1)
    return np.concatenate([np.column_stack([first, j, k]), np.column_stack([last, j, k])])


def framing(
    points_ras: np.ndarray,
    middle_ras: np.ndarray,
    seen_from: Direction,
    *,
    height: int = DEFAULT_HEIGHT,
    size: Size | None = None,
    turning: bool = False,
) -> Camera:
    """A camera that sees all points.

    Args:
        points_ras: (N, 3), at least one.
        middle_ras: the segments' middle, (3,).
        seen_from: where from.
        height: of its pictures, in pixels; their width follows from what is seen.
        size: of its pictures, instead.
        turning: whether it sees them all from all sides that `Camera.turned` takes it to.
    """
    middle = (points_ras.min(axis=0) + points_ras.max(axis=0)) / 2
    towards, up = np.array(seen_from.towards), np.array(seen_from.up)
    angles = np.linspace(0.0, 360.0, TURNS, endpoint=False) if turning else [0.0]
    # Turning the points is turning the camera the other way.
    seen = [(points_ras - middle) @ _rotation(angle).T for angle in angles]
    across = [abs(points @ np.cross(up, towards)) for points in seen]
    along = [abs(points @ up) for points in seen]
    if size is None:
        extent = max(float(max(distances.max() for distances in along)), 1e-6)
        aspect = float(np.clip(max(distances.max() for distances in across) / extent, NARROWEST, WIDEST))
        size = round(aspect * height), height
    aspect = size[0] / size[1]
    slope = np.tan(np.radians(VIEW_ANGLE_DEGREES / 2)) / MARGIN
    distance = max(
        float((np.maximum(x / aspect, y) / slope + points @ towards).max())
        for points, x, y in zip(seen, across, along, strict=True)
    )
    focal_point = middle - middle_ras
    # What has no extent has no scale either.
    position = focal_point + (distance or 1.0) * towards
    return Camera(vector(position), vector(focal_point), seen_from.up, size)


def checked_side(side: Any, what: str) -> int:
    """A picture's width or height in pixels.

    Raises:
        InputError: it is no whole number, or out of range; the message begins with `what`.
    """
    if not isinstance(side, int) or isinstance(side, bool) or not SMALLEST_SIDE <= side <= LARGEST_SIDE:
        raise InputError(f"{what} has {shown(side)}; expected whole numbers of pixels from {SMALLEST_SIDE} to {LARGEST_SIDE}.")
    return side


def _rotation(degrees: float) -> np.ndarray:
    """The rotation matrix (3, 3) about the axis to the head that takes the front to the patient's left at 90°."""
    turn = np.radians(degrees)
    return np.array([[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])


def vector(array: np.ndarray) -> Vector:
    """The three numbers of an array (3,)."""
    return float(array[0]), float(array[1]), float(array[2])
