"""`vittf cache info|clear`: how much disk the computed features take, and giving it back."""

from __future__ import annotations

import argparse

from ViTTransferFunction.CommandLine.options import Subparsers


def add_arguments(subparsers: Subparsers) -> None:
    """Add the command to those of `vittf`."""
    parser = subparsers.add_parser(
        "cache",
        help="show or clear the cached features",
        description="Show or clear the cached features. They are computed again when they are needed.",
    )
    parser.add_argument("action", choices=["info", "clear"], help="info: where they are, and how large; clear: delete them")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Carry out the command. Returns the exit code."""
    from ViTTransferFunction.Logic.core.system.errors import InputError
    from ViTTransferFunction.Logic.features.cache import LIMIT_BYTES, FeatureCache

    cache = FeatureCache()
    if args.action == "clear":
        try:
            freed = cache.clear()
        except OSError as error:
            raise InputError(
                f"Cannot remove all features from {cache.folder}: {error.strerror or error}. Close other programs that have "
                "them open, and try again."
            ) from error
        print(f"Removed {freed / 1e6:.0f} MB from {cache.folder}")
        return 0
    count = len(cache.entries())
    kept = f"{count} volume{'' if count == 1 else 's'}, {cache.size_bytes() / 1e6:.0f} MB"
    print(f"{cache.folder}: {kept} of at most {LIMIT_BYTES / 1e9:.0f} GB")
    return 0
