"""`vittf render` on segmentations that are damaged, empty, elsewhere, or of another form, and with odd cameras and films."""

from __future__ import annotations

import json
import random
from dataclasses import replace

import numpy as np
import SimpleITK as sitk  # noqa: N813

from ViTTransferFunction.Testing.attack.annotation_attacks import write_scan
from ViTTransferFunction.Testing.attack.cases import Case, Place, Step
from ViTTransferFunction.Testing.attack.damage import change_json, damage_file
from ViTTransferFunction.Testing.attack.option_attacks import NUMBERS
from ViTTransferFunction.Testing.attack.scans import Scan


def pictures(chance: random.Random, place: Place) -> Case:
    """Most are refused, since drawing takes seconds."""
    scan = write_scan(chance, place)
    what = chance.choice((
        "sound", "empty", "elsewhere", "float", "negative", "NaN", "damaged", "the volume", "no file", "the output",
        "not a picture",
        "annotations of others", "large numbers", "Segment tags",
    ))  # fmt: skip
    labels = (scan.array > 30).astype(np.uint8) + (scan.array > 90)
    name, output, further = "labels.nrrd", "p.png", []
    shown = replace(scan, array=labels)
    if what == "empty":
        shown = replace(scan, array=labels * 0)
    elif what == "elsewhere":
        shown = replace(scan, array=labels, origin=scan.origin + 1e5)
    elif what in ("float", "NaN"):
        values = labels.astype(np.float32) * 1.5
        values[0, 0, 0] = np.nan if what == "NaN" else 0.25
        shown = replace(scan, array=values)
    elif what == "negative":
        shown = replace(scan, array=-labels.astype(np.int16))
    elif what == "large numbers":
        shown = replace(scan, array=labels.astype(np.uint32) * 3_000_000)
    _write(place, shown, name, tags=what == "Segment tags", chance=chance)
    if what == "damaged":
        damage_file(place.work / name, chance)
    elif what == "the volume":
        name = "scan.nrrd"
    elif what == "no file":
        name = "missing.nrrd"
    elif what == "the output":
        output = chance.choice(("scan.nrrd", "labels.nrrd", "clicks.json", "", ".", "missing/p.png", "clicks.json/p.png"))
    elif what == "not a picture":
        output = chance.choice(("p.jpg", "p", "p.PNG", "p.png.nii", "a" * 300 + ".png", "~nosuchuser/p.png"))
    elif what == "annotations of others":
        further = ["--annotations", "clicks.json"]
    call = place.call("render", "scan.nrrd", name, "-o", output, *further)
    return Case("pictures", f"{what}: {name} to {output[:40]}", [Step((call,))], scan)


def views(chance: random.Random, place: Place) -> Case:
    """Cameras that are damaged, sizes and angles of any value, films that cannot be, outputs in each other's place."""
    scan = write_scan(chance, place)
    _write(place, replace(scan, array=(scan.array > 30).astype(np.uint8)), "labels.nrrd", tags=False, chance=chance)
    camera = {
        "coordinate_system": "RAS", "relative_to": "middle of the segments", "position_mm": [0, 900, 80],
        "focal_point_mm": [0, 0, 0], "view_up": [0, 0, 1], "view_angle_degrees": 20, "size_pixels": [64, 48],
    }  # fmt: skip
    what = chance.choice(("camera", "camera", "damaged camera", "numbers", "numbers", "film", "outputs"))
    if what == "camera":
        camera = change_json(camera, chance)
    (place.work / "camera.json").write_text(json.dumps(camera), encoding="utf-8")
    if what == "damaged camera":
        damage_file(place.work / "camera.json", chance)
    options = {"--3d": "p.png"}
    if "camera" in what:
        options["--camera"] = "camera.json"
    elif what == "numbers":
        options["--size"] = chance.choice(("64x48", *(f"{chance.choice(NUMBERS)}x{chance.choice(NUMBERS)}" for _ in range(3))))
        for name in ("--azimuth", "--elevation"):
            options[name] = chance.choice(("10", *NUMBERS))
    elif what == "film":
        options = {"--turntable": chance.choice(("f.gif", "f.mp4", "f", "f.avi", "scan.nrrd")), "--size": "64x48"}
        options |= {
            "--frames": chance.choice(("2", *NUMBERS[:2], "1e9", "99999999")),
            "--seconds": chance.choice(("1", *NUMBERS)),
        }
    else:
        same = chance.choice(("p.png", "scan.nrrd", "labels.nrrd", "camera.json", "c.json", "missing/c.json"))
        options |= {"--camera": "camera.json", chance.choice(("--save-camera", "--3d", "-o")): same}
    given = [part for name, value in options.items() for part in (name, value)]
    call = place.call("render", "scan.nrrd", "labels.nrrd", *given)
    return Case("views", f"{what}: {' '.join(given)}"[:200], [Step((call,))], scan)


def _write(place: Place, shown: Scan, name: str, tags: bool, chance: random.Random) -> None:
    image = shown.image()
    if tags:
        for key in ("Segment0_ID", "Segment0_Name", "Segment0_Color", "Segment0_LabelValue", "Segment0_Layer"):
            if chance.random() < 0.8:
                image.SetMetaData(key, chance.choice(("1", "0.5 0.5 0.5", "x", "nan nan nan", "9" * 30, "-1")))
    sitk.WriteImage(image, str(place.work / name))
    if tags:
        (place.work / name).rename(place.work / "labels.seg.nrrd")
        (place.work / "labels.seg.nrrd").rename(place.work / name)
