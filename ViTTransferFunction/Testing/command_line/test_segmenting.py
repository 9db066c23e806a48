"""From an opened volume and its classes to labels: what whoever called `vittf` is told of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ViTTransferFunction.CommandLine.segmenting import segment_classes
from ViTTransferFunction.Logic.core.annotated_class import AnnotatedClass
from ViTTransferFunction.Logic.core.class_request import ClassRequest
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Testing.support.known_features import GRID, cache_known_features
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras, requests_of


def warnings_of(spheres: Spheres, requests: list[ClassRequest]) -> list[str]:
    cache_known_features(*spheres)
    warnings: list[str] = []
    classes = [AnnotatedClass(request, (1.0, 0.0, 0.0)) for request in requests]
    session = open_session(spheres[0], SessionSettings(grid=GRID))
    segment_classes(session, classes, "none", True, on_warning=warnings.append)
    return warnings


def test_of_classes_that_all_have_voxels_there_is_nothing_to_say(spheres: Spheres) -> None:
    assert warnings_of(spheres, list(requests_of(spheres))) == []


def test_a_class_that_loses_all_its_voxels_to_another_is_warned_of_with_its_name(spheres: Spheres) -> None:
    (warning,) = warnings_of(spheres, [*requests_of(spheres), ClassRequest("copy", centre_ras(spheres, 2))])
    assert warning.startswith("Class 'copy' has no voxel: whatever is similar")
    assert "its points lie in 'sphere 2'" in warning


def test_a_class_whose_iso_value_is_reached_nowhere_is_warned_of(spheres: Spheres) -> None:
    first, *others = requests_of(spheres)
    (warning,) = warnings_of(spheres, [replace(first, iso=1.0, negative=centre_ras(spheres, 3)), *others])
    assert warning.startswith("Class 'sphere 1' has no voxel: nothing is as similar to its points as its threshold, iso 1.00")
    assert "Lower its 'iso'" in warning


def test_a_point_that_is_positive_and_negative_is_warned_of(spheres: Spheres) -> None:
    first, *others = requests_of(spheres)
    (warning,) = warnings_of(spheres, [replace(first, negative=np.concatenate([first.positive, others[0].positive])), *others])
    assert warning.startswith("Class 'sphere 1': of 1 positive points, 1 stand among the negative ones as well")
