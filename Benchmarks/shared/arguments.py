"""Command lines of the benchmarks: what they have in common."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from Benchmarks.shared.labelled_cases import SCANS, Case, LabelledCase
from ViTTransferFunction.Logic.weights.sources import WeightsFile, find_weights, identify_model

RESULTS = Path(__file__).parents[1] / "results"
DEFAULT_MODEL = "dinov2_vits14_focus"
"""All results that are part of the project were measured with it: everybody can have it."""


def benchmark_parser(description: str | None) -> argparse.ArgumentParser:
    """A parser that asks where to write; `description` is the benchmark's docstring."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder to write to")
    return parser


def network_parser(description: str | None, keep: Path | None = None) -> argparse.ArgumentParser:
    """As `benchmark_parser`, and asks for volumes, weights and where to keep what was measured (`keep` if not given)."""
    parser = benchmark_parser(description)
    parser.add_argument("--volumes", type=Path, required=True, help="folder with the volumes and their labels")
    parser.add_argument("--weights", type=Path, help="weights file; else VITTF_WEIGHTS, the cache or a download")
    parser.add_argument("--model", help=f"model; else the one that the weights file is known as, else {DEFAULT_MODEL}")
    parser.add_argument(
        "--keep",
        type=Path,
        default=keep,
        help="folder for what was measured, in it one for each file of weights; what is there is taken as it is, so empty it "
        "when the code has changed",
    )
    return parser


def scan_parser(
    description: str | None,
    default: Sequence[str],
    keep: Path | None = None,
    cases: Sequence[LabelledCase] = SCANS,
) -> argparse.ArgumentParser:
    """As `network_parser`, and asks which of the labelled cases (`default` if not given)."""
    parser = network_parser(description, keep)
    names = [case.name for case in cases]
    parser.add_argument("--cases", nargs="*", choices=names, default=list(default), help=f"default: {', '.join(default)}")
    return parser


def scans_of(options: argparse.Namespace) -> list[Case]:
    """The scans that the command line asks for."""
    return [case for case in SCANS if case.name in options.cases]


def weights_of(options: argparse.Namespace) -> WeightsFile:
    """The weights that the command line asks for; from then on, `options.keep` is a folder for what was measured with them."""
    weights = find_weights(options.model or identify_model(options.weights) or DEFAULT_MODEL, options.weights)
    if options.keep is not None:
        options.keep /= f"{weights.model.name}-{weights.sha256[:8]}"
    return weights
