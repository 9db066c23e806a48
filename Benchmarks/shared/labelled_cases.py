"""Volumes whose structures are known: scans that somebody labelled, and generated shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Protocol

import numpy as np
import SimpleITK as sitk  # noqa: N813

from Benchmarks.shared.shape_phantoms import phantom_volume, sphere, torus
from Benchmarks.shared.simulated_clicker import Click
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.label_dtype import label_dtype
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files.volume_files import read_volume


class LabelledCase(Protocol):
    """A volume with known structures, by name."""

    @property
    def name(self) -> str:
        """In reports and on command lines."""

    def read(self, folder: Path) -> LabelledVolume:
        """The volume and its labels, from the folder that holds the files."""


@dataclass(frozen=True)
class Case:
    """A labelled scan: its files, and which label numbers make up each structure.

    Attributes:
        package: that the files come with, in its folder `data`; empty: they are in the user's folder.
    """

    name: str
    volume: str
    labels: str
    structures: dict[str, tuple[int, ...]]
    package: str = ""

    def read(self, folder: Path) -> LabelledVolume:
        """The scan and its labels, from the folder that holds the files."""
        if self.package:
            folder = Path(str(files(self.package))) / "data"
        return LabelledVolume(
            read_volume(folder / self.volume), merged_labels(folder / self.labels, self), tuple(self.structures)
        )


@dataclass(frozen=True)
class PhantomCase:
    """The paper's sphere and torus in one volume, of equal brightness: what tells them apart is shape and place."""

    name: str = "phantoms"
    size: int = 128

    def read(self, folder: Path) -> LabelledVolume:
        """The generated volume and its labels; needs no file."""
        masks = [sphere(self.size, (0.5, 0.5, 0.27), 0.17), torus(self.size, (0.5, 0.5, 0.7), 0.18, 0.07)]
        truth = np.zeros(masks[0].shape, dtype=np.uint8)
        for label, mask in enumerate(masks, start=1):
            truth[mask] = label
        return LabelledVolume(phantom_volume(truth > 0, self.name), truth, ("sphere", "torus"))


@dataclass(frozen=True, eq=False)
class LabelledVolume:
    """A volume, and what is where in it.

    Attributes:
        volume: the intensities.
        truth: (K, J, I) of `label_dtype`, 0 for background, 1 + index of the structure elsewhere.
        names: of the structures.
    """

    volume: Volume
    truth: np.ndarray
    names: tuple[str, ...]

    @property
    def spacing_mm(self) -> list[float]:
        """Distance between voxels along (K, J, I)."""
        return self.volume.geometry.spacing_mm[::-1].tolist()

    def alone(self, index: int) -> LabelledVolume:
        """The same volume where the index-th structure is the only one and all else is background."""
        return self.only([index + 1])

    def only(self, labels: Sequence[int]) -> LabelledVolume:
        """The same volume where some of the structures, in this order, are all and the others background."""
        new = np.zeros(len(self.names) + 1, dtype=label_dtype(len(labels)))
        new[list(labels)] = np.arange(1, len(labels) + 1)
        return LabelledVolume(self.volume, new[self.truth], tuple(self.names[label - 1] for label in labels))


SCANS = (
    Case(
        "amos_0336", "amos_0336_ct.nii.gz", "amos_0336_labels.nii.gz",
        {
            "liver": (6,), "spleen": (1,), "right kidney": (2,), "left kidney": (3,),
            "stomach": (7,), "bladder": (14,), "aorta": (8,),
        },
    ),
    Case(
        "torso_small", "torso_small_ct.nii.gz", "torso_small_labels.nii.gz",
        {
            "liver": (5,), "spleen": (1,), "right kidney": (2,), "left kidney": (3,),
            "stomach": (6,), "bladder": (21,), "aorta": (52,),
        },
    ),
    Case(
        "brain", "brain_t1.nii.gz", "brain_labels.nii.gz",
        {
            "lateral ventricles": (41, 92), "thalamus": (40, 91), "caudate": (49, 100), "putamen": (21, 72),
            "hippocampus": (48, 99), "brainstem": (11, 62), "cerebellar grey matter": (46, 97),
        },
    ),
)  # fmt: skip

CHEST = Case(
    "chest", "CTChest4.nrrd", "Segmentation.seg.nrrd",
    {"right lung": (5,), "left lung": (6,), "ribs": (1,), "vertebrae": (2, 3, 4)},
    "slicerio",
)  # fmt: skip
"""A CT of 10 mm slices, full of lungs. Each is a structure: of one class, only parts that were clicked are kept."""


def merged_labels(path: Path, case: Case) -> np.ndarray:
    """Truth (K, J, I), 1 + index for each structure."""
    labels = read_labels(path)
    truth = np.zeros(labels.shape, dtype=label_dtype(len(case.structures)))
    for index, values in enumerate(case.structures.values(), start=1):
        truth[np.isin(labels, values)] = index
    return truth


def read_labels(path: Path) -> np.ndarray:
    """The label numbers (K, J, I) of a file."""
    return sitk.GetArrayFromImage(sitk.ReadImage(str(path)))


def classes_of(
    names: Sequence[str], clicks: Sequence[Sequence[Click]], geometry: Geometry, with_negatives: bool = True
) -> list[ClassRequest]:
    """The clicker's clicks as a user's requests; without negatives, those clicks are left out."""

    def positions(of_class: Sequence[Click], positive: bool) -> np.ndarray:
        ijk = [click.kji[::-1] for click in of_class if click.positive == positive]
        return geometry.ijk_to_ras_points(np.array(ijk, dtype=float).reshape(-1, 3))

    return [
        ClassRequest(name, positions(of_class, True), positions(of_class if with_negatives else (), False))
        for name, of_class in zip(names, clicks, strict=True)
    ]
