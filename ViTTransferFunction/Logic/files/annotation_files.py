"""Reads annotations from our own JSON files and from Slicer's markups files, and writes the former."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..core.classes.annotated_class import AnnotatedClass, scan_of
from ..core.classes.class_request import ClassRequest, as_points, check_name, no_points
from ..core.classes.close_up import CloseUp
from ..core.classes.colors import Color, default_color
from ..core.classes.diameter_points import points_of_diameter
from ..core.classes.iso_proposals import LARGEST_SIZE, SMALLEST_SIZE
from ..core.classes.region_points import points_of_outline
from ..core.system.atomic_file import replacing
from ..core.system.errors import InputError, shown
from ..core.system.given_numbers import FARTHEST, is_number
from ..core.volumes.geometry import LPS_TO_RAS, Geometry, transform_points
from ..core.volumes.thumbnail import Thumbnail
from .closed_curve import closed_curve_through
from .json_files import read_json

ANNOTATIONS_ENDING = ".annotations.json"
"""Appended to the volume's name without its ending. `.json` alone would not do: DICOM converters write `scan.json` beside
`scan.nii.gz`."""

CLASS_FIELDS = frozenset({"name", "color", "opacity", "positive", "negative", "iso", "size", "proximity", "refine", "close_up"})

_PLACED_ON = "placed_on"
"""Field of a file with the `Thumbnail` of the scan that its points were placed on."""

NAMED_SIZES = {"smaller": -1.0, "larger": 1.0}
"""Names for values of `ClassRequest.size`."""


def read_annotations(path: Path, geometry: Geometry) -> list[AnnotatedClass]:
    """Read an annotation file: `{"coordinate_system": "RAS"|"LPS"|"IJK", "classes": [{"name", "positive", …}]}`.

    Args:
        path: JSON; classes need only `name` and `positive` (`ClassRequest` and `AnnotatedClass` explain the other fields).
        geometry: of the annotated volume, to which IJK points refer.

    Raises:
        InputError: the file cannot be read or has another form, or a class is invalid.
    """
    _check_is_no_older_list(path)
    content = read_json(path)
    classes = content.get("classes") if isinstance(content, dict) else None
    if isinstance(content, dict) and "markups" in content and classes is None:
        raise InputError(
            f"{path} has markups of Slicer's, of one class and without its name. `vittf segment` takes them by "
            f"--positive NAME={path.name}. Of those that Slicer has open, the panel takes lines, closed curves and ROIs: "
            "right-click the structure, Points inside from a markup."
        )
    if not isinstance(classes, list) or not all(isinstance(entry, dict) for entry in classes):
        raise InputError(f'{path} is not an annotation file: expected {{"coordinate_system": "RAS", "classes": [{{…}}, …]}}.')
    to_ras = _to_ras_matrix(content.get("coordinate_system"), geometry, path)
    placed_on = _placed_on(content.get(_PLACED_ON))
    return [replace(_parse_class(entry, index, to_ras, path), placed_on=placed_on) for index, entry in enumerate(classes)]


def write_annotations(classes: Sequence[AnnotatedClass], path: Path, about: Mapping[str, str] | None = None) -> None:
    """Write classes as an annotation file, completely or not at all.

    Classes that are read from it are equal to these except for their ids, which become their names.

    Args:
        classes: have different names, which are the only identification in the file.
        path: JSON.
        about: further fields of the file, by name; readers of annotations ignore them.

    Raises:
        InputError: the file cannot be written.
    """
    fields = {"coordinate_system": "RAS", **(about or {})}
    start = ",\n ".join(f'"{field}": {json.dumps(value, ensure_ascii=False)}' for field, value in fields.items())
    entries = ",\n  ".join(json.dumps(_entry(annotated), ensure_ascii=False) for annotated in classes)
    with replacing(path) as temporary:
        temporary.write_text(f'{{{start},\n "classes": [\n  {entries}]{_placed_on_field(classes)}}}\n', encoding="utf-8")


def _placed_on_field(classes: Sequence[AnnotatedClass]) -> str:
    """The field belongs to the whole file, since programs that do not know it refuse unknown fields of classes only."""
    placed_on = scan_of(classes)
    return "" if placed_on is None else f',\n "{_PLACED_ON}": "{placed_on.to_text()}"'


def _entry(annotated: AnnotatedClass) -> dict[str, Any]:
    """The file's entry for a class, without the settings that have their default values."""
    request = annotated.request
    entry: dict[str, Any] = {
        "name": request.name,
        "color": annotated.color,
        "positive": request.positive.tolist(),
        "negative": request.negative.tolist(),
    }
    settings = {
        "opacity": (annotated.opacity, 1.0),
        "iso": (request.iso, None),
        # Of no effect beside an iso, and refused there.
        "size": (request.size if request.iso is None else 0.0, 0.0),
        "proximity": (request.proximity, 0.0),
        "refine": (request.refine, True),
        "close_up": (_close_up_entry(annotated), None),
    }
    return entry | {field: value for field, (value, otherwise) in settings.items() if value != otherwise}


