"""Command line options that several commands share, and what is made of them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TypeAlias

from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Logic.core.progress import Progress
from ViTTransferFunction.Logic.features.device import DEVICE_NAMES
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.session.feature_source import FeatureProvenance
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS

# Its name is private, but it is the documented return value of add_subparsers.
Subparsers: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"


def add_feature_options(parser: argparse.ArgumentParser) -> None:
    """Add the volume and everything that decides its features."""
    parser.add_argument("volume", metavar="VOLUME", type=Path, help="a NIfTI, NRRD or MetaImage file, or a DICOM folder")
    parser.add_argument("--model", metavar="NAME", help=f"pretrained model: {', '.join(PRETRAINED_MODELS)}")
    parser.add_argument("--weights", metavar="PATH", help="weights file (else VITTF_WEIGHTS, the cache, or a download)")
    presets = "; ".join(f"{name}: {entry.meaning}" for name, entry in PRESETS.items())
    parser.add_argument("--preset", default=DEFAULT_PRESET, metavar="P", help=presets)
    parser.add_argument("--grid", type=int, metavar="N", help="feature cells along the longest edge")
    parser.add_argument("--device", default="auto", choices=DEVICE_NAMES)
    parser.add_argument(
        "--window", nargs=2, type=float, metavar=("LOW", "HIGH"), help="intensities that the network sees; else chosen robustly"
    )


def opened_session(args: argparse.Namespace) -> SegmentationSession:
    """Read the volume and open it with the chosen settings.

    Raises:
        InputError: the volume or a setting cannot be used.
    """
    settings = SessionSettings(
        preset=args.preset,
        grid=args.grid,
        window=tuple(args.window) if args.window else None,
        model=args.model,
        weights_path=args.weights,
        device=args.device,
    )
    settings.feature_settings()  # Refuses what cannot be used before the volume is read.
    return open_session(read_volume(args.volume), settings)


def load_features(session: SegmentationSession, progress: Progress) -> FeatureProvenance:
    """Load the session's features, and print one line that says where they come from.

    Raises:
        InputError: the model's weights are not to be had.
    """
    provenance = session.load_features(progress)
    shape = "×".join(str(n) for n in session.features.array.shape[2::-1])
    source = "from the cache" if provenance.cached else f"computed on {provenance.device} in {provenance.precision}"
    print(f"Features {shape} of {provenance.weights.model.name}, {source}: {session.watch.seconds['features']:.1f} s")
    return provenance


def parse_named_paths(values: list[str], option: str) -> dict[str, Path]:
    """`NAME=PATH` arguments as a dictionary.

    Raises:
        InputError: one is of another form, or a name comes twice.
    """
    named: dict[str, Path] = {}
    for value in values:
        name, separator, path = value.partition("=")
        if not (name and separator and path):
            raise InputError(f"{option} {value}: expected NAME=FILE, such as {option} liver=L.mrk.json.")
        if name in named:
            raise InputError(f"{option} names class '{name}' twice; put its points into one list.")
        named[name] = Path(path)
    return named
