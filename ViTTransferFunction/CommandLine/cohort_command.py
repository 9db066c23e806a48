"""`vittf cohort`: a segmentation for each of many volumes with an annotations file, on all cores or on a cluster.

Exit codes beside those of `vittf`: 1 where some cases have no segmentation; the table says why.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from ViTTransferFunction.CommandLine.options import Subparsers, add_segmentation_options, add_settings_options


def add_arguments(subparsers: Subparsers) -> None:
    """Add the command to those of `vittf`."""
    parser = subparsers.add_parser("cohort", help="segment many volumes, each from an annotations file of its own")
    parser.add_argument(
        "cases", metavar="CASES.csv|FOLDER", type=Path, help="volumes with their points; see docs/COMMAND_LINE.md"
    )
    parser.add_argument("-o", "--output", metavar="OUT", type=Path, required=True, help="folder for results and their table")
    add_settings_options(parser)
    add_segmentation_options(parser)
    parser.add_argument("--workers", metavar="N", type=int, help="processes on this computer; else as cores and memory allow")
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="a running scheduler of Dask, such as tls://host:8786; see docs/COMMAND_LINE.md"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Carry out the command. Returns the exit code."""
    from ViTTransferFunction.CommandLine.cohort.leader import lead_cohort

    return lead_cohort(args)
