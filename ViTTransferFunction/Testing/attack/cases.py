"""A case: files in a folder, runs of the program on them, and what has to come of it."""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ViTTransferFunction.Testing.attack.calls import Call, Outcome
from ViTTransferFunction.Testing.attack.scans import Scan

OUTPUT_OPTIONS = ("-o", "--output", "--report", "--similarity-dir", "--3d", "--turntable", "--save-camera")
INPUT_OPTIONS = ("--annotations", "--weights", "--positive", "--negative", "--camera")
DONE_OR_REFUSED = frozenset({0, 2})


@dataclass(frozen=True)
class Step:
    """Runs that start together.

    Attributes:
        calls: the runs.
        codes: exit codes that are right.
        late: whether it may turn out late that a run cannot be finished; what it has written until then is whole, and stays.
        before: done to the files first.
    """

    calls: tuple[Call, ...]
    codes: frozenset[int] = DONE_OR_REFUSED
    late: bool = False
    before: Callable[[], object] = lambda: None


@dataclass(frozen=True)
class Case:
    """An attack.

    Attributes:
        kind: what is attacked.
        what: in a few words, how.
        steps: done one after the other.
        scan: where the truth about the volume is known, the labels' grid is compared to it.
        alike: whether all label maps that come out must be the same.
        judge: a further look at the files when all is done, and at how the runs ended; says what is wrong.
        tidy_up: done at the end, whatever happened.
    """

    kind: str
    what: str
    steps: Sequence[Step]
    scan: Scan | None = None
    alike: bool = False
    judge: Callable[[Sequence[Outcome]], Iterable[str]] = field(default=lambda _: ())
    tidy_up: Callable[[], object] = field(default=lambda: None)


class Place:
    """The folder of a case.

    Attributes:
        work: working folder of the runs: their inputs and outputs.
        cache: the program's cache.
        other_cache: one for runs that are compared to.
        home: the user's home, in which nothing may appear.
        temporary: for temporary files, of which none may stay.
        weights: file of the tiny network.
    """

    def __init__(self, folder: Path, weights: Path) -> None:
        self.work, self.home, self.temporary = (folder / name for name in ("work", "home", "temporary"))
        self.cache, self.other_cache = folder / "cache", folder / "other cache"
        self.weights = weights
        for each in (folder, self.work, self.home, self.temporary):
            each.mkdir(exist_ok=True)
            # A run may be another user's.
            each.chmod(0o777)

    @property
    def environment(self) -> dict[str, str]:
        """Variables of every run. No address can be reached."""
        return {
            "PATH": "/usr/bin:/bin",
            "HOME": str(self.home),
            "TMPDIR": str(self.temporary),
            "VITTF_CACHE": str(self.cache),
            "VITTF_WEIGHTS": str(self.weights),
            "OMP_NUM_THREADS": "1",
            "https_proxy": "http://127.0.0.1:9",
            "http_proxy": "http://127.0.0.1:9",
            "PIP_NO_INDEX": "1",
        }

    def call(self, *arguments: str | Path, **of_call: Any) -> Call:
        """A run of `vittf`."""
        environment = {**self.environment, **of_call.pop("environment", {})}
        return Call(tuple(map(str, arguments)), str(self.work), environment, **of_call)

    def segment(self, volume: str, *further: str | Path, output: str = "out.nii.gz", **of_call: Any) -> Call:
        """A run of `vittf segment` with `clicks.json` on a small grid; further arguments count more."""
        arguments = ["segment", volume, "--annotations", "clicks.json", "--grid", "5", "-o", output, *further]
        return self.call(*arguments, **of_call)

    def write_clicks(self, scan: Scan, **fields: Any) -> None:
        """Write `clicks.json`, one point on either structure."""
        content = {**annotated(scan), **fields}
        (self.work / "clicks.json").write_text(json.dumps(content))


def annotated(scan: Scan) -> dict[str, Any]:
    """An annotation file's content: each structure is pointed at, and the other is not it."""
    first, second = scan.inside
    classes = [{"name": "first", "positive": [first], "negative": [second]}, {"name": "second", "positive": [second]}]
    return {"coordinate_system": "IJK", "classes": classes}


Maker = Callable[[random.Random, Place], Case]
"""Writes a case's files, and says what is to be run."""
