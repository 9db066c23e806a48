"""Command line options that several commands share, and what is made of them."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Logic.core.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.core.progress import Progress
from ViTTransferFunction.Logic.features.cache import FeatureCache
from ViTTransferFunction.Logic.features.device import DEVICE_NAMES, choose_device
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS, preset
from ViTTransferFunction.Logic.session.segmentation_session import FeatureProvenance, SegmentationSession
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS
from ViTTransferFunction.Logic.weights.sources import find_weights, identify_model

# Its name is private, but it is the documented return value of add_subparsers.
Subparsers: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"


def add_feature_options(parser: argparse.ArgumentParser) -> None:
    """Add the volume and everything that decides its features."""
    parser.add_argument("volume", metavar="VOLUME", type=Path, help="an image that SimpleITK reads, or a DICOM folder")
    parser.add_argument("--model", metavar="NAME", help=f"pretrained model: {', '.join(PRETRAINED_MODELS)}")
    parser.add_argument(
        "--weights", metavar="PATH", type=Path, help="weights file (else VITTF_WEIGHTS, the cache, or a download)"
    )
    presets = "; ".join(f"{name}: {entry.meaning}" for name, entry in PRESETS.items())
    parser.add_argument("--preset", default=DEFAULT_PRESET, metavar="P", help=presets)
    parser.add_argument("--grid", type=int, metavar="N", help="feature cells along the longest edge")
    parser.add_argument("--device", default="auto", choices=DEVICE_NAMES)
    parser.add_argument(
        "--window", nargs=2, type=float, metavar=("LOW", "HIGH"), help="intensities that the network sees; else chosen robustly"
    )


def open_session(args: argparse.Namespace) -> SegmentationSession:
    """Read the volume and choose the settings.

    Raises:
        InputError: the volume or a setting cannot be used.
    """
    chosen = preset(args.preset)
    settings = chosen.features
    if args.grid is not None:
        settings = replace(settings, grid=args.grid)
    if args.window is not None:
        settings = replace(settings, windows=(IntensityWindow(*args.window),) * 3)
    return SegmentationSession(read_volume(args.volume), chosen, settings, FeatureCache())


def load_features(session: SegmentationSession, args: argparse.Namespace, progress: Progress) -> FeatureProvenance:
    """Choose the model, find its weights, load the session's features, and print one line that says from where.

    Raises:
        InputError: the model, its weights or the device is not to be had.
    """
    device = choose_device(args.device)
    model = args.model or identify_model(args.weights) or session.preset.model
    weights = find_weights(model, args.weights, progress=progress)
    provenance = session.load_features(weights, device, progress)
    shape = "×".join(str(n) for n in session.features.array.shape[2::-1])
    source = "from the cache" if provenance.cached else f"computed on {device}"
    print(f"Features {shape} of {weights.model.name}, {source}: {session.watch.seconds['features']:.1f} s")
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
