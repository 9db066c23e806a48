"""Command lines of the benchmarks: what they have in common."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from Benchmarks.shared.labelled_cases import SCANS, Case, LabelledCase
from ViTTransferFunction.Logic.weights.sources import WeightsFile, find_weights, identify_model

RESULTS = Path(__file__).parents[1] / "results"


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
    parser.add_argument("--model", default="dinov2_vits14_focus", help="where the weights file does not say it")
    parser.add_argument(
        "--keep",
        type=Path,
        default=keep,
        help="folder for what was measured; what is there is taken as it is, so empty it when the code has changed",
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
    """The weights that the command line asks for."""
    return find_weights(identify_model(options.weights) or options.model, options.weights)
