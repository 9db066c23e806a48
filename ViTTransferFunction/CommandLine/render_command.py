"""`vittf render`: draws a segmentation over its volume as slices, in 3D, and as a film around the patient."""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ViTTransferFunction.CommandLine.options import Subparsers, add_series_option, check_is_no_points, number
from ViTTransferFunction.CommandLine.output_paths import check_outputs
from ViTTransferFunction.CommandLine.rendering_path import rendering_path
from ViTTransferFunction.Logic.core.system.errors import InputError

if TYPE_CHECKING:
    import numpy as np

    from ViTTransferFunction.CommandLine.canvas import PictureSegment
    from ViTTransferFunction.CommandLine.rendering_picture import Rendering
    from ViTTransferFunction.Logic.core.classes.annotated_class import AnnotatedClass
    from ViTTransferFunction.Logic.core.system.progress import Progress
    from ViTTransferFunction.Logic.core.volumes.camera import Camera, Direction, Size
    from ViTTransferFunction.Logic.core.volumes.volume import Volume
    from ViTTransferFunction.Logic.files.film import FilmPlan

VIEW_DEGREES = {
    "front": (0.0, 0.0),
    "back": (180.0, 0.0),
    "left": (90.0, 0.0),
    "right": (-90.0, 0.0),
    "top": (180.0, 90.0),
    "bottom": (0.0, -90.0),
}
"""Azimuth and elevation of the patient's sides, degrees. From top and bottom, anterior is up, as in Slicer."""

CONTEXTS = {"off": "off", "bones-and-vessels": "bones and vessels", "skin": "skin"}
"""What is shown around the segments, by the option's value."""

STYLES = {"surface": "surface", "glass": "glass", "x-ray": "X-ray", "vessels": "vessels", "as-scanned": "as scanned"}
"""Styles of the segments, by the option's value."""

FILM_HEIGHT = 480
"""Height of films without `--size`, pixels: without a GPU, a frame of this height takes about a second."""


def add_arguments(subparsers: Subparsers) -> None:
    """Add the command to those of `vittf`."""
    parser = subparsers.add_parser(
        "render",
        help="draw a segmentation: slices with overlay, in 3D, and as a film",
        description="Draw a segmentation over its volume, as -o, --3d and --turntable say, of which at least one is needed.",
    )
    parser.add_argument("volume", metavar="VOLUME", type=Path, help="the segmented volume: an image, or a DICOM folder")
    parser.add_argument("segmentation", metavar="OUT.seg.nrrd", type=Path, help="its segmentation, or a label map")
    add_series_option(parser)
    parser.add_argument("-o", "--output", metavar="P.png", type=Path, help="slices; and in 3D, as P_3d.png or what --3d says")
    parser.add_argument("--3d", metavar="P.png", type=Path, dest="picture_3d", help="the 3D picture; without -o, it alone")
    parser.add_argument("--turntable", metavar="F.mp4|F.gif", type=Path, help="a film, once around the patient")
    parser.add_argument("--annotations", metavar="A.json", type=Path, help="also mark these points in the slices")
    parser.add_argument("--context", choices=CONTEXTS, help="what is shown around the segments; else, in CT, faint bones")
    parser.add_argument("--style", choices=STYLES, default="surface", help="how the segments look (default: surface)")
    parser.add_argument("--size", metavar="WxH", help="pixels in all, such as 1920x1080; else as wide as what is shown")
    parser.add_argument(
        "--view", choices=VIEW_DEGREES, help="the patient's side that is seen; else the front, from slightly above"
    )
    parser.add_argument("--azimuth", metavar="DEGREES", type=number, help="0 from the front, 90 from the patient's left")
    parser.add_argument("--elevation", metavar="DEGREES", type=number, help="0 level, 90 from above, -90 from below")
    parser.add_argument("--camera", metavar="C.json", type=Path, help="see it as another picture did, side and scale")
    parser.add_argument("--save-camera", metavar="C.json", type=Path, help="write the camera, for other cases")
    parser.add_argument("--transparent", action="store_true", help="3D picture without background, legend and letters")
    parser.add_argument("--frames", metavar="N", type=int, help="of the film (default: 96)")
    parser.add_argument("--seconds", metavar="S", type=number, help="that the film takes (default: 8)")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the command; returns the exit code."""
    check_is_no_points(args.volume, "the volume here")
    check_is_no_points(args.segmentation, "its segmentation here")
    outputs = _outputs(args)
    size, seen_from = _size(args), _direction(args)
    from ViTTransferFunction.CommandLine.pictures import draw_slice_picture, open_rendering
    from ViTTransferFunction.CommandLine.progress_bar import ProgressBar
    from ViTTransferFunction.Logic.files.camera_files import read_camera, write_camera
    from ViTTransferFunction.Logic.files.volume_files import files_of

    film = _film(args)
    inputs = {"the volume": files_of(args.volume), "the segmentation": files_of(args.segmentation)}
    for name, path in (("the annotations", args.annotations), ("the camera", args.camera)):
        inputs |= {name: [path]} if path else {}
    check_outputs(outputs, inputs)
    camera = read_camera(args.camera) if args.camera else None
    volume, shown, classes = _read(args)
    look = _Look(seen_from, camera, size, _above_legend(size, shown) if film or not args.transparent else None)
    with ProgressBar() as progress:
        progress(0, 1, "Preparing 3D")
        with open_rendering(volume, shown, CONTEXTS.get(args.context), STYLES[args.style]) as rendering:
            progress(1, 1, "Preparing 3D")
            if "the picture" in outputs:
                draw_slice_picture(outputs["the picture"], volume, shown, classes)
            cameras = []
            if "the 3D picture" in outputs:
                cameras.append(_draw_3d(outputs["the 3D picture"], rendering, look, args.transparent))
            if film:
                cameras.append(_shoot(film, rendering, look, progress))
    if args.save_camera:
        write_camera(cameras[0], args.save_camera)
    for path in outputs.values():
        print(path)
    return 0


@dataclass(frozen=True)
class _Look:
    """How the 3D picture and the film are seen.

    Attributes:
        seen_from: the viewing direction if there is no `camera`.
        camera: the camera from a file.
        size: total size of pictures, in pixels; None: it follows from the camera.
        above_legend: the part of `size` that the legend leaves.
    """

    seen_from: Direction
    camera: Camera | None
    size: Size | None
    above_legend: Size | None

    def camera_of(self, rendering: Rendering, room: Size | None, height: int, turning: bool = False) -> Camera:
        """The file's camera, or one that sees everything; its pictures have the size `room`, or a `height`."""
        if self.camera is None:
            return rendering.framing(self.seen_from, height=height, size=room, turning=turning)
        return replace(self.camera, size=room or self.camera.size)


