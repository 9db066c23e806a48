"""`vittf`: segment one volume or many, fill the feature cache, draw, and manage weights, without a screen; serve the app.

Exit codes: 0 success; 1 some cases of a cohort have no segmentation; 2 something given cannot be used, or there is too little
memory or no room for the output, with one line that says what; 130 interrupted, 143 asked to end (SIGTERM). Where nobody reads
the output any more, the work is done all the same.
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
        return _run_on_any_console(arguments)
    except KeyboardInterrupt as interruption:
        return _interrupted(interruption)


def _run_on_any_console(arguments: list[str] | None) -> int:
    from ViTTransferFunction.CommandLine.console import unfailing_console
    from ViTTransferFunction.Logic.core.system.closed_pipe import is_closed_pipe

    with unfailing_console() as output:
        try:
            code = _run(arguments)
        except KeyboardInterrupt as interruption:
            code = _interrupted(interruption)
        output.flush()
        if output.trouble is not None and not is_closed_pipe(output.trouble):
            print(f"error: The output could not be written: {output.trouble.strerror}.", file=sys.stderr)
            code = code or 2
    return code


def _run(arguments: list[str] | None) -> int:
    # Read when PyTorch and NumPy load. Where another program uses a core, spinning while waiting makes it many times slower;
    # OpenBLAS's own threads would take the cores from PyTorch's.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    import logging

    from ViTTransferFunction.CommandLine.console import unfailing_console
    from ViTTransferFunction.CommandLine.interruption import ending_on_request
    from ViTTransferFunction.CommandLine.library_file_names import take_utf8_file_names
    from ViTTransferFunction.CommandLine.library_output import CurrentErrorStream, silenced_libraries
    from ViTTransferFunction.Logic.core.system.errors import InputError
    from ViTTransferFunction.Logic.core.system.out_of_memory import OUT_OF_MEMORY, is_out_of_memory

    take_utf8_file_names()
    logging.basicConfig(format="%(levelname)s: %(message)s", level=logging.WARNING, handlers=[CurrentErrorStream()])
    try:
        with ending_on_request():
            args = _parsed(sys.argv[1:] if arguments is None else arguments)
            _check_surroundings(args)
            # Within as well, since silencing makes another error stream.
            with silenced_libraries(args.verbose), unfailing_console():
                return int(args.run(args))
    except InputError as error:
        # One line, also where a path has several.
        print("error:", str(error).replace("\n", "\\n").replace("\r", "\\r"), file=sys.stderr)
        return 2
    except Exception as error:
        if is_out_of_memory(error):
            print(f"error: {OUT_OF_MEMORY}", file=sys.stderr)
        elif isinstance(error, OSError):
            print(f"error: {error.filename or 'A file'} cannot be used: {error.strerror or error}.", file=sys.stderr)
        else:
            raise
        return 2


def _interrupted(interruption: KeyboardInterrupt) -> int:
    print("interrupted; nothing was left half-written", file=sys.stderr)
    return int(getattr(interruption, "exit_code", 130))


def build_parser() -> argparse.ArgumentParser:
    """The parser of all commands. What they compute with is imported when they run: mistakes are answered at once."""
    import argparse

    from ViTTransferFunction.CommandLine import (
        app_command,
        cache_command,
        cohort_command,
        features_command,
        render_command,
        segment_command,
        weights_command,
    )
    from ViTTransferFunction.CommandLine.package_versions import ShowVersion

    parser = argparse.ArgumentParser(
        prog="vittf", description="Annotation-guided segmentation with vision transformer features."
    )
    commands = (
        segment_command,
        cohort_command,
        app_command,
        features_command,
        render_command,
        weights_command,
        cache_command,
    )
    names = "segment|cohort|app|features|render|weights|cache"
    subparsers = parser.add_subparsers(dest="command", required=True, metavar=names)
    for command in commands:
        command.add_arguments(subparsers)
    parser.add_argument("--version", action=ShowVersion, help="show the version of this program, and of Python")
    _add_verbose(parser, False)
    for subparser in subparsers.choices.values():
        # Without a default of its own, it would overrule what stands before the command.
        _add_verbose(subparser, argparse.SUPPRESS)
    return parser


def _parsed(words: list[str]) -> argparse.Namespace:
    """The arguments of a command, paths `spelled_out`. Raises InputError where a word is empty or one too many."""
    from pathlib import Path

    from ViTTransferFunction.CommandLine.options import spelled_out
    from ViTTransferFunction.Logic.core.system.errors import InputError, shown

    for before, word in zip(["", *words], words, strict=False):
        # As a path it would be the current folder, whatever scans that has.
        if not word or (word.startswith("--") and word.endswith("=")):
            option = before if before.startswith("-") and not word else word.rstrip("=")
            raise InputError(
                f"{option or 'An argument'} has no value; of a variable that is not set, perhaps. Give one, or leave it out."
            )
    args, unknown = build_parser().parse_known_args(words)
    if unknown:
        more = f", and {len(unknown) - 1} more" if len(unknown) > 1 else ""
        of_points = "Name points by --annotations A.json, and a DICOM series by its folder. " if "annotations" in args else ""
        raise InputError(
            f"`vittf {args.command}` does not take {shown(unknown[0])}{more}. "
            f"{of_points}`vittf {args.command} --help` lists what it takes."
        )
    for name, value in vars(args).items():
        if isinstance(value, Path):
            setattr(args, name, spelled_out(value))
    return args


def _add_verbose(parser: argparse.ArgumentParser, default: bool | str) -> None:
    parser.add_argument("--verbose", action="store_true", default=default, help="also show what libraries print")


def _check_surroundings(args: argparse.Namespace) -> None:
    """Raise InputError where no path can be looked up at all, or one holds a character that no path may hold."""
    from pathlib import Path

    from ViTTransferFunction.Logic.core.system.errors import InputError

    try:
        Path.cwd()
    except OSError as error:
        raise InputError("The current folder was deleted; go to another one.") from error
    words = [word for value in vars(args).values() for word in (value if isinstance(value, list) else [value])]
    for word in words:
        if isinstance(word, (str, Path)) and "\0" in str(word):
            raise InputError(f"{str(word)[:200]!r} holds a null character; no path may.")


if __name__ == "__main__":
    sys.exit(main())
