"""Annotation files and point lists that are damaged, of another form, or absurd."""

from __future__ import annotations

import json
import random
from typing import Any

from ViTTransferFunction.Testing.attack.cases import Case, Place, Step, annotated
from ViTTransferFunction.Testing.attack.damage import change_json, damage_file
from ViTTransferFunction.Testing.attack.scans import Scan, make_scan, nrrd, nrrd_fields

REFUSED = frozenset({2})
DEEP = 100_000
"""Nesting beyond what Python's parser of JSON follows."""


def changed_annotations(chance: random.Random, place: Place) -> Case:
    """The form of an annotation file, with other values, entries and types in it."""
    scan = write_scan(chance, place)
    content = change_json(full_annotations(scan), chance)
    (place.work / "clicks.json").write_text(json.dumps(content))
    call = place.segment("scan.nrrd", *chance.choice(([], ["--similarity-dir", "maps"], ["--report", "r.json"])))
    return Case("annotations", json.dumps(content)[:300], [Step((call,))], scan)


def damaged_annotations(chance: random.Random, place: Place) -> Case:
    """A file that is no annotation file, or no JSON, or no text."""
    scan = write_scan(chance, place)
    path, text = place.work / "clicks.json", json.dumps(full_annotations(scan))
    files: dict[str, Any] = {
        "bytes": lambda: path.write_bytes(chance.randbytes(chance.choice((0, 1, 100)))),
        "damaged": lambda: (path.write_text(text), damage_file(path, chance)),
        "UTF-16": lambda: path.write_text(text, encoding="utf-16"),
        "byte order mark": lambda: path.write_text("\ufeff" + text, encoding="utf-8"),
        "Latin-1": lambda: path.write_text(text.replace("second", "Glühwein"), encoding="latin-1"),
        "lists in lists": lambda: path.write_text("[" * DEEP),
        "objects in objects": lambda: path.write_text('{"classes":' * DEEP + "1" + "}" * DEEP),
        "deep points": lambda: path.write_text(text.replace('"negative": [', '"negative": [' + "[" * 900 + "]" * 900 + ",", 1)),
        "long number": lambda: path.write_text(text.replace("IJK", "IJK\", \"iso\": " + "9" * 10_000 + ", \"x\": \"", 1)),
        "long iso": lambda: path.write_text(text.replace('"size": 0.5', f'"size": {"1" * 4000}')),
        "same key twice": lambda: path.write_text(text[:-1] + ', "classes": []}'),
        "folder": lambda: path.mkdir(),
        "the volume": lambda: path.write_bytes((place.work / "scan.nrrd").read_bytes()),
        "device": lambda: path.symlink_to(chance.choice(("/dev/null", "/dev/zero", "/dev/full"))),
        "missing": lambda: None,
        "a point list": lambda: path.write_text(json.dumps(point_list(scan, 0))),
    }  # fmt: skip
    what = chance.choice(list(files))
    path.unlink()
    files[what]()
    return Case("annotations", what, [Step((place.segment("scan.nrrd"),))], scan)


def many_points(chance: random.Random, place: Place) -> Case:
    """More points, classes and longer names than anybody clicks."""
    scan = write_scan(chance, place)
    content = annotated(scan)
    many, (first, second) = chance.choice((100, 3000, 50_000)), content["classes"]
    what = chance.choice(("one point", "different points", "classes", "long names", "odd names"))
    if what == "one point":
        first["positive"] *= many
    elif what == "different points":
        last = [size - 1 for size in scan.array.shape[::-1]]
        first["positive"] = [[chance.uniform(0, end) for end in last] for _ in range(many)]
    elif what == "classes":
        many = chance.choice((20, 254, 255, 256, 300))
        content["classes"] = [{**first, "name": f"class {n}", "negative": []} for n in range(many)]
    elif what == "long names":
        first["name"] = chance.choice("aü患") * chance.choice((100, 255, 5000))
    else:
        first["name"], second["name"] = chance.choice((
            ("a/b", "a:b"), ("A", "a"), ("..", "."), ("", "x"), (" ", "x"), ("\ud800", "x"), ("nul", "CON"), ("a\nb", "a b"),
            ("\x00", "\x01"), ("ä", "a\u0308"), ("|", "||"), ("Segment_1", "Segment_2"),
        ))  # fmt: skip
        many = 2
    (place.work / "clicks.json").write_text(json.dumps(content))
    further = chance.choice(([], [], ["--similarity-dir", "maps"], ["--report", "r.json"]))
    call = place.segment("scan.nrrd", *further, output=chance.choice(("out.seg.nrrd", "out.nii.gz")))
    return Case("annotations", f"{what}: {many}", [Step((call,))], scan)


def point_lists(chance: random.Random, place: Place) -> Case:
    """Slicer's point lists, with other values, entries and types in them."""
    scan = write_scan(chance, place)
    for which, name in enumerate(("first", "second")):
        content = point_list(scan, which)
        if which == 0 and chance.random() < 0.9:
            content = change_json(content, chance)
        (place.work / f"{name}.mrk.json").write_text(json.dumps(content))
    positive = chance.choice(("first=first.mrk.json",) * 4 + ("first", "=", "first=", "=first.mrk.json", "a=b=c", "first=."))
    further = chance.choice(([], ["--negative", "first=second.mrk.json"], ["--positive", "second=second.mrk.json"]))
    call = place.call("segment", "scan.nrrd", "--positive", positive, *further, "--grid", "5", "-o", "out.seg.nrrd")
    return Case("point lists", positive, [Step((call,))], scan)


def write_scan(chance: random.Random, place: Place) -> Scan:
    """A sound volume, `scan.nrrd`, and points on it, `clicks.json`."""
    scan = make_scan(chance, ("int16", "float32"))
    (place.work / "scan.nrrd").write_bytes(nrrd(nrrd_fields(scan), scan.array))
    place.write_clicks(scan)
    return scan


def full_annotations(scan: Scan) -> dict[str, Any]:
    """An annotation file's content with every field that there is."""
    content = annotated(scan)
    content["classes"][0] |= {"color": [1.0, 0.5, 0.0], "opacity": 0.5, "size": 0.5, "proximity": 0.3, "refine": True}
    content["classes"][1] |= {"color": "#10ff20", "iso": 0.4, "close_up": {"center": scan.inside[1], "size_mm": [9, 8.5, 7]}}
    content["classes"][0]["close_up"] = True
    return content


def point_list(scan: Scan, which: int) -> dict[str, Any]:
    """A point list as Slicer writes it, with a point on one of the structures."""
    position = (scan.ijk_to_lps @ [*scan.inside[which], 1]).tolist()
    point = {"id": "1", "label": "F-1", "position": position, "selected": True, "positionStatus": "defined"}
    markup = {"type": "Fiducial", "coordinateSystem": "LPS", "coordinateUnits": "mm", "controlPoints": [point]}
    return {
        "@schema": "https://raw.githubusercontent.com/slicer/slicer/master/markups-schema-v1.0.3.json#",
        "markups": [markup],
    }
