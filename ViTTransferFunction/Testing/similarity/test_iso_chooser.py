"""What iso values of maps are chosen from, gathered for each class."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.core.volumes.voxel_map import VoxelMap
from ViTTransferFunction.Logic.similarity.cell_intensities import CellIntensities
from ViTTransferFunction.Logic.similarity.iso_chooser import IsoChooser
from ViTTransferFunction.Logic.similarity.iso_value import prior_iso
from ViTTransferFunction.Logic.similarity.similarity_map import SimilarityMap
from ViTTransferFunction.Testing.support.volumes import volume_of

CELLS = (8, 8, 8)
IN_CELL_444 = np.array([[8.5, 8.5, 8.5]])
"""Its middle."""


@pytest.fixture(scope="module")
def volume() -> Volume:
    """Noise, with two voxels to a cell along each axis."""
    return volume_of(np.random.default_rng(0).normal(0.0, 100.0, (16, 16, 16)), (1.0, 1.0, 1.0))


@pytest.fixture(scope="module")
def chooser(volume: Volume) -> IsoChooser:
    return IsoChooser(CellIntensities(volume, volume.geometry.resized(CELLS)), volume.geometry)


@pytest.mark.parametrize("step", [(0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)])
def test_a_negative_point_raises_the_prior_only_where_the_map_is_high_in_its_cell_and_all_next_to_it(
    chooser: IsoChooser, step: tuple[int, int, int]
) -> None:
    low_there = np.ones(CELLS)
    low_there[tuple(np.array([4, 4, 4]) + step)] = 0.0
    request = ClassRequest("a", np.array([[2.0, 2.0, 2.0]]), negative=IN_CELL_444)
    assert chooser.prior(request, lambda cells: np.ones(len(cells))) > prior_iso(1)
    assert chooser.prior(request, lambda cells: low_there.ravel()[cells]) == prior_iso(1)


def test_a_refined_map_that_is_lowered_at_the_points_has_a_lower_iso_value(volume: Volume, chooser: IsoChooser) -> None:
    requests = [ClassRequest("a", IN_CELL_444)]
    refined = VoxelMap.whole(np.random.default_rng(0).uniform(0.3, 0.4, volume.shape).astype(np.float32))
    as_before, lowered = (
        chooser.refined_iso(refined, SimilarityMap(np.full(CELLS, value, dtype=np.float32), prior=0.2), requests, 0)
        for value in (0.35, 1.0)
    )
    assert lowered.chosen < 0.95 * as_before.chosen
