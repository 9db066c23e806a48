"""Command line options that several commands share, and what is made of them."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.system.user_path import user_path
from ViTTransferFunction.Logic.features.device import DEVICE_NAMES
from ViTTransferFunction.Logic.refinement.refinement_methods import REFINEMENT_METHODS
from ViTTransferFunction.Logic.session.preset_meanings import DEFAULT_PRESET, PRESET_MEANINGS
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS

if TYPE_CHECKING:
    from ViTTransferFunction.Logic.core.system.progress import Progress
    from ViTTransferFunction.Logic.session.feature_source import FeatureProvenance
    from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession
    from ViTTransferFunction.Logic.session.settings import SessionSettings

logger = logging.getLogger(__name__)

# Its name is private, but it is the documented return value of add_subparsers.
Subparsers: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"


def add_feature_options(parser: argparse.ArgumentParser) -> None:
    """Add the volume and everything that decides its features."""
    parser.add_argument("volume", metavar="VOLUME", type=Path, help="a NIfTI, NRRD or MetaImage file, or a DICOM folder")
    add_series_option(parser)
    add_settings_options(parser)


def add_series_option(parser: argparse.ArgumentParser) -> None:
    """Add which DICOM series the volume is; see `choose_series`."""
    parser.add_argument(
        "--series", metavar="TEXT", help="of a DICOM folder with several: the series' number, or a part of its description"
    )


def add_settings_options(parser: argparse.ArgumentParser) -> None:
    """Add what decides the features of any volume; see `session_settings`."""
    parser.add_argument(
        "--model",
        metavar="NAME",
        help=f"pretrained model, else that of the weights file or the preset: {', '.join(PRETRAINED_MODELS)}",
    )
    parser.add_argument(
        "--weights", metavar="PATH", help="weights file or folder (else VITTF_WEIGHTS, the cache, or a download)"
    )
    presets = "; ".join(f"{name}: {meaning}" for name, meaning in PRESET_MEANINGS.items())
    parser.add_argument("--preset", default=DEFAULT_PRESET, metavar="P", help=f"{presets} (default: {DEFAULT_PRESET})")
    parser.add_argument("--grid", type=int, metavar="N", help="cells along the longest edge; else as in the preset")
    parser.add_argument(
        "--device",
        default="auto",
        choices=DEVICE_NAMES,
        help="what computes the features; auto, the default: a graphics card where there is one, else the processor",
    )
    parser.add_argument(
        "--window",
        nargs=2,
        type=number,
        metavar=("LOW", "HIGH"),
        help="intensities that the network sees; else chosen from the volume",
    )


def add_segmentation_options(parser: argparse.ArgumentParser) -> None:
    """Add what decides how maps become segments."""
    parser.add_argument(
        "--refine",
        default="bilateral",
        choices=REFINEMENT_METHODS,
        help="how maps are sharpened; none: not at all (default: bilateral)",
    )
    parser.add_argument(
        "--keep-all-components", action="store_true", help="also keep parts of a segment that hold none of its positive points"
    )


def number(text: str) -> float:
    """The value of an option that is a number."""
    try:
        return float(text)
    except ValueError as error:
        point = ", with a point before its decimals" if "," in text else ""
        raise argparse.ArgumentTypeError(f"got {text!r}; expected a number{point}, such as 0.5") from error


def check_is_no_points(path: Path, expected: str) -> None:
    """Raise InputError where a file of points is named in place of what is expected: arguments are easily swapped."""
    if path.suffix.lower() == ".json":
        raise InputError(f"{path} is a file of points, by its ending; expected {expected}. Points are named by --annotations.")


def session_settings(args: argparse.Namespace) -> SessionSettings:
    """What the options of `add_settings_options` say.

    Raises:
        InputError: a setting cannot be used.
    """
    from ViTTransferFunction.Logic.session.settings import SessionSettings

    settings = SessionSettings(
        preset=args.preset,
        grid=args.grid,
        window=tuple(args.window) if args.window else None,
        model=args.model,
        weights_path=args.weights,
        device=args.device,
    )
    settings.feature_settings()  # Refuses what cannot be used.
    return settings


def opened_session(args: argparse.Namespace, on_warning: Callable[[str], None] = logger.warning) -> SegmentationSession:
    """Read the volume and open it with the chosen settings.

    Args:
        args: of `add_feature_options`.
        on_warning: is told what `read_volume` tells.

    Raises:
        InputError: the volume or a setting cannot be used.
    """
    from ViTTransferFunction.Logic.files.volume_files import read_volume
    from ViTTransferFunction.Logic.session.opening import open_session

    settings = session_settings(args)  # First: a volume takes seconds to read.
    return open_session(read_volume(args.volume, on_warning, args.series), settings)


def load_features(session: SegmentationSession, progress: Progress) -> FeatureProvenance:
    """Load the session's features, and print one line that says where they come from.

    Raises:
        InputError: the model's weights are not to be had.
    """
    provenance = session.load_features(progress)
    print_features(session)
    return provenance


def print_features(session: SegmentationSession) -> None:
    """Print one line that says where the session's features come from."""
    provenance = session.provenance
    shape = "×".join(str(n) for n in session.features.array.shape[2::-1])
    source = "from the cache" if provenance.cached else f"computed on {provenance.device} in {provenance.precision}"
    print(f"Features {shape} of {provenance.weights.model.name}, {source}: {session.watch.seconds['features']:.1f} s")


def parse_named_paths(values: list[str], option: str) -> dict[str, Path]:
    """`NAME=PATH` arguments as a dictionary, whose names are `composed`; spaces around name and path are left out.

    Raises:
        InputError: one is of another form, or a name comes twice.
    """
    from ViTTransferFunction.Logic.core.classes.class_request import composed

    named: dict[str, Path] = {}
    for value in values:
        name, separator, path = (part.strip() for part in value.partition("="))
        if not (name and separator and path):
            raise InputError(f"{option} {value}: expected NAME=FILE, such as {option} liver=L.mrk.json.")
        name = composed(name)
        if name in named:
            raise InputError(f"{option} names class '{name}' twice; put its points into one list.")
        named[name] = spelled_out(Path(path))
    return named


def spelled_out(path: Path) -> Path:
    """The path with the home folder for `~`, which shells leave as it is within a word, as in `--output=~/x.nrrd`.

    Raises:
        InputError: there is no home folder.
    """
    return user_path(path, "a file or folder") if path.parts[:1] == ("~",) else path
