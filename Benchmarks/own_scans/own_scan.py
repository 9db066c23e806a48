"""A labelled scan of the user's own: an image, and a Slicer segmentation beside it."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from Benchmarks.shared.every_structure import LEAST_VOXELS
from Benchmarks.shared.labelled_cases import LabelledCase, LabelledVolume
from Benchmarks.shared.other_cases import cases_there
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.resampling import resample_labels
from ViTTransferFunction.Logic.files.image_formats import SEGMENTATION_ENDING, VOLUME_ENDINGS, volume_ending
from ViTTransferFunction.Logic.files.segmentation_files import read_segmentation
from ViTTransferFunction.Logic.files.volume_files import read_volume


@dataclass(frozen=True)
class OwnScan:
    """The scan of a name in a folder: `NAME.nii.gz`, or with another of `VOLUME_ENDINGS`, and `NAME.seg.nrrd`."""

    name: str

    def read(self, folder: Path) -> LabelledVolume:
        """The scan, and its segments that are large enough to be clicked on.

        Raises:
            InputError: there is no such scan or more than one, a file cannot be read, or no segment lies in the scan.
        """
        volume = read_volume(self._path(folder))
        labels, geometry, segments = read_segmentation(folder / f"{self.name}{SEGMENTATION_ENDING}")
        truth = resample_labels(labels, geometry, volume.geometry)
        counts = np.bincount(truth.ravel(), minlength=len(segments) + 1)
        large = [label for label in range(1, len(segments) + 1) if counts[label] >= LEAST_VOXELS]
        if not large:
            raise InputError(
                f"No segment of {self.name}{SEGMENTATION_ENDING} has {LEAST_VOXELS} voxels of the scan; nothing can be clicked."
            )
        names = tuple(segment.name for segment in segments)
        return LabelledVolume(volume, truth, names).only(large)

    def _path(self, folder: Path) -> Path:
        paths = [path for path in sorted(folder.iterdir()) if path.is_file() and _named_scan(path) == self.name]
        if len(paths) != 1:
            found = f"found {', '.join(path.name for path in paths)}" if paths else "found none"
            raise InputError(
                f"{folder / self.name}{SEGMENTATION_ENDING} needs one scan of its name beside it, ending in "
                f"{', '.join(VOLUME_ENDINGS)}; {found}."
            )
        return paths[0]


def _named_scan(path: Path) -> str:
    """The name of a file without its ending, if that is a scan's, else ""."""
    ending = volume_ending(path)
    return path.name[: -len(ending)] if ending else ""


def own_scan_names(folder: Path) -> list[str]:
    """Those that have a segmentation in a folder."""
    # Beside each file that a Mac copies to a shared disk, it puts one with `._` in front.
    paths = [path for path in folder.glob(f"*{SEGMENTATION_ENDING}") if not path.name.startswith(".")]
    return sorted(path.name.removesuffix(SEGMENTATION_ENDING) for path in paths)


def own_scans(folder: Path) -> list[OwnScan]:
    """All that have a segmentation in a folder, by name. Raises InputError where there is none."""
    names = own_scan_names(folder)
    if not names:
        raise InputError(
            f"{folder} has no NAME{SEGMENTATION_ENDING}; put scans there, NAME.nii.gz, and a segmentation beside each."
        )
    return [OwnScan(name) for name in names]


def asked_and_own(cases: Sequence[LabelledCase], options: argparse.Namespace) -> list[LabelledCase]:
    """Of labelled cases, those that the command line asks for and that are there; then all scans of the user's own.

    Raises:
        InputError: that is none at all.
    """
    asked = [case for case in cases if case.name in options.cases]
    return cases_there(asked, options.volumes, [OwnScan(name) for name in own_scan_names(options.volumes)])
