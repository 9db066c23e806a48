"""`vittf`: segment, fill the feature cache, draw, and manage weights, without a screen.

Exit codes: 0 success; 2 something given cannot be used, with one line that says what; 130 interrupted.
"""

from __future__ import annotations

import argparse
import logging
import os
import sys

from ViTTransferFunction.CommandLine import cache_command, features_command, render_command, segment_command, weights_command
from ViTTransferFunction.CommandLine.library_output import CurrentErrorStream, silenced_libraries
from ViTTransferFunction.Logic.core.errors import InputError


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns its exit code."""
    # Read when PyTorch loads. Where another program uses a core, spinning while waiting makes it many times slower.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    logging.basicConfig(format="%(levelname)s: %(message)s", level=logging.WARNING, handlers=[CurrentErrorStream()])
    args = build_parser().parse_args(arguments)
    try:
        with silenced_libraries(args.verbose):
            return args.run(args)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted; nothing was left half-written", file=sys.stderr)
        return 130


def build_parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    parser = argparse.ArgumentParser(
        prog="vittf", description="Annotation-guided segmentation with vision transformer features."
    )
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="segment|features|render|weights|cache")
    for command in (segment_command, features_command, render_command, weights_command, cache_command):
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
