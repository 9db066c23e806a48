"""A few points that stand for a structure."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike

from ViTTransferFunction.Logic.core.classes import label_points
from ViTTransferFunction.Logic.core.classes.label_points import points_in_label
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.stepped_work import STEP_VOXELS, SteppedWork, finished
from ViTTransferFunction.Logic.core.volumes.voxel_digest import label_boxes

OBLIQUE = np.array([[0.6, -0.96, 0.0, 11.0], [0.48, 0.36, -2.4, -7.0], [0.64, 0.48, 1.8, 40.0], [0.0, 0.0, 0.0, 1.0]])
"""Spacing 1.0×1.2×3.0 mm, rotated about two axes."""


def points_in(labels: np.ndarray, count: int = 5, ijk_to_ras: np.ndarray = OBLIQUE) -> np.ndarray:
    """Points of label 1, as (k, j, i) of the voxels that they are in."""
    geometry = Geometry(labels.shape, ijk_to_ras)
    boxes = finished(label_boxes(labels))
    points = finished(points_in_label(labels, 1, boxes[1], geometry, count))
    voxels = geometry.ras_to_ijk(points)[:, ::-1]
    np.testing.assert_allclose(voxels, np.round(voxels), atol=1e-6)
    return np.round(voxels).astype(int)


def ellipsoid(shape: tuple[int, int, int], centre: ArrayLike, radii: ArrayLike) -> np.ndarray:
    places = np.moveaxis(np.indices(shape), 0, -1)
    return (np.linalg.norm((places - np.array(centre)) / np.array(radii), axis=-1) < 1.0).astype(np.uint8)


@pytest.mark.parametrize("shape", [(20, 40, 50), (60, 160, 200)], ids=["cells are voxels", "cells are larger"])
def test_points_lie_deep_inside_and_far_apart(shape: tuple[int, int, int]) -> None:
    centre, radii = 0.5 * np.array(shape), 0.42 * np.array(shape)
    labels = ellipsoid(shape, centre, radii)
    voxels = points_in(labels)
    assert len(voxels) == 5
    assert labels[tuple(voxels.T)].all()
    from_middle = np.linalg.norm((voxels - centre) / radii, axis=1)
    assert from_middle.max() < 0.75
    lengths_mm = radii * [3.0, 1.2, 1.0]
    between = [np.linalg.norm((a - b) * [3.0, 1.2, 1.0]) for n, a in enumerate(voxels) for b in voxels[:n]]
    assert min(between) > 0.25 * lengths_mm.min()


def test_of_many_small_parts_the_largest_get_the_points() -> None:
    labels = np.zeros((20, 50, 50), dtype=np.uint8)
    for j, i in np.ndindex(6, 6):
        labels[5:8, 8 * j : 8 * j + 3, 8 * i : 8 * i + 3] = 1
    for i in (0, 2, 4):
        labels[5:9, 0:3, 8 * i : 8 * i + 3] = 1
    voxels = points_in(labels, count=3)
    assert sorted((voxels[:, 1:] // 8).tolist()) == [[0, 0], [0, 2], [0, 4]]
    assert labels[tuple(voxels.T)].all()


def test_distances_are_in_millimetres() -> None:
    """Of a slab that is longest along K in millimetres, but not in voxels."""
    labels = np.ones((20, 30, 30), dtype=np.uint8)
    first, second = points_in(labels, 2, np.diag([0.5, 0.5, 5.0, 1.0]))
    assert abs(first[0] - second[0]) >= 4


def test_every_part_of_relevant_size_gets_a_point_and_a_speck_gets_none() -> None:
    labels = np.zeros((30, 30, 60), dtype=np.uint8)
    for start in (2, 22, 42):
        labels[5:20, 5:20, start : start + 12] = 1
    labels[27, 27, 57] = 1
    voxels = points_in(labels, count=1)
    assert sorted(voxels[:, 2] // 20) == [0, 1, 2]


def test_a_structure_of_a_single_voxel_gives_that_voxel() -> None:
    labels = np.zeros((5, 6, 7), dtype=np.uint8)
    labels[2, 3, 4] = 1
    np.testing.assert_array_equal(points_in(labels), [[2, 3, 4]])


def test_a_point_is_in_the_middle_of_what_its_cell_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(label_points, "MAX_CELLS", 1)
    labels = np.zeros((9, 9, 9), dtype=np.uint8)
    labels[:, :, :5] = 1
    np.testing.assert_array_equal(points_in(labels, ijk_to_ras=np.eye(4)), [[4, 4, 2]])


def test_where_no_voxel_carries_the_label_there_is_no_point() -> None:
    labels = np.zeros((5, 6, 7), dtype=np.uint8)
    points = finished(points_in_label(labels, 1, (slice(0, 5),) * 3, Geometry(labels.shape, OBLIQUE), 5))
    assert points.shape == (0, 3)


def test_points_of_a_thin_structure_in_a_large_box_lie_on_it() -> None:
    labels = np.zeros((200, 200, 200), dtype=np.uint8)
    diagonal = np.arange(200)
    labels[diagonal, diagonal, diagonal] = 1
    voxels = points_in(labels, ijk_to_ras=np.eye(4))
    assert len(voxels) == 5
    assert labels[tuple(voxels.T)].all()
    assert np.ptp(voxels[:, 0]) > 150


def test_a_bent_structure_has_no_point_beside_it() -> None:
    """The middle of a ring is not in it."""
    labels = ellipsoid((9, 60, 60), (4, 30, 30), (9.0, 28.0, 28.0)) - ellipsoid((9, 60, 60), (4, 30, 30), (90.0, 18.0, 18.0))
    voxels = points_in((labels == 1).astype(np.uint8))
    assert labels[tuple(voxels.T)].all()
    assert np.linalg.norm(voxels.mean(axis=0)[1:] - 30) < 12


def test_a_large_structure_is_looked_at_in_several_steps() -> None:
    labels = np.ones((40, 512, 256), dtype=np.uint8)
    work = SteppedWork(
        points_in_label(labels, 1, (slice(0, 40), slice(0, 512), slice(0, 256)), Geometry(labels.shape, np.eye(4)), 5)
    )
    before = 0
    while not work.advance(0.0):
        assert work.done - before <= STEP_VOXELS
        before = work.done
    assert work.result is not None
    assert len(work.result) == 5
