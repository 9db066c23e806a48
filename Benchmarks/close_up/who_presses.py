"""Which structures a user would look at closely: those that they would call small or thin in the scan."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from Benchmarks.shared.labelled_cases import LabelledVolume

# These say who, as we believe, would press "Look closer": somebody who knows anatomy, and does not know the truth. Nothing was
# tuned by them, and the method does not have them.
BODY_ML = 50.0
"""Below this, a structure is small in a scan of a trunk: glands, gall bladder, prostate, single ribs."""
BRAIN_ML = 15.0
"""The same of a brain: basal ganglia, ventricles, vermis."""
SMALL_ML = {"amos_0336 all": BODY_ML, "brain 20": BRAIN_ML, "torso_small all": BODY_ML}
"""By case, in the order of the report."""
TUBES = (
    "aorta", "inferior vena cava", "portal vein and splenic vein", "iliac artery", "iliac vena", "esophagus", "spinal cord",
)  # fmt: skip
"""Thin whatever their volume; a side may follow the name."""


def small_or_thin(labelled: LabelledVolume, small_ml: float) -> tuple[str, ...]:
    """The structures that a user would call so.

    Args:
        labelled: the volume and its truth.
        small_ml: below this volume a structure is small.
    """
    return tuple(name for name, ml in volumes_ml(labelled) if ml < small_ml or name.startswith(TUBES))


def volumes_ml(labelled: LabelledVolume) -> Iterator[tuple[str, float]]:
    """Each structure and its true volume."""
    voxels = np.bincount(labelled.truth.ravel(), minlength=len(labelled.names) + 1)[1:]
    voxel_ml = labelled.volume.geometry.voxel_volume_mm3 / 1000.0
    yield from zip(labelled.names, (voxels * voxel_ml).tolist(), strict=True)
