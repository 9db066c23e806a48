"""Cameras in files, so that several cases are seen alike."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..core.system.atomic_file import replacing
from ..core.system.errors import InputError, shown
from ..core.system.given_numbers import is_number
from ..core.volumes.camera import VIEW_ANGLE_DEGREES, Camera, Vector, checked_side
from .json_files import read_json

RELATIVE_TO = "middle of the segments"


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
        raise InputError(
            f"{path} is not a camera. Save beside Camera, in panel and app, and `vittf render --save-camera` write one."
        )
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


def _as_vector(content: dict[str, Any], field: str, path: Path) -> Vector:
    values = content.get(field)
    if isinstance(values, list) and len(values) == 3 and all(is_number(value) and abs(value) <= 1e6 for value in values):
        return float(values[0]), float(values[1]), float(values[2])
    raise InputError(f"{path}: '{field}' is {shown(values)}; expected three numbers, of at most a million.")


def _rounded(vector: Vector) -> list[float]:
    """Short numbers, and no negative zeros."""
    return [round(value, 6) + 0.0 for value in vector]
