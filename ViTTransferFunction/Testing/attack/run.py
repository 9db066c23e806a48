"""Attack the program with as many generated cases as wanted: `python dev.py attack --cases N --seed S`.

Prints counts by kind and outcome, and each failure with the command that shows it again. Exit code 1 where there is one.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter, defaultdict
from pathlib import Path

from ViTTransferFunction.Testing.attack.attack import Verdict, attack
from ViTTransferFunction.Testing.attack.forked_calls import ForkedCalls


def main() -> int:
    """Run the cases. Returns the exit code."""
    parser = argparse.ArgumentParser(prog="dev.py attack", description=__doc__)
    parser.add_argument("--cases", type=int, default=300, help="how many (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="another seed is another set of cases (%(default)s)")
    parser.add_argument("--first", type=int, default=0, help="number of the first case (%(default)s)")
    parser.add_argument("--keep", metavar="DIR", type=Path, help="keep the files of a single case in this folder")
    args = parser.parse_args()
    verdicts = []
    started = time.monotonic()
    with ForkedCalls() as forked:
        for number in range(args.first, args.first + args.cases):
            verdict = attack(forked, args.seed, number, args.keep if args.cases == 1 else None)
            verdicts.append(verdict)
            if verdict.failures or args.cases == 1:
                _tell(verdict, args.seed, number)
    _print_counts(verdicts, time.monotonic() - started)
    return int(any(verdict.failures for verdict in verdicts))


def _tell(verdict: Verdict, seed: int, number: int) -> None:
    for failure in verdict.failures:
        print(f"FAILED: {failure}")
    print(f"{verdict.story.strip()}\nAgain: python dev.py attack --seed {seed} --first {number} --cases 1\n", flush=True)


def _print_counts(verdicts: list[Verdict], seconds: float) -> None:
    by_kind: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for verdict in verdicts:
        by_kind[verdict.kind].update({verdict.outcome: 1, "failures": bool(verdict.failures)})
    for kind, counts in sorted(by_kind.items()):
        cases = sum(count for outcome, count in counts.items() if outcome != "failures")
        outcomes = ", ".join(f"{count} × {outcome}" for outcome, count in counts.most_common(6) if outcome != "failures")
        print(f"{kind:20} {cases:6} cases, {counts['failures']:4} failures: {outcomes}")
    failures = sum(bool(verdict.failures) for verdict in verdicts)
    print(f"{len(verdicts)} cases in {seconds:.0f} s, {failures} failures")


if __name__ == "__main__":
    sys.exit(main())
