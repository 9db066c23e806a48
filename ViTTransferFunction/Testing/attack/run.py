"""Attack the program with as many generated cases as wanted: `python dev.py attack --cases N --seed S`.

Most cases are runs of `vittf`; some talk to the compute process; for every fifty there is one of a user who does anything in
any order in Slicer's scene, where that is installed. Prints each failure with the command that shows it again, and counts by
kind and outcome. Exit code 1 where there is a failure.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter, defaultdict
from pathlib import Path

from ViTTransferFunction.Testing.attack.attack import Verdict, attack
from ViTTransferFunction.Testing.attack.forked_calls import ForkedCalls

CASES_A_SESSION = 50


def main() -> int:
    """Run the cases. Returns the exit code."""
    parser = argparse.ArgumentParser(prog="dev.py attack", description=__doc__)
    parser.add_argument("--cases", type=int, default=300, help="how many (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="another seed is another set of cases (%(default)s)")
    parser.add_argument("--first", type=int, default=0, help="number of the first case (%(default)s)")
    parser.add_argument("--keep", metavar="DIR", type=Path, help="keep the files of a single case in this folder")
    args = parser.parse_args()
    if not hasattr(os, "fork"):
        print("Cases run in forked processes, which this operating system does not have.", file=sys.stderr)
        return 2
    started = time.monotonic()
    verdicts = _attacked(args)
    sessions = args.cases // CASES_A_SESSION
    session_failed = _attack_sessions(sessions, args.seed) if sessions else False
    _print_counts(verdicts)
    print(f"{'session':20} {sessions:6} sequences, {session_failed:6} failures")
    failures = sum(bool(verdict.failures) for verdict in verdicts) + session_failed
    print(f"{len(verdicts) + sessions} cases in {time.monotonic() - started:.0f} s, {failures} failures")
    return int(bool(failures))


def _attacked(args: argparse.Namespace) -> list[Verdict]:
    verdicts = []
    with ForkedCalls() as forked:
        for number in range(args.first, args.first + args.cases):
            verdict = attack(forked, args.seed, number, args.keep if args.cases == 1 else None)
            verdicts.append(verdict)
            if verdict.failures or args.cases == 1:
                _tell(verdict, args.seed, number)
    return verdicts


def _tell(verdict: Verdict, seed: int, number: int) -> None:
    for failure in verdict.failures:
        print(f"FAILED: {failure}")
    print(f"{verdict.story.strip()}\nAgain: python dev.py attack --seed {seed} --first {number} --cases 1\n", flush=True)


def _attack_sessions(count: int, seed: int) -> bool:
    """Have pytest run the session's test, which brings a scene and volumes. Returns whether it failed."""
    import pytest

    from ViTTransferFunction.Testing.attack import test_session

    os.environ[test_session.EXAMPLES_VARIABLE] = str(count)
    test = str(Path(test_session.__file__ or ""))
    return bool(pytest.main(["-q", "-p", "no:cacheprovider", f"--hypothesis-seed={seed}", test]))


def _print_counts(verdicts: list[Verdict]) -> None:
    by_kind: defaultdict[str, list[Verdict]] = defaultdict(list)
    for verdict in verdicts:
        by_kind[verdict.kind].append(verdict)
    for kind, of_kind in sorted(by_kind.items()):
        outcomes = Counter(outcome for verdict in of_kind for outcome in verdict.outcomes)
        failures = sum(bool(verdict.failures) for verdict in of_kind)
        told = ", ".join(f"{count} × {outcome}" for outcome, count in outcomes.most_common())
        print(f"{kind:20} {len(of_kind):6} cases,     {failures:6} failures; runs: {told}")


if __name__ == "__main__":
    sys.exit(main())
