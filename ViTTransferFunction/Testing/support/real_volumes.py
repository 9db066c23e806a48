"""The real volumes that tests ask for."""

from __future__ import annotations

REAL_VOLUMES = (
    "torso_small_ct.nii.gz",
    "torso_small_labels.nii.gz",
    "torso_dicom",
    "amos_0336_labels.nii.gz",
    "brain_labels.nii.gz",
)
"""Files, and a folder, of the one that VITTF_TEST_VOLUMES names; CONTRIBUTING.md says where they come from."""
