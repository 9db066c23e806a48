"""Maps with iso values: of other sizes, and near a point."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.class_map import ClassMap, is_near
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.classes.iso_proposals import IsoProposals
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry

OBLIQUE = np.array([[0.6, -0.96, 0.0, 11.0], [0.48, 0.36, -2.4, -7.0], [0.64, 0.48, 1.8, 40.0], [0.0, 0.0, 0.0, 1.0]])
"""Spacing 1.0×1.2×3.0 mm, rotated about two axes."""
PROPOSALS = IsoProposals(smaller=0.4, chosen=0.2, larger=0.05)
SHAPE = (20, 20, 20)
MAP = ClassMap(np.zeros(SHAPE, dtype=np.float32), Geometry(SHAPE, np.eye(4)), 0.2, PROPOSALS)


def request(size: float = 0.0, iso: float | None = None) -> ClassRequest:
    return ClassRequest("a", np.zeros((1, 3)), size=size, iso=iso)


def test_a_map_takes_the_iso_value_of_a_size_or_the_one_that_is_fixed() -> None:
    assert MAP.resized(request(size=1.0)).iso == pytest.approx(0.05)
    assert MAP.resized(request(size=1.0)).resized(request(size=-1.0)).iso == pytest.approx(0.4)
    assert MAP.resized(request(iso=0.7)).iso == 0.7
    assert MAP.resized(request(iso=0.7)).resized(request()).iso == 0.7


@pytest.mark.parametrize("dtype", [np.float32, np.uint8])
def test_a_point_is_near_within_the_structure_and_as_far_beyond_as_it_is_said(dtype: type) -> None:
    k, j, i = np.indices(SHAPE) - 10.0
    array = np.clip(0.5 + (5.0 - np.sqrt(k**2 + j**2 + i**2)) / 2.0, 0.0, 1.0)
    geometry = Geometry(SHAPE, OBLIQUE)
    class_map = ClassMap((array if dtype is np.float32 else np.rint(255 * array)).astype(dtype), geometry, 0.5)
    centre, border = geometry.ijk_to_ras_points(np.array([[10.0, 10.0, 10.0], [15.0, 10.0, 10.0]]))
    outwards = (border - centre) / np.linalg.norm(border - centre)
    assert is_near(class_map, centre, reach_mm=3.0)
    assert is_near(class_map, border + 2.0 * outwards, reach_mm=3.0)
    assert not is_near(class_map, border + 4.5 * outwards, reach_mm=3.0)


def test_nothing_is_near_beyond_a_map_that_its_border_cuts() -> None:
    everywhere = ClassMap(np.ones(SHAPE, dtype=np.float32), Geometry(SHAPE, np.eye(4)), 0.5)
    assert is_near(everywhere, np.array([21.0, 10.0, 10.0]), reach_mm=3.0)
    assert not is_near(everywhere, np.array([24.0, 10.0, 10.0]), reach_mm=3.0)
