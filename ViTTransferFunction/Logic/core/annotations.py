"""What the user said: classes with points on the structure and points off it, and the files that hold them."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .errors import InputError
from .geometry import LPS_TO_RAS, Geometry, transform_points

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

CLASS_FIELDS = frozenset({"name", "color", "opacity", "positive", "negative", "iso", "proximity", "refine"})


def _no_points() -> np.ndarray:
    return np.empty((0, 3))


@dataclass(frozen=True, eq=False)
class AnnotatedClass:
    """One structure of interest and everything the user set for it.

    Attributes:
        name: unique among the classes.
        color: red, green, blue in [0, 1].
        opacity: of its rendering, in [0, 1].
        positive: (N, 3) RAS millimetres, points on the structure, N ≥ 1.
        negative: (M, 3) RAS millimetres, points that are not of this structure.
        iso: threshold on the class's similarity map, in [0, 1]; None: chosen from the annotations.
        proximity: p̃ of the paper, in [0, 1]: how much similarity fades with distance from the positive points; 0: not at all.
        refine: whether the map is sharpened against the intensities.

    Raises:
        InputError: a field is out of range or there is no positive point.
    """

    name: str
    color: Color
    positive: np.ndarray
    negative: np.ndarray = field(default_factory=_no_points)
    opacity: float = 1.0
    iso: float | None = None
    proximity: float = 0.0
    refine: bool = True

    def __post_init__(self) -> None:
        if not self.name.strip():
            raise InputError("A class has an empty name; every class needs one.")
        for polarity in ("positive", "negative"):
            object.__setattr__(self, polarity, _as_points(getattr(self, polarity), f"{polarity} points of class '{self.name}'"))
        if not len(self.positive):
            raise InputError(f"Class '{self.name}' has no positive points; place at least one on the structure.")
        object.__setattr__(self, "color", _as_color(self.color, self.name))
        for name, value in (("opacity", self.opacity), ("iso", self.iso), ("proximity", self.proximity)):
            if value is not None and not (_is_number(value) and 0.0 <= value <= 1.0):
                raise InputError(f"'{name}' of class '{self.name}' is {value!r}; expected a number from 0 to 1.")
        if not isinstance(self.refine, bool):
            raise InputError(f"'refine' of class '{self.name}' is {self.refine!r}; expected true or false.")


def check_classes(classes: Sequence[AnnotatedClass], geometry: Geometry) -> None:
    """Raise InputError unless there are classes, their names differ, and every point lies inside the volume's box."""
    if not classes:
        raise InputError("There are no classes; annotate at least one structure.")
    name, count = Counter(c.name for c in classes).most_common(1)[0]
    if count > 1:
        raise InputError(f"{count} classes are named '{name}'; give each class a name of its own.")
    for annotated in classes:
        points = np.concatenate([annotated.positive, annotated.negative])
        outside = points[~geometry.contains(points)]
        if len(outside):
            position = ", ".join(f"{x:.1f}" for x in outside[0])
            raise InputError(
                f"{len(outside)} of {len(points)} points of class '{annotated.name}' lie outside the volume, the first at "
                f"RAS ({position}) mm. Check the coordinate system of the points, and that they belong to this volume."
            )


def read_annotations(path: Path, geometry: Geometry) -> list[AnnotatedClass]:
    """Read an annotation file: `{"coordinate_system": "RAS"|"LPS"|"IJK", "classes": [{"name", "positive", …}]}`.

    Args:
        path: JSON; of a class only `name` and `positive` are required (`AnnotatedClass` says what the others mean).
        geometry: of the annotated volume, to which IJK points refer.

    Raises:
        InputError: unreadable, not of this form, or a class is invalid.
    """
    content = _read_json(path)
    classes = content.get("classes") if isinstance(content, dict) else None
    if not isinstance(classes, list) or not all(isinstance(entry, dict) for entry in classes):
        raise InputError(f'{path} is not an annotation file: expected {{"coordinate_system": "RAS", "classes": [{{…}}, …]}}.')
    to_ras = _to_ras_matrix(content.get("coordinate_system"), geometry, path)
    return [_parse_class(entry, index, to_ras, path) for index, entry in enumerate(classes)]


