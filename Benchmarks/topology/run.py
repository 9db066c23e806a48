"""Shapes and fine detail: `python dev.py bench topology --volumes DIR [--weights PATH]`.

The two experiments of the paper's appendix. First, are a sphere and a torus recovered without holes and handles, and what do
features of slices across one axis alone make of them? Second, how far is the boundary of thin structures from that of a
hand-made 1D transfer function? In both, the simulated clicker corrects the largest error, and the method is the default one.
Writes `topology.json`, `topology.md` and `topology.png`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from Benchmarks.shared.arguments import weights_of
from Benchmarks.shared.labelled_cases import LabelledVolume, classes_of
from Benchmarks.shared.segmentation_metrics import dice, surface_distances_mm
from Benchmarks.shared.shape_phantoms import BRIGHTNESS, phantom_volume, sphere, torus
from Benchmarks.shared.simulated_clicker import Clicks, click_in_rounds
from Benchmarks.topology.report import write_report
from Benchmarks.topology.topology import topology_of
from ViTTransferFunction.Logic.core.volume import Volume
from ViTTransferFunction.Logic.features.device import choose_device
from ViTTransferFunction.Logic.features.extraction import FeatureRun
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.refinement.refinement import RefinementMethod
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession, open_network

RESULTS = Path(__file__).parents[1] / "results"
SHAPES = {"sphere": sphere, "torus": torus}
ONE_AXIS = 0
"""The paper's comparison has slices across one axis too; which of them does not matter for a sphere."""
NOISES = (0.0, 8.0)
"""The paper's volumes have none, it seems. Without any, intensities alone say what is inside."""
REFINEMENTS: tuple[RefinementMethod, ...] = ("none", "bilateral")
DETAIL_CLICKS = (5, 10)


@dataclass(frozen=True)
class FineStructure:
    """A structure that a 1D transfer function shows well, and that function: a band of intensities within a box.

    Attributes:
        name: of the structure.
        volume: file.
        low: smallest intensity of the band.
        box: part of the volume, as shares of the edges along (K, J, I), that leaves out what else has such intensities.
        smallest_part: parts of fewer voxels are taken for noise.
    """

    name: str
    volume: str
    low: float
    box: tuple[tuple[float, float], ...] = ((0.0, 1.0),) * 3
    smallest_part: int = 100

    def read(self, folder: Path) -> LabelledVolume:
        """The volume, and what the transfer function shows of it."""
        volume = read_volume(folder / self.volume)
        box = tuple(slice(int(a * n), int(b * n)) for (a, b), n in zip(self.box, volume.shape, strict=True))
        shown = np.zeros(volume.shape, dtype=bool)
        shown[box] = volume.array[box] >= self.low
        parts, _ = ndimage.label(shown)
        large = np.bincount(parts.ravel()) >= self.smallest_part
        large[0] = False
        return LabelledVolume(volume, large[parts].astype(np.uint8), (self.name,))


# Bands chosen by eye in the slices: enamel is the tooth's brightest material, with a gap in the histogram at 200. The bonsai's
# wood is above the noise of air from 60 on; so are pot, soil and stones, which the box leaves out.
FINE_STRUCTURES = (
    FineStructure("tooth: enamel", "tooth.nrrd", 200.0),
    FineStructure("bonsai: trunk and branches", "bonsai.nrrd", 60.0, ((0.0, 1.0), (0.26, 1.0), (0.0, 1.0))),
)


