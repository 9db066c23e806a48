"""What the shader reads of the surroundings of structures."""

from __future__ import annotations

import numpy as np

from ViTTransferFunction.Logic.rendering.surroundings import BONE, Surroundings


def test_what_is_opaque_is_as_dense_as_a_number_can_say() -> None:
    """As in some of Slicer's presets."""
    around = Surroundings(((0.0, BONE, 0.0), (100.0, BONE, 1.0)))
    density = np.diff(around.colors(np.arange(256.0), unit_voxels=2.0)[:, 3])
    assert np.isfinite(density).all()
    assert density[0] < density[-1] == density.max()
