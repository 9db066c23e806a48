"""What hangs in the gallery: the scans of the paper's figures, clicks on them, and a 1D transfer function for each."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ViTTransferFunction.Logic.core.classes.colors import Color
from ViTTransferFunction.Logic.core.volumes.camera import Direction, direction
from ViTTransferFunction.Testing.support.readme_pictures.intensity_rendering import IntensityStop

ANNOTATIONS = Path(__file__).parent / "annotations"
"""The clicks of all pictures of the README."""

WOOD, LEAF, CLAY, EARTH = (0.85, 0.70, 0.44), (0.30, 0.69, 0.31), (0.71, 0.33, 0.24), (0.48, 0.36, 0.26)
SKIN, FLESH, BONE = (0.86, 0.64, 0.52), (0.74, 0.32, 0.24), (0.93, 0.90, 0.82)
GREY, WHITE = (0.55, 0.52, 0.50), (0.93, 0.91, 0.88)


@dataclass(frozen=True)
class Exhibit:
    """A pair of pictures: a scan through a 1D transfer function, and through one of structures that were clicked on.

    Attributes:
        title: of it.
        file_name: of the scan.
        annotations: the file with the clicks, in `ANNOTATIONS`.
        stops: the 1D transfer function that one would otherwise design: the one that tells most of the structures apart.
        seen_from: the side.
        keep_all: whether structures keep parts without a click.
        context: what is around the structures, as `open_rendering` has it.
    """

    title: str
    file_name: str
    annotations: str
    stops: tuple[IntensityStop, ...]
    seen_from: Direction
    keep_all: bool = False
    context: str | None = None


def _bands(*stops: tuple[float, float, Color]) -> tuple[IntensityStop, ...]:
    return tuple(IntensityStop(*stop) for stop in stops)


EXHIBITS = {
    "bonsai": Exhibit(
        "Bonsai",
        "bonsai.nrrd",
        "bonsai.json",
        _bands(
            (30.0, 0.0, LEAF), (40.0, 0.35, LEAF), (70.0, 0.35, LEAF), (85.0, 0.5, WOOD), (135.0, 0.6, WOOD),
            (150.0, 0.6, EARTH), (180.0, 0.6, EARTH), (195.0, 0.9, CLAY), (255.0, 0.9, CLAY),
        ),
        # It was scanned lying, and grows towards posterior.
        Direction((0.235, -0.423, -0.875), (-0.110, -0.906, 0.408)),
        keep_all=True,
    ),
    "tooth": Exhibit(
        "Tooth",
        "tooth.nrrd",
        "tooth.json",
        _bands(
            (0.0, 0.5, (0.75, 0.22, 0.17)), (45.0, 0.3, (0.75, 0.22, 0.17)), (60.0, 0.0, (0.75, 0.22, 0.17)),
            (100.0, 0.0, (0.85, 0.64, 0.25)), (140.0, 0.05, (0.85, 0.64, 0.25)), (180.0, 0.02, (0.85, 0.64, 0.25)),
            (200.0, 0.06, (0.91, 0.89, 0.85)), (255.0, 0.08, (0.91, 0.89, 0.85)),
        ),
        direction(0.0, 12.0),
    ),
    "abdomen": Exhibit(
        "Abdomen, CT with contrast",
        "amos_0336_ct.nii.gz",
        "amos_0336.json",
        _bands(
            (80.0, 0.0, FLESH), (120.0, 0.03, FLESH), (170.0, 0.25, (0.85, 0.45, 0.30)), (230.0, 0.4, BONE),
            (400.0, 0.8, BONE), (3000.0, 0.9, BONE),
        ),
        direction(0.0, 8.0),
        context="bones and vessels",
    ),
    "torso": Exhibit(
        "Torso, CT",
        "torso_small_ct.nii.gz",
        "torso_ct.json",
        _bands(
            (60.0, 0.0, FLESH), (110.0, 0.03, FLESH), (170.0, 0.25, (0.85, 0.45, 0.30)), (230.0, 0.4, BONE),
            (400.0, 0.8, BONE), (3000.0, 0.9, BONE),
        ),
        direction(0.0, 8.0),
        context="bones and vessels",
    ),
    "brain": Exhibit(
        "Brain, MR",
        "brain_t1.nii.gz",
        "brain_mr_cerebrum.json",
        _bands(
            (150.0, 0.0, SKIN), (350.0, 0.05, SKIN), (500.0, 0.25, GREY), (700.0, 0.5, WHITE), (1000.0, 0.6, WHITE),
        ),
        direction(62.0, 12.0),
    ),
}  # fmt: skip