def _close_up_entry(annotated: AnnotatedClass) -> dict[str, Any] | bool | None:
    if annotated.close_up_from_map:
        return True
    close_up = annotated.request.close_up
    return None if close_up is None else {"center": close_up.centre_ras, "size_mm": close_up.size_mm}


class Markups(NamedTuple):
    """Points that markups represent, RAS millimetres.

    Attributes:
        inside: (N, 3) points of point lists; and points inside lines and closed curves, as far as they lie in the volume.
        outside: (M, 3) points beyond the ends of lines, which are diameters of structures, and around closed curves, which are
            outlines.
        outline: (P, 3) points along the curve, if the file has a single closed curve and nothing else.
    """

    inside: np.ndarray
    outside: np.ndarray
    outline: np.ndarray | None = None


def read_markups(path: Path, geometry: Geometry) -> Markups:
    """Read a Slicer markups file (`.mrk.json`); only control points that were placed count.

    Args:
        path: of the file.
        geometry: of the volume that they were drawn in.

    Raises:
        InputError: the file cannot be read, is not a markups file, or has boxes or planes; or a line or curve is incomplete, or
            has no point in the volume.
    """
    _check_is_no_older_list(path)
    content = read_json(path)
    if isinstance(content, dict) and "classes" in content and "markups" not in content:
        raise InputError(
            f"{path} is an annotation file, of all classes; `vittf segment` takes it by --annotations {path.name}."
        )
    try:
        _check_points(content["markups"], path)
        lists = [_points_of(markup, path, geometry) for markup in content["markups"]]
    except (LookupError, TypeError, AttributeError) as error:
        raise InputError(
            f"{path} is not a Slicer markups file (.mrk.json), which has control points with their positions under 'markups'. "
            "Save the point list again in Slicer."
        ) from error
    if len(lists) == 1:
        return lists[0]
    inside, outside = ([no_points(), *(getattr(each, polarity) for each in lists)] for polarity in ("inside", "outside"))
    return Markups(np.concatenate(inside), np.concatenate(outside))


def _check_is_no_older_list(path: Path) -> None:
    if path.suffix.lower() == ".fcsv":
        raise InputError(
            f"{path} is a point list of an older Slicer; open it in Slicer, and save it as .mrk.json, which `vittf segment` "
            "takes by --positive."
        )


def _points_of(markup: dict[str, Any], path: Path, geometry: Geometry) -> Markups:
    points = as_points(_placed(markup["controlPoints"]), f"points of {path}")
    points_ras = transform_points(_markups_to_ras(markup, path), points)
    kind, count = markup.get("type"), len(points_ras)
    if kind == _LINE and count != 2:
        raise InputError(f"{path} holds a line with {count} of its ends placed; expected 2. Draw it to its end in Slicer.")
    if kind == _CURVE and count < 3:
        raise InputError(
            f"{path} holds a closed curve with {count} points placed; expected 3 or more. Draw it around in Slicer."
        )
    try:
        if kind == _LINE:
            return _within(Markups(*points_of_diameter(points_ras, geometry.body_scale)), geometry, "line")
        if kind == _CURVE:
            outline = closed_curve_through(points_ras)
            return _within(Markups(*points_of_outline(outline, geometry.body_scale), outline), geometry, "curve")
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return Markups(points_ras, no_points())


