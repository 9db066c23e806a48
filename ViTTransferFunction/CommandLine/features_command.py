"""`vittf features`: fill the feature cache beforehand."""

from __future__ import annotations

import argparse

from ViTTransferFunction.CommandLine.options import Subparsers, add_feature_options, load_features, opened_session
from ViTTransferFunction.Logic.core.system.errors import InputError


def add_arguments(subparsers: Subparsers) -> None:
    """Add the command to those of `vittf`."""
    parser = subparsers.add_parser(
        "features",
        help="compute a volume's features into the cache, for batch work",
        description="Compute a volume's features into the cache, where vittf segment, vittf app and Slicer's module find them.",
    )
    add_feature_options(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Carry out the command. Returns the exit code."""
    from ViTTransferFunction.CommandLine.progress_bar import ProgressBar
    from ViTTransferFunction.Logic.features.cache import LIMIT_BYTES, FeatureCache

    with ProgressBar() as progress:
        session = opened_session(args)
        load_features(session, progress)
    cache = FeatureCache()
    if not session.estimate().cached:
        raise InputError(f"The features were computed, but are not in the cache: {cache.folder} cannot keep them.")
    print(f"Cache: {cache.folder}, {cache.size_bytes() / 1e6:.0f} MB of at most {LIMIT_BYTES / 1e9:.0f} GB")
    return 0