def main() -> None:
    """Run both experiments, and write what was measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--volumes", type=Path, required=True, help="folder with tooth.nrrd and bonsai.nrrd")
    parser.add_argument("--weights", type=Path, help="weights file; else VITTF_WEIGHTS, the cache or a download")
    parser.add_argument("--model", default="dinov2_vits14_focus", help="where the weights file does not say it")
    parser.add_argument("--size", type=int, default=512, help="voxels along each edge of the shapes' volumes (default 512)")
    parser.add_argument("--clicks", type=int, default=5, help="on each shape (default 5)")
    parser.add_argument(
        "--noise", nargs="*", type=float, default=NOISES, help=f"standard deviations; the shapes are {BRIGHTNESS} bright"
    )
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder to write to")
    options = parser.parse_args()
    weights = weights_of(options)
    network = open_network(weights, choose_device("auto"))
    shapes, pictures = [], {}
    for name, noise in product(SHAPES, options.noise):
        for row, middle in shape_rows(name, options.size, noise, options.clicks, network):
            print(row, flush=True)
            shapes.append(row)
            pictures[f"{name}, noise {noise:g}", row["features"], row["refinement"]] = middle
        pictures[f"{name}, noise {noise:g}", "truth", ""] = SHAPES[name](options.size)[:, :, options.size // 2]
    details = [row for structure in FINE_STRUCTURES for row in detail_rows(structure, options.volumes, network)]
    report = {"model": weights.model.name, "size": options.size, "clicks": options.clicks, "shapes": shapes, "details": details}
    write_report(report, pictures, options.results)
    print((options.results / "topology.md").read_text(encoding="utf-8"))


def shape_rows(
    name: str, size: int, noise: float, clicks: int, network: VisionTransformer
) -> Iterator[tuple[dict[str, Any], np.ndarray]]:
    """What is made of a shape by features of three axes and of one, refined and not, each with its middle slice across I."""
    truth = SHAPES[name](size)
    labelled = LabelledVolume(phantom_volume(truth, name, noise), truth.astype(np.uint8), (name,))
    for features, axes in (("three axes", (0, 1, 2)), ("one axis", (ONE_AXIS,))):
        start = time.perf_counter()
        extracted = features_of_axes(labelled.volume, network, axes)
        seconds = time.perf_counter() - start
        session = open_session(labelled.volume, extracted)
        placed: Clicks = []
        for state in click_in_rounds(labelled.truth, labelled.spacing_mm, _segment(session, labelled), clicks):
            placed = [list(of_class) for of_class in state.clicks]
        for refinement in REFINEMENTS:
            mask = _segment(session, labelled, refinement)(placed) == 1
            found = topology_of(mask)
            row = {
                "shape": name,
                "noise": noise,
                "features": features,
                "refinement": refinement,
                "dice": dice(mask, truth),
                "euler": found.euler,
                "true_euler": topology_of(truth).euler,
                **asdict(found),
                "feature_seconds": seconds,
            }
            yield row, mask[:, :, size // 2]


def features_of_axes(volume: Volume, network: VisionTransformer, axes: tuple[int, ...]) -> FeatureVolume:
    """The default features, but from slices across these axes alone.

    The mean is still divided by three, which the length of vectors does not matter for.
    """
    run = FeatureRun(volume, network, PRESETS[DEFAULT_PRESET].features)
    for batch in run.batches:
        if batch.axis in axes:
            run.run(batch)
    return run.features()


def detail_rows(structure: FineStructure, folder: Path, network: VisionTransformer) -> Iterator[dict[str, Any]]:
    """How far the boundary is from the transfer function's, refined and not, after some clicks."""
    labelled = structure.read(folder)
    session = open_session(labelled.volume, features_of_axes(labelled.volume, network, (0, 1, 2)))
    truth = labelled.truth == 1
    # In voxels, as in the paper; those of both volumes are cubes of 1 mm.
    for state in click_in_rounds(labelled.truth, labelled.spacing_mm, _segment(session, labelled), max(DETAIL_CLICKS)):
        if state.number not in DETAIL_CLICKS:
            continue
        for refinement in REFINEMENTS:
            mask = _segment(session, labelled, refinement)([list(of_class) for of_class in state.clicks]) == 1
            row = {"structure": structure.name, "clicks": state.number, "refinement": refinement, "dice": dice(mask, truth)}
            if mask.any():
                distances = surface_distances_mm(mask, truth, (1.0, 1.0, 1.0))
                row["mean_voxels"] = float(distances.mean())
                row["p95_voxels"] = float(np.percentile(distances, 95.0))
                row["within_one_voxel"] = float(np.mean(distances <= 1.0))
            print(row, flush=True)
            yield row


def open_session(volume: Volume, features: FeatureVolume) -> SegmentationSession:
    """The default preset on these features."""
    session = SegmentationSession(volume, PRESETS[DEFAULT_PRESET])
    session.use_features(features)
    return session


def _segment(session: SegmentationSession, labelled: LabelledVolume, refinement: RefinementMethod = "bilateral") -> Any:
    def segment(clicks: Clicks) -> np.ndarray:
        return session.segment(classes_of(labelled.names, clicks, labelled.volume.geometry), refinement).labels

    return segment


if __name__ == "__main__":
    main()
