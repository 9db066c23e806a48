"""Making cases and judging them, one after the other."""

from __future__ import annotations

import shlex
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ViTTransferFunction.Testing.attack.calls import Outcome
from ViTTransferFunction.Testing.attack.cases import Case, Place
from ViTTransferFunction.Testing.attack.forked_calls import ForkedCalls
from ViTTransferFunction.Testing.attack.invariant import label_map, option, snapshot, violations
from ViTTransferFunction.Testing.attack.wheel import make_case


@dataclass(frozen=True)
class Verdict:
    """How a case went.

    Attributes:
        kind: of the case.
        outcomes: of its runs, in a word or two.
        failures: what is wrong; empty where all is well.
        story: what was done and said, for who looks into it.
    """

    kind: str
    outcomes: Sequence[str]
    failures: Sequence[str]
    story: str


def attack(forked: ForkedCalls, seed: int, number: int, keep: Path | None = None) -> Verdict:
    """Make the case of this number, run it, and judge.

    Args:
        forked: runs the program.
        seed: of the whole attack.
        number: of the case.
        keep: folder for the case's files, which stay; None: they are deleted.
    """
    # Not below pytest's own folders, which another user may not enter.
    folder = keep or Path(tempfile.mkdtemp(prefix="vittf-attack-"))
    try:
        place = Place(folder, forked.weights)
        case = make_case(seed, number, place)
        try:
            outcomes, failures = _run(case, forked, place)
            failures += [*case.judge(outcomes), *(_unlike(case) if case.alike and not failures else ())]
        finally:
            case.tidy_up()
        return Verdict(case.kind, [str(outcome) for outcome in outcomes], failures, _story(case, outcomes))
    finally:
        if keep is None:
            _delete(folder)


def _run(case: Case, forked: ForkedCalls, place: Place) -> tuple[list[Outcome], list[str]]:
    all_outcomes: list[Outcome] = []
    failures: list[str] = []
    for step in case.steps:
        step.before()
        before = snapshot(place.work)
        outcomes = forked.run(step.calls)
        all_outcomes += outcomes
        failures += violations(case, step, outcomes, place, before)
    return all_outcomes, failures


def _unlike(case: Case) -> list[str]:
    calls = [call for step in case.steps for call in step.calls]
    paths = {Path(call.folder) / value for call in calls for value in option(call, "-o")}
    first, *others = [label_map(path) for path in sorted(paths) if path.exists()]
    return [f"{(first != other).sum()} voxels differ" for other in others if not np.array_equal(first, other)]


def _story(case: Case, outcomes: Sequence[Outcome]) -> str:
    calls = [call for step in case.steps for call in step.calls]
    lines = [f"{case.kind}: {case.what}"]
    for call, outcome in zip(calls, outcomes, strict=True):
        lines += [f"$ {call.program} {shlex.join(call.arguments)}", f"{outcome} in {outcome.seconds:.2f} s"]
        lines += [outcome.stdout[-500:], outcome.stderr[-1500:]]
    return "\n".join(lines)


def _delete(folder: Path) -> None:
    for path in folder.rglob("*"):
        if path.is_dir() and not path.is_symlink():
            path.chmod(0o700)
    shutil.rmtree(folder)
