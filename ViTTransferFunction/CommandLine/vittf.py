"""`vittf`: segment one volume or many, fill the feature cache, draw, and manage weights, without a screen.

Exit codes: 0 success; 1 some cases of a cohort have no segmentation; 2 something given cannot be used, with one line that says
what; 130 interrupted.
"""

# Nothing but what Python has loaded by itself: all else is imported within `main`, which takes Ctrl-C from its first line on.
from __future__ import annotations

import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    import argparse


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns its exit code."""
    try:
        return _run(arguments)
    except KeyboardInterrupt:
        print("interrupted; nothing was left half-written", file=sys.stderr)
        return 130


def _run(arguments: list[str] | None) -> int:
    # Read when PyTorch loads. Where another program uses a core, spinning while waiting makes it many times slower.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    args = build_parser().parse_args(arguments)
    import logging

    from ViTTransferFunction.CommandLine.library_output import CurrentErrorStream, silenced_libraries
    from ViTTransferFunction.Logic.core.errors import InputError

    logging.basicConfig(format="%(levelname)s: %(message)s", level=logging.WARNING, handlers=[CurrentErrorStream()])
    try:
        with silenced_libraries(args.verbose):
            return int(args.run(args))
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


def build_parser() -> argparse.ArgumentParser:
    """The parser of all commands. What they compute with is imported when they run: mistakes are answered at once."""
    import argparse

    from ViTTransferFunction.CommandLine import (
        cache_command,
        cohort_command,
        features_command,
        render_command,
        segment_command,
        weights_command,
    )

    parser = argparse.ArgumentParser(
        prog="vittf", description="Annotation-guided segmentation with vision transformer features."
    )
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="segment|cohort|features|render|weights|cache")
    for command in (segment_command, cohort_command, features_command, render_command, weights_command, cache_command):
        command.add_arguments(subparsers)
    _add_verbose(parser, False)
    for subparser in subparsers.choices.values():
        # Without a default of its own, it would overrule what stands before the command.
        _add_verbose(subparser, argparse.SUPPRESS)
    return parser


def _add_verbose(parser: argparse.ArgumentParser, default: bool | str) -> None:
    parser.add_argument("--verbose", action="store_true", default=default, help="also show what libraries print")


if __name__ == "__main__":
    sys.exit(main())
