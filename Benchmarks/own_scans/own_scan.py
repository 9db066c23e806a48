"""A labelled scan of the user's own: an image, and a Slicer segmentation beside it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from Benchmarks.shared.every_structure import LEAST_VOXELS
from Benchmarks.shared.labelled_cases import LabelledVolume
from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Logic.core.resampling import resample_labels
from ViTTransferFunction.Logic.files.segmentation_files import read_segmentation
from ViTTransferFunction.Logic.files.volume_files import read_volume

SEGMENTATION_ENDING = ".seg.nrrd"
SCAN_ENDINGS = (".nii.gz", ".nii", ".nrrd", ".mha")


@dataclass(frozen=True)
class OwnScan:
    """The scan of a name in a folder: `NAME.nii.gz`, or with another of `SCAN_ENDINGS`, and `NAME.seg.nrrd`."""

    name: str

    def read(self, folder: Path) -> LabelledVolume:
        """The scan, and its segments that are large enough to be clicked on.

        Raises:
            InputError: there is no such scan, a file cannot be read, or no segment lies in the scan.
        """
        paths = [folder / f"{self.name}{ending}" for ending in SCAN_ENDINGS]
        path = next((each for each in paths if each.is_file()), None)
        if path is None:
            raise InputError(
                f"There is no scan to {self.name}{SEGMENTATION_ENDING}; expected one of {', '.join(map(str, paths))}."
            )
        volume = read_volume(path)
        labels, geometry, segments = read_segmentation(folder / f"{self.name}{SEGMENTATION_ENDING}")
        truth = resample_labels(labels, geometry, volume.geometry)
        counts = np.bincount(truth.ravel(), minlength=len(segments) + 1)
        large = [label for label in range(1, len(segments) + 1) if counts[label] >= LEAST_VOXELS]
        if not large:
            raise InputError(
                f"No segment of {self.name}{SEGMENTATION_ENDING} has {LEAST_VOXELS} voxels of the scan; nothing can be clicked."
            )
        names = tuple(segment.name for segment in segments)
        return LabelledVolume(volume, truth.astype(np.uint8), names).only(large)


def own_scans(folder: Path) -> list[OwnScan]:
    """All that have a segmentation in a folder, by name. Raises InputError where there is none."""
    names = sorted(path.name.removesuffix(SEGMENTATION_ENDING) for path in folder.glob(f"*{SEGMENTATION_ENDING}"))
    if not names:
        raise InputError(
            f"{folder} has no NAME{SEGMENTATION_ENDING}; put scans there, NAME.nii.gz, and a segmentation beside each."
        )
    return [OwnScan(name) for name in names]