def _outputs(args: argparse.Namespace) -> dict[str, Path]:
    """The files to be written, by their names in messages.

    Raises:
        InputError: there are none, one has a wrong ending, or options contradict each other.
    """
    picture_3d = args.picture_3d or (rendering_path(args.output) if args.output else None)
    named = {
        "the picture": args.output,
        "the 3D picture": picture_3d,
        "the film": args.turntable,
        "the camera": args.save_camera,
    }
    outputs = {name: path for name, path in named.items() if path is not None}
    if not {"the 3D picture", "the film"} & outputs.keys():
        raise InputError("Nothing to draw: give -o P.png for slices and 3D, --3d P.png for 3D alone, or --turntable F.mp4.")
    for name, ending in (("the picture", ".png"), ("the 3D picture", ".png"), ("the camera", ".json")):
        if name in outputs and outputs[name].suffix.lower() != ending:
            raise InputError(f"{outputs[name]}: expected a name that ends in {ending}.")
    if args.transparent and "the 3D picture" not in outputs:
        raise InputError("A film has no transparent background; --transparent goes with --3d P.png or -o P.png.")
    if not args.turntable and (args.frames is not None or args.seconds is not None):
        raise InputError("--frames and --seconds are a film's; give --turntable F.mp4 as well.")
    return outputs


def _size(args: argparse.Namespace) -> Size | None:
    if args.size is None:
        return None
    from ViTTransferFunction.Logic.core.volumes.camera import checked_side

    width, _, height = args.size.lower().replace("×", "x").partition("x")
    if not all(side.isdecimal() and len(side) < 10 for side in (width, height)):
        raise InputError(f"--size {args.size[:40]}: expected width and height in pixels, such as 1920x1080.")
    return checked_side(int(width), "--size"), checked_side(int(height), "--size")


def _direction(args: argparse.Namespace) -> Direction:
    from ViTTransferFunction.Logic.core.volumes.camera import DEFAULT_DEGREES, direction

    given = {name: value for name in ("view", "azimuth", "elevation") if (value := getattr(args, name)) is not None}
    if args.camera and given:
        raise InputError(f"--camera says from where everything is seen, and so does --{next(iter(given))}; give one of them.")
    azimuth, elevation = VIEW_DEGREES[args.view] if args.view else DEFAULT_DEGREES
    azimuth, elevation = given.get("azimuth", azimuth), given.get("elevation", elevation)
    if not math.isfinite(azimuth) or not -90.0 <= elevation <= 90.0:
        raise InputError(f"--azimuth {azimuth:g} --elevation {elevation:g}: expected degrees, of elevation from -90 to 90.")
    return direction(azimuth, elevation)


