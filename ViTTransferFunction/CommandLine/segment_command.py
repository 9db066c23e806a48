"""`vittf segment`: a volume and annotations in, a segmentation out."""

from __future__ import annotations

import argparse
import json
import logging
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ViTTransferFunction.CommandLine.options import (
    Subparsers,
    add_feature_options,
    add_segmentation_options,
    check_is_no_points,
    opened_session,
    parse_named_paths,
    print_features,
    spelled_out,
)
from ViTTransferFunction.CommandLine.output_paths import check_outputs
from ViTTransferFunction.Logic.core.system.atomic_file import check_writable, replacing
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.system.file_names import file_stem
from ViTTransferFunction.Logic.core.volumes.measures import millilitres_text

if TYPE_CHECKING:
    from ViTTransferFunction.Logic.core.classes.annotated_class import AnnotatedClass
    from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
    from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
    from ViTTransferFunction.Logic.session.refined_map import RefinedMap
    from ViTTransferFunction.Logic.session.segmentation import Segmentation

logger = logging.getLogger(__name__)


_DESCRIPTION = """
Segment structures of one volume, from points on them that --annotations or
--positive names, and print how large each is.
"""
_EPILOG = """
A.json has points in RAS or LPS millimetres, or in IJK voxels:

  {"coordinate_system": "RAS",
   "classes": [{"name": "liver",
                "positive": [[103.2, -265.6, 1158.0]],
                "negative": [[-68.1, -260.8, 1186.0]]}]}

Positive points lie on the structure, negative ones off it. Save points in
Slicer's panel, and Download points in vittf app, write such files. What else
may be in them is in docs/COMMAND_LINE.md.
"""


def add_arguments(subparsers: Subparsers) -> None:
    """Add the command to those of `vittf`."""
    parser = subparsers.add_parser(
        "segment",
        help="segment structures from a few annotated points",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_feature_options(parser)
    parser.add_argument("--annotations", metavar="A.json", type=Path, help="structures with their points; see below")
    parser.add_argument(
        "--positive",
        metavar="NAME=L.mrk.json",
        action="append",
        default=[],
        help="a Slicer point list on a structure, a line across it, or a closed curve around it; again for each",
    )
    parser.add_argument("--negative", metavar="NAME=N.mrk.json", action="append", default=[], help="a Slicer point list off it")
    parser.add_argument(
        "-o", "--output", metavar="OUT", type=Path, required=True, help=".seg.nrrd, or .nii.gz and other label maps"
    )
    add_segmentation_options(parser)
    parser.add_argument("--similarity-dir", metavar="DIR", type=Path, help="also write each class's map, as .nii.gz")
    parser.add_argument("--report", metavar="R.json", type=Path, help="also write versions, timings, volumes and warnings")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Carry out the command. Returns the exit code."""
    from ViTTransferFunction.CommandLine.progress_bar import ProgressBar
    from ViTTransferFunction.CommandLine.segmenting import segment_classes, segmentation_report, write_classes
    from ViTTransferFunction.Logic.files.segmentation_files import check_segmentation_path

    check_is_no_points(args.volume, "the volume here")
    check_segmentation_path(args.output)
    inputs = _inputs(args)
    check_outputs(_outputs(args), inputs)
    if args.similarity_dir:
        # What the classes are called, and so the names of the maps, is known only later.
        check_writable(args.similarity_dir / "map.nii.gz")
    warnings: list[str] = []

    def warn(message: str) -> None:
        logger.warning(message)
        warnings.append(message)

    with ProgressBar() as progress:
        session = opened_session(args, warn)
        classes = _read_classes(args, session.volume.geometry)
        check_outputs(_outputs(args, classes), inputs)
        segmentation = segment_classes(
            session,
            classes,
            args.refine,
            only_annotated_components=not args.keep_all_components,
            progress=progress,
            on_features=print_features,
            on_map=_map_writer(args.similarity_dir, session.volume.geometry),
            on_warning=warn,
        )
    write_classes(args.output, session, classes, segmentation)
    _print_summary(segmentation, args.output)
    if args.report:
        report = segmentation_report(session, segmentation, args.preset, args.refine)
        _write_json(args.report, {**report, "warnings": warnings})
    return 0


def _outputs(args: argparse.Namespace, classes: Sequence[AnnotatedClass] = ()) -> dict[str, Path]:
    """What is to be written, in the user's words, and where to; of maps those of `classes`."""
    outputs = {"the segmentation": args.output}
    if args.report:
        outputs["the report"] = args.report
    if args.similarity_dir:
        for name in (annotated.name for annotated in classes):
            outputs[f"the map of class '{name}'"] = _map_path(args.similarity_dir, name)
    return outputs


def _inputs(args: argparse.Namespace) -> dict[str, list[Path]]:
    """What is read, in the user's words, and its files; their options are checked where they are read."""
    from ViTTransferFunction.Logic.files.volume_files import files_of
    from ViTTransferFunction.Logic.weights.sources import WEIGHTS_VARIABLE

    lists = [value.partition("=")[2].strip() for value in (*args.positive, *args.negative)]
    weights = [args.weights or os.environ.get(WEIGHTS_VARIABLE)]
    return {
        "the volume": files_of(args.volume),
        "the annotations": [spelled_out(Path(path)) for path in (args.annotations, *lists) if path],
        "the weights": [_expanded(Path(path)) for path in weights if path],
    }


def _expanded(path: Path) -> Path:
    try:
        return path.expanduser()
    except RuntimeError:  # There is no such user.
        return path


def _read_classes(args: argparse.Namespace, geometry: Geometry) -> list[AnnotatedClass]:
    from ViTTransferFunction.Logic.files.annotation_files import classes_from_markups, read_annotations

    if bool(args.annotations) == bool(args.positive):
        raise InputError("Give the annotated points by either --annotations A.json or --positive NAME=L.mrk.json.")
    if args.annotations:
        if args.negative:
            raise InputError("--negative goes with --positive; with --annotations, put negative points into the file.")
        return read_annotations(args.annotations, geometry)
    positive, negative = parse_named_paths(args.positive, "--positive"), parse_named_paths(args.negative, "--negative")
    return classes_from_markups(positive, negative, geometry)


def _map_writer(folder: Path | None, geometry: Geometry) -> Callable[[ClassRequest, RefinedMap], None] | None:
    if folder is None:
        return None
    from ViTTransferFunction.Logic.files.segmentation_files import write_image

    def write(request: ClassRequest, full: RefinedMap) -> None:
        write_image(_map_path(folder, request.name), full.voxels.array, geometry)

    return write


def _map_path(folder: Path, name: str) -> Path:
    return folder / f"{file_stem(name)}.nii.gz"


def _print_summary(segmentation: Segmentation, output: Path) -> None:
    from ViTTransferFunction.Logic.files.segmentation_files import is_slicer_segmentation

    for label, result in enumerate(segmentation.classes, start=1):
        # A label map keeps no names: nothing else says which number is which.
        of_label_map = "" if is_slicer_segmentation(output) else f"label {label}, "
        size = f"{millilitres_text(result.millilitres)}, {result.voxels} voxels"
        print(f"  {result.name}: {of_label_map}{size}, iso {result.iso:.2f}")
    print(f"Segmentation: {output}")


def _write_json(path: Path, content: dict[str, Any]) -> None:
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
