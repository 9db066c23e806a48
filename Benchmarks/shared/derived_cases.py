"""Cases made of the labelled scans: organ-filling and half-body crops, thick slices, large voxels, noise, a narrow window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from Benchmarks.shared import case_changes
from Benchmarks.shared.labelled_cases import CHEST, SCANS, Case, LabelledVolume


@dataclass(frozen=True)
class DerivedCase:
    """A labelled scan, changed."""

    name: str
    of: Case
    change: Callable[[LabelledVolume], LabelledVolume]

    def read(self, folder: Path) -> LabelledVolume:
        """The changed scan and its labels, from the folder that holds the files of the scan."""
        return self.change(self.of.read(folder))


@dataclass(frozen=True)
class OrganFillingCrop:
    """The part of a labelled scan that some structures fill to a quarter."""

    name: str
    of: Case
    filled_by: tuple[str, ...]

    def read(self, folder: Path) -> LabelledVolume:
        """The part and its labels, from the folder that holds the files of the scan."""
        return case_changes.filled_by(self.of.read(folder), self.filled_by)


AMOS, TORSO, BRAIN = SCANS

ORGAN_FILLING_CROPS = (
    OrganFillingCrop("amos_0336 liver crop", AMOS, ("liver",)),
    OrganFillingCrop("torso_small liver crop", TORSO, ("liver",)),
    OrganFillingCrop("chest lungs crop", CHEST, ("right lung", "left lung")),
)
WORSE_SCANS = (
    DerivedCase("amos_0336 right half", AMOS, case_changes.right_half),
    DerivedCase("amos_0336 10 mm slices", AMOS, partial(case_changes.thick_slices, thickness_mm=10.0)),
    DerivedCase("amos_0336 half resolution", AMOS, case_changes.half_resolution),
    DerivedCase("amos_0336 noise ×2", AMOS, case_changes.twice_the_noise),
    DerivedCase("amos_0336 soft tissue window", AMOS, case_changes.soft_tissue_only),
    DerivedCase("torso_small 5 mm slices", TORSO, partial(case_changes.thick_slices, thickness_mm=5.0)),
    DerivedCase("brain 5 mm slices", BRAIN, partial(case_changes.thick_slices, thickness_mm=5.0)),
    DerivedCase("brain noise ×2", BRAIN, case_changes.twice_the_noise),
)
