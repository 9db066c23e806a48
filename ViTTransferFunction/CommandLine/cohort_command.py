"""`vittf cohort`: a segmentation for each of many volumes with an annotations file, on all cores or on a cluster.

Exit codes beside those of `vittf`: 1 where some cases have no segmentation; the table says why.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from ViTTransferFunction.CommandLine.options import Subparsers, add_segmentation_options, add_settings_options

_DESCRIPTION = """
Segment many volumes, as vittf segment does one. Run again, it goes on where it
was interrupted.
"""
_EPILOG = """
CASES.csv has a line for each case; relative paths begin at its folder:

  case,volume,annotations
  A,scans/a.nii.gz,scans/a.annotations.json
  B,scans/b_dicom,scans/b.annotations.json

A FOLDER has scan.nii.gz with scan.annotations.json beside it, or folders of
DICOM files with annotations.json, or one file that Save points wrote, in each.
vittf segment --help shows what is in an annotations file.
"""


def add_arguments(subparsers: Subparsers) -> None:
    """Add the command to those of `vittf`."""
    parser = subparsers.add_parser(
        "cohort",
        help="segment many volumes, each from an annotations file of its own",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("cases", metavar="CASES.csv|FOLDER", type=Path, help="volumes with their points; see below")
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
