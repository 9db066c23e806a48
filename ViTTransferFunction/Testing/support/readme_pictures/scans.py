"""The scans of the pictures: where they come from, who says what is where in them, and how they are looked at."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import SimpleITK as sitk  # noqa: N813

from ViTTransferFunction.Logic.core.volumes.intensity_window import IntensityWindow
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.weights.download import download
from ViTTransferFunction.Testing.support.readme_pictures.desk import Look
from ViTTransferFunction.Widget.tutorial_data import BRAIN_MR, TORSO_CT, TutorialScan


@dataclass(frozen=True)
class Scan:
    """A scan that pictures are taken of.

    Attributes:
        name: of the volume in Slicer.
        file_name: of its volume.
        look: at it.
        labels_name: a label map of it, on its grid, by others.
        structures: which labels make up each structure.
        sample: what the module Sample Data offers of it; None where it has to be got by hand.
    """

    name: str
    file_name: str
    look: Look
    labels_name: str
    structures: dict[str, tuple[int, ...]] = field(default_factory=dict)
    sample: TutorialScan | None = None

    def read(self, folder: Path) -> Volume:
        """The volume, from the folder, into which it is downloaded first where it is missing."""
        path = folder / self.file_name
        if not path.exists():
            if self.sample is None:
                raise SystemExit(f"{path} is missing, and cannot be downloaded; docs/RESULTS.md says where to get it.")
            download(self.sample.url, path, expected_sha256=self.sample.sha256)
        return replace(read_volume(path), name=self.name)

    def truth(self, folder: Path) -> dict[str, np.ndarray]:
        """The true voxels (K, J, I) bool of each structure; empty where the folder has no labels."""
        path = folder / self.labels_name
        if not path.exists():
            return {}
        labels = sitk.GetArrayFromImage(sitk.ReadImage(str(path)))
        return {name: np.isin(labels, numbers) for name, numbers in self.structures.items()}


ABDOMEN_CT = Scan(
    "AbdomenCT",
    "amos_0336_ct.nii.gz",
    Look(IntensityWindow(-120.0, 220.0), (5.0, -258.0, 1050.0), 385.0, (5.0, -250.0, 1045.0), 470.0, (-0.3, 1.0, 0.1)),
    "amos_0336_labels.nii.gz",
    {
        "liver": (6,), "spleen": (1,), "right kidney": (2,), "left kidney": (3,), "stomach": (7,), "bladder": (14,),
        "gallbladder": (4,), "left adrenal gland": (12,), "aorta": (8,),
    },
)  # fmt: skip
"""Case 336 of AMOS."""

TORSO = Scan(
    TORSO_CT.name,
    TORSO_CT.file_name,
    Look(IntensityWindow(-120.0, 220.0), (0.0, 160.0, 265.0), 365.0, (-10.0, 160.0, 350.0), 330.0, (-0.3, 1.0, 0.1)),
    "torso_small_labels.nii.gz",
    {"liver": (5,), "spleen": (1,), "right kidney": (2,), "left kidney": (3,)},
    TORSO_CT,
)

BRAIN = Scan(
    BRAIN_MR.name,
    BRAIN_MR.file_name,
    Look(IntensityWindow(0.0, 100.0), (0.0, -20.0, 5.0), 225.0, (0.0, -35.0, -18.0), 150.0, (-0.7, 1.0, 0.25)),
    "brain_labels.nii.gz",
    {
        "ventricles": (41, 92, 5, 56),
        "brain stem": (11, 62),
        "cerebellum": (46, 97, 39, 90, 50, 101, 2, 53, 20, 71),
    },
    BRAIN_MR,
)
