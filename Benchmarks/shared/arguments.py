"""Command lines that benchmarks on labelled scans have in common."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from Benchmarks.shared.labelled_cases import SCANS
from ViTTransferFunction.Logic.weights.sources import WeightsFile, find_weights, identify_model

RESULTS = Path(__file__).parents[1] / "results"


def scan_parser(description: str | None, cases: Sequence[str]) -> argparse.ArgumentParser:
    """A parser that asks for volumes, weights, which scans (`cases` unless told), and where to write."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--volumes", type=Path, required=True, help="folder with the labelled volumes")
    parser.add_argument("--weights", type=Path, help="weights file; else VITTF_WEIGHTS, the cache or a download")
    parser.add_argument("--model", default="dinov2_vits14_focus", help="where the weights file does not say it")
    parser.add_argument("--cases", nargs="*", choices=[case.name for case in SCANS], default=list(cases))
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder to write to")
    return parser


def weights_of(options: argparse.Namespace) -> WeightsFile:
    """The weights that the command line asks for."""
    return find_weights(identify_model(options.weights) or options.model, options.weights)
