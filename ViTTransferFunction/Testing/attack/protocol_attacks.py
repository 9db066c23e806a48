"""The compute process: requests that are damaged, of another form, or absurd."""

from __future__ import annotations

import io
import json
import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ViTTransferFunction.Logic.compute.array_files import ArrayFiles
from ViTTransferFunction.Logic.compute.codec import to_message
from ViTTransferFunction.Logic.compute.messages import write_message
from ViTTransferFunction.Logic.compute.requests import (
    Cancel,
    ComputeMaps,
    Extract,
    MeasureMaps,
    Prepare,
    RefineMaps,
    Refinement,
    Render,
    SegmentClasses,
    TakeVolume,
)
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.volumes.geometry import LPS_TO_RAS, Geometry
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Testing.attack.calls import Call, Outcome
from ViTTransferFunction.Testing.attack.cases import Case, Place, Step
from ViTTransferFunction.Testing.attack.damage import change_json, damage_file
from ViTTransferFunction.Testing.attack.scans import Scan, make_scan

ENDED = frozenset({0, 1})
"""It ends with its input; or before, and says why."""


def changed_requests(chance: random.Random, place: Place) -> Case:
    """A conversation as the panel has it, with one request changed; it ends with its input, and leaves nothing."""
    folder = place.work / "arrays"
    folder.mkdir()
    lines = [_line(number, request, folder) for number, request in enumerate(_requests(make_scan(chance)), start=1)]
    at = chance.randrange(len(lines))
    what = chance.choice(
        ("changed", "changed", "changed", "no JSON", "long", "twice", "left out", "arrays damaged", "arrays gone")
    )
    if what == "changed":
        lines[at] = json.dumps(change_json(json.loads(lines[at]), chance))
    elif what == "no JSON":
        lines[at] = chance.choice(
            ("", "{", "null", "[]", "x" * 100, "[" * 50_000, '{"content": {}}', '{"content": {"number": 1}}')
        )
    elif what == "long":
        lines[at] = json.dumps({"content": {"number": 1, "body": {"type": "Prepare", "values": {"x": "a" * 300_000}}}})
    elif what == "twice":
        lines.insert(at, lines[at])
    elif what == "left out":
        del lines[at]
    else:
        path = chance.choice(sorted(folder.iterdir()))
        path.unlink() if what == "arrays gone" else damage_file(path, chance)
    given = "\n".join(lines) + chance.choice(("\n", "", "\n{"))
    call = Call(
        (str(folder),), str(place.work), place.environment, program="compute", given=given,
        given_for_s=chance.choice((0.0, 0.1, 0.5)),
    )  # fmt: skip

    def nothing_is_left(outcomes: Sequence[Outcome]) -> list[str]:
        # Who talks to it tidies up where it could not.
        return [f"left {len(list(folder.iterdir()))} files of arrays"] if folder.exists() and not outcomes[0].code else []

    return Case("protocol", f"{what}: {lines[min(at, len(lines) - 1)][:200]}", [Step((call,), ENDED)], judge=nothing_is_left)


def _requests(scan: Scan) -> list[Any]:
    ijk_to_ras = LPS_TO_RAS @ [*scan.ijk_to_lps, [0, 0, 0, 1]]
    geometry = Geometry(scan.array.shape, ijk_to_ras)
    classes = tuple(
        ClassRequest(name, geometry.ijk_to_ras_points(np.array([point])))
        for name, point in zip(("first", "second"), scan.inside, strict=True)
    )
    return [
        TakeVolume(scan.array, geometry, "scan"),
        Prepare(SessionSettings(grid=5, device="cpu")),
        Extract(),
        ComputeMaps(classes),
        MeasureMaps(classes),
        RefineMaps(classes, Refinement()),
        Render("similarity", (True, False), (True, False), True),
        Cancel((5,)),
        SegmentClasses(classes, Refinement()),
    ]


def _line(number: int, request: Any, folder: Path) -> str:
    stream = io.BytesIO()
    write_message(stream, to_message(number, request), ArrayFiles(folder) if number == 1 else _Files(folder, number))
    return stream.getvalue().decode().rstrip("\n")


class _Files(ArrayFiles):
    """Names files after the request."""

    def __init__(self, folder: Path, number: int) -> None:
        super().__init__(folder)
        for _ in range(100 * number):
            next(self._numbers)
