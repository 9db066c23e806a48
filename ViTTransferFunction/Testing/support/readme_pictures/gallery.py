"""Draws the README's gallery: scans of the paper and others, through a plain 1D transfer function and through this method's.

    python dev.py gallery --volumes DIR

Clicks are those of the folder annotations, features come from the cache or are computed. DIR holds the scans; without it, the
folder that VITTF_TEST_VOLUMES names.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import numpy as np

from ViTTransferFunction.CommandLine.canvas import PictureSegment
from ViTTransferFunction.CommandLine.options import print_features
from ViTTransferFunction.CommandLine.pictures import open_rendering, shown_segments
from ViTTransferFunction.CommandLine.progress_bar import ProgressBar
from ViTTransferFunction.CommandLine.rendering_picture import with_legend
from ViTTransferFunction.CommandLine.segmenting import segment_classes
from ViTTransferFunction.Logic.core.classes.annotated_class import AnnotatedClass
from ViTTransferFunction.Logic.core.system.progress import Progress
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files.annotation_files import read_annotations
from ViTTransferFunction.Logic.files.segmentation_files import Segment
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.scene.views.view_picture import placed_camera
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Testing.support.readme_pictures.composition import captioned, row, save_small
from ViTTransferFunction.Testing.support.readme_pictures.exhibits import ANNOTATIONS, EXHIBITS, Exhibit
from ViTTransferFunction.Testing.support.readme_pictures.intensity_rendering import intensity_picture

SIDE = 480
"""Pixels of each of the two pictures."""


def main() -> int:
    """Draw what is asked for; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--volumes", type=Path, default=os.environ.get("VITTF_TEST_VOLUMES"), help="folder with the scans")
    parser.add_argument("--out", type=Path, default=Path("Screenshots"), help="folder for the pictures")
    parser.add_argument("--only", choices=list(EXHIBITS), help="draw this alone")
    options = parser.parse_args()
    if options.volumes is None:
        parser.error("which folder are the scans in? --volumes DIR, or VITTF_TEST_VOLUMES")
    options.out.mkdir(parents=True, exist_ok=True)
    for name in [options.only] if options.only else EXHIBITS:
        path = options.out / f"gallery_{name}.webp"
        with ProgressBar() as progress:
            save_small(exhibit_picture(EXHIBITS[name], options.volumes, progress), path)
        print(f"{path}: {path.stat().st_size / 1e3:.0f} kB", flush=True)  # noqa: T201
    return 0


def exhibit_picture(exhibit: Exhibit, folder: Path, progress: Progress) -> np.ndarray:
    """Both pictures of a scan, from one place, with their captions and a legend, (H, W, 3) uint8."""
    volume = read_volume(folder / exhibit.file_name)
    classes = read_annotations(ANNOTATIONS / exhibit.annotations, volume.geometry)
    shown = segmented(volume, classes, exhibit.keep_all, progress)
    with open_rendering(volume, shown, exhibit.context) as rendering:
        camera = rendering.framing(exhibit.seen_from, size=(SIDE, SIDE))
        ours = rendering.picture(camera)
        placed = placed_camera(camera, rendering.middle_ras)
    plain = intensity_picture(volume, exhibit.stops, placed, camera.size)
    points = sum(len(annotated.request.positive) + len(annotated.request.negative) for annotated in classes)
    pair = row(
        captioned(f"{exhibit.title}, by intensity alone", plain), captioned(f"{exhibit.title}, by {points} points", ours)
    )
    return with_legend(pair, shown)


def segmented(volume: Volume, classes: list[AnnotatedClass], keep_all: bool, progress: Progress) -> list[PictureSegment]:
    """What the clicks give, as `vittf segment` and `vittf render` have it."""
    session = open_session(volume, SessionSettings())
    segmentation = segment_classes(session, classes, "bilateral", not keep_all, progress, print_features)
    segments = [Segment(annotated.name, annotated.color) for annotated in classes]
    return shown_segments(segmentation.labels, segments, [annotated.opacity for annotated in classes])


if __name__ == "__main__":
    sys.exit(main())
