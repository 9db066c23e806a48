"""From maps to labels."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from ViTTransferFunction.Logic.core.system.errors import Cancelled
from ViTTransferFunction.Logic.core.volumes.bounding_box import whole_box
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.session import labels as labels_module
from ViTTransferFunction.Logic.session.labels import Competition, count_labels, keep_annotated_components

SHAPE = (1, 1, 5)


def a_map(*values: float) -> np.ndarray:
    return np.array(values, dtype=np.float32).reshape(SHAPE)


def labels_of(*maps: tuple[np.ndarray, float]) -> list[int]:
    """What classes win by their maps and iso values, of each voxel."""
    competition = Competition(SHAPE, np.uint16)
    for similarity, iso in maps:
        competition.enter(similarity, iso, whole_box(SHAPE))
    labels: list[int] = competition.labels.ravel().tolist()
    return labels


def test_each_voxel_goes_to_the_class_furthest_above_its_own_iso_value() -> None:
    first, second = a_map(0.9, 0.6, 0.4, 0.1, 0.0), a_map(0.1, 0.6, 0.4, 0.3, 0.1)
    assert labels_of((first, 0.5), (second, 0.2)) == [1, 2, 2, 2, 0]


def test_a_later_class_need_not_be_far_above_an_earlier_one() -> None:
    assert labels_of((a_map(0.6, 0.6, 0.6, 0.6, 0.6), 0.5), (a_map(0.601, 0.599, 0.7, 0.5, 0.4), 0.5)) == [2, 1, 2, 1, 1]


def test_a_voxel_at_the_iso_value_is_selected_and_a_tie_goes_to_the_first_class() -> None:
    assert labels_of((a_map(0.5, 0.8, 0, 0, 0), 0.5), (a_map(0.5, 0.8, 0, 0, 0), 0.5)) == [1, 1, 0, 0, 0]


def test_what_rounding_makes_of_equal_maps_is_a_tie() -> None:
    values = np.array([0.5, 0.25, 0.75, 0.3, 0.2], dtype=np.float32)
    rounded = values * np.array([1.0, 1.0 + 1e-5, 1.0 - 1e-5, 1.0 + 2e-5, 1.0], dtype=np.float32)
    assert labels_of((a_map(*values), 0.25), (a_map(*rounded), 0.25)) == [1, 1, 1, 1, 0]


@pytest.mark.parametrize("shape", [(9, 8, 7), (4, 4, 9), (3, 10, 4)])
def test_in_a_volume_of_many_blocks_classes_compete_as_in_a_single_one(
    shape: tuple[int, int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    maps = np.random.default_rng(0).random((3, *shape), dtype=np.float32)

    def won() -> np.ndarray:
        competition = Competition(shape, np.uint8)
        for similarity, iso in zip(maps, (0.5, 0.3, 0.6), strict=True):
            competition.enter(similarity, iso, whole_box(shape))
        return competition.labels

    at_once = won()
    monkeypatch.setattr(labels_module, "BLOCK_VOXELS", 4)
    np.testing.assert_array_equal(won(), at_once)


def test_a_class_whose_map_reaches_its_iso_value_nowhere_wins_nothing_and_keeps_its_label() -> None:
    competition = Competition(SHAPE, np.uint8)
    assert not competition.enter(None, 0.5, None)
    assert not competition.enter(a_map(0.0, 0.0, 0.0, 0.0, 0.0), 0.0, whole_box(SHAPE))
    assert competition.enter(a_map(0.9, 0.1, 0.0, 0.0, 0.0), 0.5, whole_box(SHAPE))
    assert competition.labels.ravel().tolist() == [3, 0, 0, 0, 0]


def test_every_label_is_counted_also_one_that_no_voxel_carries() -> None:
    assert count_labels(np.array([0, 3, 3, 1, 0], dtype=np.uint16).reshape(SHAPE), 4) == [1, 0, 2, 0]


def test_only_components_with_a_point_are_kept() -> None:
    labels = np.zeros((3, 9, 9), dtype=np.uint16)
    labels[1, 1:3, 1:3] = 1
    labels[1, 6:8, 6:8] = 1
    labels[0, 5, 5] = 1  # Touches the second part by a corner only, and belongs to it.
    labels[1, 1:3, 6:8] = 2
    keep_annotated_components(labels, Geometry(labels.shape, np.eye(4)), {1: np.array([[7.0, 7.0, 1.0]])})
    assert not labels[1, 1:3, 1:3].any()
    assert (labels[1, 6:8, 6:8] == 1).all()
    assert labels[0, 5, 5] == 1
    assert (labels[1, 1:3, 6:8] == 2).all()


def test_in_a_large_volume_components_are_not_looked_for_once_a_point(monkeypatch: pytest.MonkeyPatch) -> None:
    """Points come in the order in which they were placed, up and down the volume."""
    searched: list[int] = []

    def label(*args: Any, **options: Any) -> Any:
        searched.append(len(args[0]))
        return ndimage.label(*args, **options)

    monkeypatch.setattr(labels_module, "SLAB_VOXELS", 2 * 9 * 9)
    monkeypatch.setattr(labels_module, "ndimage", SimpleNamespace(label=label))
    labels = np.ones((8, 9, 9), dtype=np.uint16)
    points = np.array([[4.0, 4.0, k] for k in (0, 7, 2, 5, 1, 6) * 5])

    keep_annotated_components(labels, Geometry(labels.shape, np.eye(4)), {1: points})

    slabs = 4
    assert len(searched) <= 3 * slabs
    assert labels.all()


@pytest.mark.parametrize("slices", [0, 1, 2, 3])
def test_in_a_large_volume_the_same_components_are_kept(slices: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts meet by faces, edges and corners, also where the volume is looked at in slabs; 0: one slice is more than a slab."""
    monkeypatch.setattr(labels_module, "SLAB_VOXELS", slices * 9 * 9)
    labels = (np.random.default_rng(slices).random((8, 9, 9)) < 0.06).astype(np.uint16)
    components, count = ndimage.label(labels, structure=np.ones((3, 3, 3)))
    assert count > 10
    for component in range(1, count + 1):
        kept = labels.copy()
        points = np.argwhere(components == component)[:1, ::-1].astype(float)
        keep_annotated_components(kept, Geometry(labels.shape, np.eye(4)), {1: points})
        np.testing.assert_array_equal(kept > 0, components == component)


def test_a_click_need_not_wait_until_the_components_of_all_labels_are_found() -> None:
    labels = np.zeros((3, 9, 9), dtype=np.uint16)
    labels[1, 1:3, 1:3], labels[1, 1:3, 6:8] = 1, 2
    points = {label: np.array([[1.0, 1.0, 1.0]]) for label in (1, 2)}
    steps = 0

    def between() -> None:
        nonlocal steps
        steps += 1
        if steps == 3:
            raise Cancelled("before the second label")

    with pytest.raises(Cancelled):
        keep_annotated_components(labels, Geometry(labels.shape, np.eye(4)), points, between)


def test_where_no_point_hits_a_component_nothing_is_removed() -> None:
    labels = np.zeros((3, 9, 9), dtype=np.uint16)
    labels[1, 1:3, 1:3] = 1
    before = labels.copy()
    geometry = Geometry(labels.shape, np.eye(4))
    keep_annotated_components(labels, geometry, {1: np.array([[7.0, 7.0, 1.0]])})
    keep_annotated_components(labels, geometry, {2: np.array([[7.0, 7.0, 1.0]])})
    np.testing.assert_array_equal(labels, before)
