"""Where a 3D picture is taken from: directions by name or in degrees, the frame around what is shown, and cameras in files.

A camera is relative to what it sees: its places are RAS millimetres from the middle of the segments. Each scanner, and each
way of lying in it, has an origin of its own, so that a place in scanner coordinates would show one patient's liver and another
one's ceiling; relative to the segments, several cases are seen from one side, at one distance and so at one scale.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.vtkRenderingCore import vtkCamera

from ViTTransferFunction.Logic.core.atomic_file import replacing
from ViTTransferFunction.Logic.core.class_request import is_number
from ViTTransferFunction.Logic.core.errors import InputError, shown
from ViTTransferFunction.Logic.core.geometry import Geometry
from ViTTransferFunction.Logic.files.json_files import read_json

DEFAULT_HEIGHT = 1000
SMALLEST_SIDE, LARGEST_SIDE = 16, 8192
"""Pixels of a picture's side; above, software OpenGL begins to refuse."""

VIEW_ANGLE_DEGREES = 20.0
MARGIN = 1.05
NARROWEST, WIDEST = 0.75, 1.6
"""Width by height of a picture whose size nobody gave: neither a strip nor a panorama."""

TURNS = 24
"""Directions of a full turn that a film's frame is fitted to."""

RELATIVE_TO = "middle of the segments"

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
        return replace(self, position_mm=_vector(position), view_up=_vector(rotation @ np.array(self.view_up)))

    def placed(self, middle_ras: np.ndarray) -> vtkCamera:
        """The camera as VTK has it, where the segments' middle (3,) is at `middle_ras`."""
        camera = vtkCamera()
        camera.SetViewAngle(self.view_angle_degrees)
        camera.SetPosition(*(middle_ras + np.array(self.position_mm)))
        camera.SetFocalPoint(*(middle_ras + np.array(self.focal_point_mm)))
        camera.SetViewUp(*self.view_up)
        return camera


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
    seen_from: Direction = DEFAULT_DIRECTION,
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
    position = focal_point + max(distance, 1.0) * towards
    return Camera(_vector(position), _vector(focal_point), seen_from.up, size)


def write_camera(camera: Camera, path: Path) -> None:
    """Write a camera as JSON, whole or not at all.

    Raises:
        InputError: the file cannot be written.
    """
    content = {
        "coordinate_system": "RAS",
        "relative_to": RELATIVE_TO,
        "position_mm": _rounded(camera.position_mm),
        "focal_point_mm": _rounded(camera.focal_point_mm),
        "view_up": _rounded(camera.view_up),
        "view_angle_degrees": camera.view_angle_degrees,
        "size_pixels": list(camera.size),
    }
    lines = ",\n".join(f"  {json.dumps(name)}: {json.dumps(value)}" for name, value in content.items())
    with replacing(path) as temporary:
        temporary.write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")


def read_camera(path: Path) -> Camera:
    """Read a camera that `write_camera` wrote, or that somebody did by hand.

    Raises:
        InputError: it cannot be read, or is no camera.
    """
    content = read_json(path)
    if not isinstance(content, dict) or "position_mm" not in content or "focal_point_mm" not in content:
        raise InputError(f"{path} is not a camera; `vittf render … --save-camera {path.name}` writes one.")
    for field, expected in (("coordinate_system", "RAS"), ("relative_to", RELATIVE_TO)):
        if content.get(field) != expected:
            raise InputError(f"{path}: '{field}' is {shown(content.get(field))}; expected {expected!r}.")
    position, focal_point, up = (_as_vector(content, field, path) for field in ("position_mm", "focal_point_mm", "view_up"))
    towards = np.subtract(position, focal_point)
    # Not so close to parallel that rounding decides.
    if np.linalg.norm(np.cross(towards, up)) <= 1e-6 * np.linalg.norm(towards) * np.linalg.norm(up):
        raise InputError(
            f"{path}: 'position_mm' and 'focal_point_mm' have to differ, and not along 'view_up', which is up in the picture."
        )
    angle = content.get("view_angle_degrees", VIEW_ANGLE_DEGREES)
    if not is_number(angle) or not 0.1 <= angle <= 150.0:
        raise InputError(f"{path}: 'view_angle_degrees' is {shown(angle)}; expected 0.1 to 150.")
    size = content.get("size_pixels")
    if not isinstance(size, list) or len(size) != 2:
        raise InputError(f"{path}: 'size_pixels' is {shown(size)}; expected [width, height].")
    width, height = (checked_side(side, f"{path}: 'size_pixels'") for side in size)
    return Camera(position, focal_point, up, (width, height), float(angle))


def checked_side(side: Any, what: str) -> int:
    """A picture's width or height in pixels.

    Raises:
        InputError: it is no whole number, or out of range; the message begins with `what`.
    """
    if not isinstance(side, int) or isinstance(side, bool) or not SMALLEST_SIDE <= side <= LARGEST_SIDE:
        raise InputError(f"{what} has {shown(side)}; expected whole numbers of pixels from {SMALLEST_SIDE} to {LARGEST_SIDE}.")
    return side


def _as_vector(content: dict[str, Any], field: str, path: Path) -> Vector:
    values = content.get(field)
    if isinstance(values, list) and len(values) == 3 and all(is_number(value) and abs(value) <= 1e6 for value in values):
        return float(values[0]), float(values[1]), float(values[2])
    raise InputError(f"{path}: '{field}' is {shown(values)}; expected three numbers, of at most a million.")


def _rotation(degrees: float) -> np.ndarray:
    """The rotation matrix (3, 3) about the axis to the head that takes the front to the patient's left at 90°."""
    turn = np.radians(degrees)
    return np.array([[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])


def _vector(array: np.ndarray) -> Vector:
    return float(array[0]), float(array[1]), float(array[2])


def _rounded(vector: Vector) -> list[float]:
    """Short numbers, and no negative zeros."""
    return [round(value, 6) + 0.0 for value in vector]