def _within(drawn: Markups, geometry: Geometry, what: str) -> Markups:
    """Drop inside points beyond the volume, since a structure that it cuts off is drawn completely."""
    inside = drawn.inside[geometry.contains(drawn.inside)]
    if not len(inside):
        raise InputError(f"No part of the {what} lies in the volume. Draw it on the volume that is segmented.")
    return drawn._replace(inside=inside)


def _check_points(markups: list[dict[str, Any]], path: Path) -> None:
    """Raise InputError for markups whose control points lie around a structure, since these would be taken for points on it."""
    kind = next((markup["type"] for markup in markups if markup.get("type") in _ENCLOSING), None)
    if kind is not None:
        raise InputError(
            f"{path} holds markups of the type {kind}, whose control points lie around a structure and not on it; expected a "
            "point list, a line across the structure, or a closed curve around it. In Slicer, the module makes points of boxes."
        )


_ENCLOSING = ("ROI", "Plane")
_LINE, _CURVE = "Line", "ClosedCurve"


def _placed(points: list[dict[str, Any]]) -> list[Any]:
    return [point["position"] for point in points if point.get("positionStatus", "defined") == "defined"]


def classes_from_markups(positive: dict[str, Path], negative: dict[str, Path], geometry: Geometry) -> list[AnnotatedClass]:
    """Classes from Slicer's markups, one file for each class and polarity.

    Args:
        positive: file of each class: its points, lines across it, or closed curves around it.
        negative: files of some of these classes, with points outside the class.
        geometry: of the annotated volume. Outside points of lines and curves that lie beyond the volume are left out.

    Raises:
        InputError: a negative list belongs to no class or has lines or curves, or a file is refused by `read_markups`.
    """
    strangers = sorted(negative.keys() - positive.keys())
    if strangers:
        raise InputError(f"There are negative points for '{strangers[0]}' but no positive ones; give both for the class.")
    classes = []
    for index, (name, path) in enumerate(positive.items()):
        inside, beyond, outline = read_markups(path, geometry)
        off = _read_negative(negative[name], geometry) if name in negative else no_points()
        outside = np.concatenate([off, beyond[geometry.contains(beyond)]])
        classes.append(AnnotatedClass(ClassRequest(name, inside, outside), default_color(index), outline_ras=outline))
    return classes


def _read_negative(path: Path, geometry: Geometry) -> np.ndarray:
    points, beyond, _ = read_markups(path, geometry)
    if len(beyond):
        raise InputError(
            f"{path} holds a line or a closed curve, which is the diameter or the outline of a structure; expected a point "
            "list. Give it by --positive."
        )
    return points


def _parse_class(entry: dict[str, Any], index: int, to_ras: np.ndarray, path: Path) -> AnnotatedClass:
    unknown = sorted(entry.keys() - CLASS_FIELDS)
    if unknown:
        raise InputError(
            f"{path}: class {index + 1} has an unknown field {shown(unknown[0])}; known: {', '.join(sorted(CLASS_FIELDS))}."
        )
    if not isinstance(entry.get("name"), str):
        raise InputError(f"{path}: class {index + 1} has no name; expected a text under 'name'.")
    check_name(entry["name"])
    fields = {key: value for key, value in entry.items() if value is not None}
    name = fields.pop("name")
    color, opacity = _as_color(fields.pop("color", default_color(index)), name), fields.pop("opacity", 1.0)
    for polarity in ("positive", "negative"):
        points = as_points(fields.get(polarity, []), f"{polarity} points of class '{name}'")
        fields[polarity] = transform_points(to_ras, points)
    fields["size"] = _as_size(fields.get("size", 0.0), name)
    if fields["size"] and "iso" in fields:
        raise InputError(f"Class '{name}' has an 'iso' and a 'size'; give one of them: a size changes the iso that is chosen.")
    close_up = fields.pop("close_up", False)
    if not isinstance(close_up, bool):
        fields["close_up"] = _as_close_up(close_up, to_ras, name)
    return AnnotatedClass(ClassRequest(name, **fields), color, opacity, close_up_from_map=close_up is True)


