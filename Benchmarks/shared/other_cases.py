"""Labelled scans that hardly anything was chosen on; docs/RESULTS.md has the exceptions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import SimpleITK as sitk  # noqa: N813

from Benchmarks.shared.labelled_cases import Case, LabelledCase, LabelledVolume
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.label_dtype import label_dtype
from ViTTransferFunction.Logic.files.volume_files import read_volume

_SEGMENTATOR = "totalsegmentator-2.18.0/tests/reference_files"
"""Of that package's source distribution; the labels are its own predictions."""
_RADIOMICS = "pyradiomics/data"
"""Of that repository."""


@dataclass(frozen=True)
class MaskCase:
    """A scan whose structures are in a file each, which may hold a part of the scan alone.

    Attributes:
        volume: file of the scan.
        masks: file of each structure; what is in several belongs to the last.
    """

    name: str
    volume: str
    masks: dict[str, str]

    def read(self, folder: Path) -> LabelledVolume:
        """The scan and its labels, from the folder that holds the files."""
        scan = sitk.ReadImage(str(folder / self.volume))
        truth = np.zeros(scan.GetSize()[::-1], dtype=label_dtype(len(self.masks)))
        for label, file in enumerate(self.masks.values(), start=1):
            mask = sitk.Resample(sitk.ReadImage(str(folder / file)), scan, sitk.Transform(), sitk.sitkNearestNeighbor)
            truth[sitk.GetArrayViewFromImage(mask) > 0] = label
        return LabelledVolume(read_volume(folder / self.volume), truth, tuple(self.masks))


OTHERS: tuple[Case | MaskCase, ...] = (
    Case(
        "abdomen MR", f"{_SEGMENTATOR}/example_mr_sm.nii.gz", f"{_SEGMENTATOR}/example_seg_mr.nii.gz",
        {
            "spleen": (1,), "right kidney": (2,), "left kidney": (3,), "gallbladder": (4,), "liver": (5,), "stomach": (6,),
            "pancreas": (7,), "colon": (15,), "vertebrae": (19,), "left back muscles": (46,), "right back muscles": (47,),
        },
    ),
    MaskCase(
        "aortic dissection", f"{_SEGMENTATOR}/aorta_report/example_ct.nii.gz",
        {
            "heart": f"{_SEGMENTATOR}/pulmonary_report/models/heart.nii.gz",
            "aorta": f"{_SEGMENTATOR}/aorta_report/test_result/models/aorta.nii.gz",
            "pulmonary artery": f"{_SEGMENTATOR}/pulmonary_report/models/pulmonary_artery.nii.gz",
        },
    ),
    *(
        Case(name, f"{_RADIOMICS}/{file}_image.nrrd", f"{_RADIOMICS}/{file}_label.nrrd", {"tumour": (1,)})
        for name, file in (("brain tumour 1", "brain1"), ("brain tumour 2", "brain2"), ("breast tumour", "breast1"))
    ),
)  # fmt: skip
"""Of the abdomen, an MR in slices of 3 mm, every structure of 25 ml and more. The dissected aorta, 246 ml, is in a chest CT
with contrast. The tumours take up 16, 2 and 0.1 ml of MRs, those of the brain in slices of 6.5 mm."""


def without_missing(cases: Sequence[LabelledCase], folder: Path) -> tuple[list[LabelledCase], list[str]]:
    """Of cases, those whose files are there or have to be, and the names of these whose files are not."""
    missing = [case.name for case in OTHERS if not (folder / case.volume).is_file()]
    left_out = [case.name for case in cases if case.name in missing]
    return [case for case in cases if case.name not in left_out], left_out


def cases_there(cases: Sequence[LabelledCase], folder: Path, own: Sequence[LabelledCase] = ()) -> list[LabelledCase]:
    """`without_missing`, and whoever measures is told what is left out; then `own`, scans of the user that are in the folder.

    Raises:
        InputError: that is none at all.
    """
    there, missing = without_missing(cases, folder)
    if not (there or own):
        looked_for = ", ".join(missing) or "scans of your own"
        raise InputError(
            f"Nothing to measure: looked in {folder} for {looked_for}. docs/RESULTS.md says where to get labelled scans, and "
            "how to have your own measured; --cases chooses others."
        )
    if missing:
        print(f"Not in {folder}, and left out: {', '.join(missing)}. docs/RESULTS.md says where to get them.")
    return [*there, *own]