def read_markups(path: Path) -> np.ndarray:
    """Control points of a Slicer markups file (`.mrk.json`), (N, 3) RAS millimetres; only points that were placed.

    Raises:
        InputError: unreadable or not a markups file.
    """
    content = _read_json(path)
    try:
        markups = content["markups"]
        points = [
            transform_points(_markups_to_ras(markup, path), np.array([point["position"]], dtype=float))[0]
            for markup in markups
            for point in markup["controlPoints"]
            if point.get("positionStatus", "defined") == "defined"
        ]
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{path} is not a Slicer markups file (.mrk.json): {error!r} while reading its points.") from error
    return _as_points(points, f"points of {path}")


def classes_from_markups(positive: dict[str, Path], negative: dict[str, Path]) -> list[AnnotatedClass]:
    """Classes from Slicer point lists, one file for each class and polarity.

    Raises:
        InputError: a negative list belongs to no class, or a file is not a markups file.
    """
    strangers = sorted(negative.keys() - positive.keys())
    if strangers:
        raise InputError(f"There are negative points for '{strangers[0]}' but no positive ones; give both for the class.")
    return [
        AnnotatedClass(
            name,
            default_color(index),
            positive=read_markups(path),
            negative=read_markups(negative[name]) if name in negative else _no_points(),
        )
        for index, (name, path) in enumerate(positive.items())
    ]


def default_color(index: int) -> Color:
    """The colour of the index-th class whose colour nobody chose."""
    return DEFAULT_COLORS[index % len(DEFAULT_COLORS)]


def _read_json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"Cannot read {path}: {error.strerror or error}.") from error
    except ValueError as error:
        raise InputError(f"{path} is not valid JSON: {error}.") from error


def _parse_class(entry: dict[str, Any], index: int, to_ras: np.ndarray, path: Path) -> AnnotatedClass:
    unknown = sorted(entry.keys() - CLASS_FIELDS)
    if unknown:
        raise InputError(
            f"{path}: class {index + 1} has an unknown field '{unknown[0]}'; known: {', '.join(sorted(CLASS_FIELDS))}."
        )
    if not isinstance(entry.get("name"), str):
        raise InputError(f"{path}: class {index + 1} has no name; expected a text under 'name'.")
    fields = {key: value for key, value in entry.items() if value is not None}
    fields.setdefault("color", default_color(index))
    for polarity in ("positive", "negative"):
        points = _as_points(fields.get(polarity, []), f"{polarity} points of class '{entry['name']}'")
        fields[polarity] = transform_points(to_ras, points)
    return AnnotatedClass(**fields)


def _to_ras_matrix(coordinate_system: Any, geometry: Geometry, path: Path) -> np.ndarray:
    matrices = {"RAS": np.eye(4), "LPS": LPS_TO_RAS, "IJK": geometry.ijk_to_ras}
    if coordinate_system not in matrices:
        raise InputError(f'{path}: \'coordinate_system\' is {coordinate_system!r}; expected "RAS", "LPS" or "IJK".')
    return matrices[coordinate_system]


def _markups_to_ras(markup: dict[str, Any], path: Path) -> np.ndarray:
    system = markup.get("coordinateSystem", "LPS")
    # Early files of the format number the systems.
    matrices = {"LPS": LPS_TO_RAS, "RAS": np.eye(4), "1": LPS_TO_RAS, "0": np.eye(4)}
    if str(system) not in matrices:
        raise InputError(f"{path}: unknown coordinate system {system!r}; expected LPS or RAS.")
    return matrices[str(system)]


def _as_points(points: Any, what: str) -> np.ndarray:
    try:
        array = np.array(points, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty((0, 0))
    if array.size == 0 and np.ndim(points) <= 2 and not len(points):
        return _no_points()
    if array.ndim != 2 or array.shape[1] != 3 or not np.isfinite(array).all():
        raise InputError(f"The {what} are not a list of finite [x, y, z] positions.")
    return array


def _as_color(color: Any, name: str) -> Color:
    """Accepts three numbers in [0, 1] or "#rrggbb"."""
    if isinstance(color, str) and len(color) == 7 and color.startswith("#"):
        try:
            red, green, blue = (int(color[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
            return red, green, blue
        except ValueError:
            pass  # Not hexadecimal: falls through to the one error message below.
    elif isinstance(color, (list, tuple)) and len(color) == 3 and all(_is_number(c) and 0.0 <= c <= 1.0 for c in color):
        return float(color[0]), float(color[1]), float(color[2])
    raise InputError(f"The color of class '{name}' is {color!r}; expected [red, green, blue] from 0 to 1, or \"#rrggbb\".")


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
