"""Shapes and fine detail: `python dev.py bench topology --volumes DIR [--weights PATH]`.

The two experiments of the paper's appendix. First, are a sphere and a torus recovered without holes and handles, and what do
features of slices across one axis alone make of them? Second, how far is the boundary of thin structures from that of a
hand-made 1D transfer function? In both, the simulated clicker corrects the largest error, and the method is the default one.
Writes `topology.json`, `topology.md` and `topology.webp`.
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from Benchmarks.shared.arguments import network_parser, weights_of
from Benchmarks.shared.kept_results import KeptResults
from Benchmarks.shared.labelled_cases import LabelledVolume
from Benchmarks.shared.machine import machine
from Benchmarks.shared.segmentation_metrics import dice, surface_distances_mm
from Benchmarks.shared.sessions import labels_of, session_on
from Benchmarks.shared.shape_phantoms import BRIGHTNESS, phantom_volume, sphere, torus
from Benchmarks.shared.simulated_clicker import click_in_rounds
from Benchmarks.topology.report import write_report
from Benchmarks.topology.topology import topology_of
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.device import choose_device
from ViTTransferFunction.Logic.features.extraction import FeatureRun
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.features.networks import open_network
from ViTTransferFunction.Logic.features.vision_transformer import VisionTransformer
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.refinement.refinement import RefinementMethod
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS

SHAPES = {"sphere": sphere, "torus": torus}
ALL_AXES = (0, 1, 2)
FEATURES = {"three axes": ALL_AXES, "one axis": (0,)}
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
    parser = network_parser(__doc__)
    parser.add_argument("--size", type=int, default=256, help="voxels along each edge of the shapes' volumes (default 256)")
    parser.add_argument("--clicks", type=int, default=5, help="on each shape (default 5)")
    parser.add_argument(
        "--noise", nargs="*", type=float, default=NOISES, help=f"standard deviations; the shapes are {BRIGHTNESS} bright"
    )
    options = parser.parse_args()
    weights, kept = weights_of(options), KeptResults(options.keep)
    network = open_network(weights, choose_device("auto"))
    shapes, pictures = [], {}
    for name, noise in product(SHAPES, options.noise):
        case = f"{name}, noise {noise:g}"
        for features, axes in FEATURES.items():
            measure = partial(measure_shape, name, options.size, noise, options.clicks, network, axes)
            measured = kept.get(f"topology, {case}, size {options.size}, {options.clicks} clicks, {features}", measure)
            for row, middle in zip(measured["rows"], measured["middle_slices"], strict=True):
                shapes.append({"shape": name, "noise": noise, "features": features, **row})
                pictures[case, features, row["refinement"]] = np.array(middle, dtype=bool)
        pictures[case, "truth", ""] = SHAPES[name](options.size)[:, :, options.size // 2]
    details = []
    for structure in FINE_STRUCTURES:
        measured = kept.get(f"topology, {structure.volume}", partial(measure_detail, structure, options.volumes, network))
        details += [{"structure": structure.name, **row} for row in measured["rows"]]
    report = {"model": weights.model.name, "machine": machine(), "size": options.size, "clicks": options.clicks}
    write_report({**report, "shapes": shapes, "details": details}, pictures, options.results)


def measure_shape(
    name: str, size: int, noise: float, clicks: int, network: VisionTransformer, axes: tuple[int, ...]
) -> dict[str, Any]:
    """What is made of a shape by features of slices across these axes.

    In `rows`, one for each of `REFINEMENTS`, and in `middle_slices` the voxels found in the middle slice across I, (K, J) of 0
    and 1.
    """
    truth = SHAPES[name](size)
    labelled = LabelledVolume(phantom_volume(truth, name, noise), truth.astype(np.uint8), (name,))
    start = time.perf_counter()
    extracted = features_of_axes(labelled.volume, network, axes)
    seconds = time.perf_counter() - start
    session = session_on(labelled.volume, extracted)
    states = click_in_rounds(labelled.truth, labelled.spacing_mm, partial(labels_of, session, labelled), clicks)
    *_, placed = (state.clicks for state in states)
    rows, middle_slices = [], []
    for refinement in REFINEMENTS:
        mask = labels_of(session, labelled, placed, refinement) == 1
        found = topology_of(mask)
        rows.append(
            {
                "refinement": refinement,
                "dice": dice(mask, truth),
                "euler": found.euler,
                "true_euler": topology_of(truth).euler,
                **asdict(found),
                "feature_seconds": seconds,
            }
        )
        middle_slices.append(mask[:, :, size // 2].astype(int).tolist())
    return {"rows": rows, "middle_slices": middle_slices}


def features_of_axes(volume: Volume, network: VisionTransformer, axes: tuple[int, ...]) -> FeatureVolume:
    """The default features, but from slices across these axes alone.

    The mean is still divided by three, which the length of vectors does not matter for.
    """
    run = FeatureRun(volume, network, PRESETS[DEFAULT_PRESET].features)
    run.run([of_slice for of_slice in run.plan.slices if of_slice.axis in axes])
    return run.features()


def measure_detail(structure: FineStructure, folder: Path, network: VisionTransformer) -> dict[str, Any]:
    """How far the boundary is from the transfer function's, refined and not, after some clicks; in `rows`."""
    labelled = structure.read(folder)
    session = session_on(labelled.volume, features_of_axes(labelled.volume, network, ALL_AXES))
    states = click_in_rounds(labelled.truth, labelled.spacing_mm, partial(labels_of, session, labelled), max(DETAIL_CLICKS))
    rows = []
    for state in states:
        if state.number not in DETAIL_CLICKS:
            continue
        for refinement in REFINEMENTS:
            mask = labels_of(session, labelled, state.clicks, refinement) == 1
            row = {"clicks": state.number, "refinement": refinement}
            rows.append({**row, **boundary_figures(mask, labelled.truth == 1)})
    return {"rows": rows}


def boundary_figures(mask: np.ndarray, truth: np.ndarray) -> dict[str, float]:
    """Dice, and distances between the boundaries in voxels where anything was found.

    In voxels, as in the paper; those of both volumes are cubes of 1 mm.
    """
    figures = {"dice": dice(mask, truth)}
    if mask.any():
        distances = surface_distances_mm(mask, truth, (1.0, 1.0, 1.0))
        figures["mean_voxels"] = float(distances.mean())
        figures["p95_voxels"] = float(np.percentile(distances, 95.0))
        figures["within_one_voxel"] = float(np.mean(distances <= 1.0))
    return figures


if __name__ == "__main__":
    main()