def _placed_on(text: Any) -> Thumbnail | None:
    return Thumbnail.from_text(text) if isinstance(text, str) else None


def _to_ras_matrix(coordinate_system: Any, geometry: Geometry, path: Path) -> np.ndarray:
    matrices = {"RAS": np.eye(4), "LPS": LPS_TO_RAS, "IJK": geometry.ijk_to_ras}
    if not isinstance(coordinate_system, str) or coordinate_system not in matrices:
        given = "missing" if coordinate_system is None else shown(coordinate_system)
        raise InputError(f'{path}: \'coordinate_system\' is {given}; expected "RAS", "LPS" or "IJK".')
    return matrices[coordinate_system]


def _markups_to_ras(markup: dict[str, Any], path: Path) -> np.ndarray:
    units = markup.get("coordinateUnits") or "mm"
    # Either a string, or a list of a UCUM code, the name of that coding scheme, and the code's meaning.
    if (units[0] if isinstance(units, list) else units) != "mm":
        raise InputError(
            f"{path} gives its positions in the unit {shown(units)}; expected millimetres ('mm'). Save the point list in a "
            "scene of Slicer whose unit of length is that."
        )
    system = markup.get("coordinateSystem", "LPS")
    # Early files of the format have numbers for the coordinate systems.
    matrices = {"LPS": LPS_TO_RAS, "RAS": np.eye(4), "1": LPS_TO_RAS, "0": np.eye(4)}
    if str(system) not in matrices:
        raise InputError(f"{path}: unknown coordinate system {shown(system)}; expected LPS or RAS.")
    return matrices[str(system)]


def _as_size(size: Any, name: str) -> Any:
    """Replace a named size by its number; numbers are checked by `ClassRequest`."""
    if not isinstance(size, str):
        return size
    if size not in NAMED_SIZES:
        raise InputError(
            f"The size of class '{name}' is {shown(size)}; expected {' or '.join(map(repr, NAMED_SIZES))}, or a number from "
            f"{SMALLEST_SIZE:g} to {LARGEST_SIZE:g}."
        )
    return NAMED_SIZES[size]


def _as_close_up(close_up: Any, to_ras: np.ndarray, name: str) -> CloseUp:
    """Parse a box that is given by its centre, in the file's coordinate system, and its edges along the volume's axes."""
    if not isinstance(close_up, dict) or close_up.keys() != {"center", "size_mm"}:
        raise InputError(
            f"'close_up' of class '{name}' is {shown(close_up)}; expected true, for a box that is chosen from the points, or "
            'the box itself: {"center": [x, y, z], "size_mm": [i, j, k]}.'
        )
    for field, above, expected in (("center", -FARTHEST, "three numbers"), ("size_mm", 0.0, "three numbers above 0")):
        values = close_up[field]
        if not isinstance(values, list) or len(values) != 3 or not all(is_number(v) and above < v < FARTHEST for v in values):
            raise InputError(
                f"'{field}' of the close-up of class '{name}' is {shown(values)}; expected {expected}, below {FARTHEST:g}."
            )
    return CloseUp(tuple(transform_points(to_ras, np.array([close_up["center"]], float))[0].tolist()), close_up["size_mm"])


def _as_color(color: Any, name: str) -> Color:
    """Parse a colour that is given as three numbers in [0, 1] or as "#rrggbb"."""
    if isinstance(color, str) and len(color) == 7 and color.startswith("#"):
        try:
            red, green, blue = (int(color[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
            return red, green, blue
        except ValueError:
            pass  # Not hexadecimal: falls through to the one error message below.
    elif isinstance(color, (list, tuple)) and len(color) == 3 and all(is_number(c) and 0.0 <= c <= 1.0 for c in color):
        return float(color[0]), float(color[1]), float(color[2])
    raise InputError(f"The color of class '{name}' is {shown(color)}; expected [red, green, blue] from 0 to 1, or \"#rrggbb\".")
