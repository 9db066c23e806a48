"""What is told of a label map."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.session.segmentation import label_sizes, segmentation_of

LABELS = np.array([0, 2, 2, 2, 1, 0], dtype=np.uint8).reshape(1, 2, 3)
GEOMETRY = Geometry((1, 2, 3), np.diag([2.0, 5.0, 10.0, 1.0]))


def test_sizes_are_those_of_the_labels_voxels() -> None:
    assert label_sizes(LABELS, GEOMETRY, 3) == [(1, pytest.approx(0.1)), (3, pytest.approx(0.3)), (0, 0.0)]


def test_a_class_is_told_of_by_the_label_of_its_place_also_where_it_has_no_voxel() -> None:
    requests = [ClassRequest(name, np.zeros((1, 3))) for name in ("liver", "spleen", "cyst")]
    segmentation = segmentation_of(LABELS, GEOMETRY, requests, [(0.5, True), (0.25, True), (0.75, False)])
    assert segmentation.labels is LABELS
    told = [(result.name, result.iso, result.voxels, result.reaches_iso) for result in segmentation.classes]
    assert told == [("liver", 0.5, 1, True), ("spleen", 0.25, 3, True), ("cyst", 0.75, 0, False)]
    assert [result.millilitres for result in segmentation.classes] == pytest.approx([0.1, 0.3, 0.0])
