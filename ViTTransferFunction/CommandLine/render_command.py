"""`vittf render`: pictures of a segmentation over its volume."""

from __future__ import annotations

import argparse
from pathlib import Path

from ViTTransferFunction.CommandLine.options import Subparsers
from ViTTransferFunction.CommandLine.output_paths import check_outputs
from ViTTransferFunction.CommandLine.pictures import draw_pictures, rendering_path
from ViTTransferFunction.CommandLine.progress_bar import ProgressBar
from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Logic.core.resampling import resample_labels
from ViTTransferFunction.Logic.files.annotation_files import read_annotations
from ViTTransferFunction.Logic.files.segmentation_files import read_segmentation
from ViTTransferFunction.Logic.files.volume_files import files_of, read_volume


def add_arguments(subparsers: Subparsers) -> None:
    """Add the command to those of `vittf`."""
    parser = subparsers.add_parser("render", help="draw a segmentation: slices with overlay, and in 3D")
    parser.add_argument("volume", metavar="VOLUME", type=Path, help="the segmented volume: an image, or a DICOM folder")
    parser.add_argument("segmentation", metavar="OUT.seg.nrrd", type=Path, help="its segmentation, or a label map")
    parser.add_argument("-o", "--output", metavar="P.png", type=Path, required=True, help="slices; the 3D picture is P_3d.png")
    parser.add_argument("--annotations", metavar="A.json", type=Path, help="also mark these points")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Carry out the command. Returns the exit code."""
    if args.output.suffix.lower() != ".png":
        raise InputError(f"{args.output}: expected a name that ends in .png.")
    inputs = {"the volume": files_of(args.volume), "the segmentation": files_of(args.segmentation)}
    if args.annotations:
        inputs["the annotations"] = [args.annotations]
    check_outputs({"the picture": args.output, "the 3D picture": rendering_path(args.output)}, inputs)
    volume = read_volume(args.volume)
    labels, geometry, segments = read_segmentation(args.segmentation)
    labels = resample_labels(labels, geometry, volume.geometry)
    if not labels.any():
        raise InputError(
            f"No segment of {args.segmentation} lies inside {args.volume}; draw it over the volume it was made on."
        )
    classes = read_annotations(args.annotations, volume.geometry) if args.annotations else []
    by_name = {annotated.name: annotated for annotated in classes}
    if any(segment.name not in by_name for segment in segments) and classes:
        raise InputError(f"{args.annotations} lacks some of the segments: it has {', '.join(by_name)}.")
    ordered = [by_name[segment.name] for segment in segments] if classes else []
    opacities = [annotated.opacity for annotated in ordered] or None
    with ProgressBar() as progress:
        pictures = draw_pictures(args.output, volume, labels, segments, opacities, ordered, progress)
    for path in pictures:
        print(path)
    return 0
