"""Which version of a package is installed, for `vittf --version`, reports, and computers that are to work together."""

from __future__ import annotations

import argparse
import platform
from importlib import metadata

THIS_PROGRAM = "vit-transfer-function"
"""The name of the package that `vittf` is in."""


def package_version(package: str) -> str | None:
    """The installed version of a package; None where it is not installed as one."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


class ShowVersion(argparse.Action):
    """An option that prints this program's version and Python's, and ends: what a report of an error begins with."""

    def __init__(self, option_strings: list[str], dest: str, help: str | None = None) -> None:
        super().__init__(option_strings, argparse.SUPPRESS, nargs=0, default=argparse.SUPPRESS, help=help)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        """Print it, and end with exit code 0."""
        version = package_version(THIS_PROGRAM) or "(not installed as a package)"
        print(f"{parser.prog} {version}, Python {platform.python_version()}, {platform.platform(terse=True)}")
        parser.exit()
