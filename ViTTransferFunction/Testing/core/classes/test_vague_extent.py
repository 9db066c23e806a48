"""What is much larger at a somewhat lower threshold is vague, by maps of balls whose similarity fades."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.class_map import FULL_SCALE, ClassMap
from ViTTransferFunction.Logic.core.classes.vague_extent import is_vague
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry

CELLS = Geometry((40, 40, 40), np.diag([2.0, 2.0, 2.0, 1.0]))
ONE, OTHER = np.array([[25.0, 25.0, 25.0]]), np.array([[60.0, 60.0, 60.0]])
ISO = 0.5


def balls(*fades_over: float) -> np.ndarray:
    """The map of a ball of 12 mm around the first place, and of another around the second, and over how much each fades."""
    array = np.zeros(CELLS.shape, dtype=np.float32)
    for middle, fade_mm in zip((ONE, OTHER), fades_over, strict=False):
        away = np.linalg.norm(CELLS.voxel_centres_ras() - middle, axis=1).reshape(CELLS.shape)
        np.maximum(array, np.clip(ISO + (12.0 - away) / fade_mm, 0.0, 1.0), out=array)
    return array


@pytest.mark.parametrize("in_bytes", [False, True])
def test_what_fades_slowly_is_vague_and_what_ends_sharply_is_not(in_bytes: bool) -> None:
    vague = {}
    for fade_mm in (8.0, 40.0):
        array = balls(fade_mm)
        array = np.rint(FULL_SCALE * array).astype(np.uint8) if in_bytes else array
        vague[fade_mm] = is_vague(ClassMap(array, CELLS, ISO), ONE)
    assert vague == {8.0: False, 40.0: True}


def test_only_what_holds_a_point_counts() -> None:
    shown = ClassMap(balls(8.0, 40.0), CELLS, ISO)
    assert (is_vague(shown, ONE), is_vague(shown, OTHER)) == (False, True)


def test_what_joins_something_else_at_a_lower_threshold_is_vague() -> None:
    array = balls(8.0, 8.0)
    along = np.linspace(ONE[0], OTHER[0], 100)
    array[tuple(CELLS.nearest_voxels(along).T)] = np.maximum(array[tuple(CELLS.nearest_voxels(along).T)], 0.45)
    assert is_vague(ClassMap(array, CELLS, ISO), ONE)


def test_where_nothing_holds_a_point_nothing_is_vague() -> None:
    nothing = ClassMap(np.zeros(CELLS.shape, dtype=np.float32), CELLS, ISO)
    assert not is_vague(nothing, ONE)
    # Found, but not where the points are: one of them lies in another component, one beyond the volume.
    assert not is_vague(ClassMap(balls(40.0), CELLS, ISO), np.concatenate([OTHER, ONE + 500.0]))