def _film(args: argparse.Namespace) -> FilmPlan | None:
    if not args.turntable:
        return None
    from ViTTransferFunction.Logic.files.film import DEFAULT_FRAMES, DEFAULT_SECONDS, FilmPlan, check_film_writer

    frames = DEFAULT_FRAMES if args.frames is None else args.frames
    plan = FilmPlan(args.turntable, frames, DEFAULT_SECONDS if args.seconds is None else args.seconds)
    check_film_writer(plan.path)
    return plan


def _read(args: argparse.Namespace) -> tuple[Volume, list[PictureSegment], list[AnnotatedClass]]:
    """The volume, the segments to show, and their annotations in the same order."""
    import numpy as np

    from ViTTransferFunction.CommandLine.pictures import shown_segments
    from ViTTransferFunction.Logic.core.classes.class_request import check_inside
    from ViTTransferFunction.Logic.core.volumes.intensity_window import without_high_padding
    from ViTTransferFunction.Logic.core.volumes.resampling import resample_labels
    from ViTTransferFunction.Logic.files.annotation_files import read_annotations
    from ViTTransferFunction.Logic.files.segmentation_files import read_segmentation
    from ViTTransferFunction.Logic.files.volume_files import read_volume

    volume = without_high_padding(read_volume(args.volume, series=args.series))
    labels, geometry, segments = read_segmentation(args.segmentation)
    if not labels.any():
        raise InputError(
            f"{args.segmentation} has no voxel of any segment: there is nothing to draw. Name one that has, or segment again."
        )
    labels = resample_labels(labels, geometry, volume.geometry)
    if not labels.any():
        raise InputError(
            f"No segment of {args.segmentation} lies inside {args.volume}; draw it over the volume it was made on."
        )
    _check_number(int(np.count_nonzero(np.unique(labels))), args.segmentation)
    classes = read_annotations(args.annotations, volume.geometry) if args.annotations else []
    by_name = {annotated.name: annotated for annotated in classes}
    missing = [segment.name for segment in segments if segment.name not in by_name]
    if missing and classes:
        raise InputError(
            f"{args.annotations} has no class for the segment '{missing[0]}' of {args.segmentation}; it has "
            f"{', '.join(by_name)}. Give the annotations that it was made from; a label map has no names, a .seg.nrrd has them."
        )
    ordered = [by_name[segment.name] for segment in segments] if classes else []
    check_inside([annotated.request for annotated in ordered], volume.geometry)
    opacities = [annotated.opacity for annotated in ordered] or None
    return volume, shown_segments(labels, segments, opacities), ordered


def _check_number(segments: int, path: Path) -> None:
    """Raise InputError for too many segments, before each gets a mask as large as the volume."""
    from ViTTransferFunction.Logic.rendering.composition import MOST_STRUCTURES

    if segments > MOST_STRUCTURES:
        raise InputError(
            f"{path} has {segments} segments inside the volume; a 3D picture shows up to {MOST_STRUCTURES}. Save those you "
            "want to see as a segmentation of their own, in 3D Slicer say, and draw that."
        )


def _above_legend(size: Size | None, shown: list[PictureSegment]) -> Size | None:
    """The part of a picture's size that is left for the rendering.

    Raises:
        InputError: the legend leaves too little.
    """
    if size is None:
        return None
    from ViTTransferFunction.CommandLine.rendering_picture import height_below
    from ViTTransferFunction.Logic.core.volumes.camera import SMALLEST_SIDE

    left = size[1] - height_below(shown, size)
    if left < SMALLEST_SIDE:
        raise InputError("--size leaves no room for the legend; give a larger one, or --transparent, which has none.")
    return size[0], left


def _draw_3d(path: Path, rendering: Rendering, look: _Look, transparent: bool) -> Camera:
    """Draw the 3D picture; returns its camera."""
    from ViTTransferFunction.Logic.core.volumes.camera import DEFAULT_HEIGHT
    from ViTTransferFunction.Logic.scene.views.png_file import save_png

    camera = look.camera_of(rendering, look.size if transparent else look.above_legend, DEFAULT_HEIGHT)
    picture = rendering.picture(camera, transparent=True) if transparent else rendering.labelled_picture(camera, look.size)
    save_png(picture, path)
    return camera


def _shoot(plan: FilmPlan, rendering: Rendering, look: _Look, progress: Progress) -> Camera:
    """Shoot the film; returns the camera of its first frame."""
    from ViTTransferFunction.Logic.files.film import write_film

    camera = look.camera_of(rendering, look.above_legend, FILM_HEIGHT, turning=True)

    def frame(number: int) -> np.ndarray:
        return rendering.labelled_picture(camera.turned(360.0 * number / plan.frames), look.size)

    write_film(plan, frame, progress)
    return camera
