"""The labelled scans with all structures that somebody labelled in them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from Benchmarks.shared.labelled_cases import SCANS, Case, LabelledVolume, read_labels
from ViTTransferFunction.Logic.core.volumes.label_dtype import label_dtype
from ViTTransferFunction.Logic.files.volume_files import read_volume

LEAST_ML = 1.0
LEAST_VOXELS = 50
"""What is smaller can hardly be clicked."""


@dataclass(frozen=True)
class EveryStructureCase:
    """Each label of a scan as a structure of its own, if it is large enough.

    Attributes:
        of: the scan, which gives the files.
        names: file of label numbers and names, JSON.
    """

    name: str
    of: Case
    names: str

    def read(self, folder: Path) -> LabelledVolume:
        """The scan and its labels, from the folder that holds the files."""
        names = json.loads((folder / self.names).read_text(encoding="utf-8"))
        volume, labels = read_volume(folder / self.of.volume), read_labels(folder / self.of.labels)
        voxel_ml = volume.geometry.voxel_volume_mm3 / 1000.0
        large = [
            label
            for label, voxels in zip(*np.unique(labels, return_counts=True), strict=True)
            if label and voxels >= LEAST_VOXELS and voxels * voxel_ml >= LEAST_ML
        ]
        truth = np.zeros(labels.shape, dtype=label_dtype(len(large)))
        for index, label in enumerate(large, start=1):
            truth[labels == label] = index
        return LabelledVolume(volume, truth, tuple(names[str(label)].replace("_", " ").lower() for label in large))


EVERY_STRUCTURE: tuple[EveryStructureCase | Case, ...] = (
    EveryStructureCase("amos_0336 all", SCANS[0], "amos_0336_labels.json"),
    EveryStructureCase("torso_small all", SCANS[1], "torso_small_labels.json"),
    Case(
        "brain 20", "brain_t1.nii.gz", "brain_labels.nii.gz",
        {
            "lateral ventricles": (41, 92), "inferior lateral ventricles": (5, 56), "third ventricle": (29, 80),
            "fourth ventricle": (37, 88), "thalamus": (40, 91), "caudate": (49, 100), "putamen": (21, 72),
            "pallidum": (27, 78), "accumbens": (4, 55), "amygdala": (19, 70), "hippocampus": (48, 99),
            "ventral diencephalon": (26, 77), "brainstem": (11, 62), "cerebellar grey matter": (46, 97),
            "cerebellar white matter": (39, 90), "vermis": (2, 20, 50, 53, 71, 101), "insula": (23, 74),
            "precentral gyrus": (35, 86), "postcentral gyrus": (13, 64), "superior frontal gyrus": (38, 89),
        },
    ),
)  # fmt: skip
"""Brains have one side's label numbers and the other's; of the 51 pairs, twenty of every kind."""
