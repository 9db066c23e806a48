"""A volume from clicks to labels, on features with a known answer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ViTTransferFunction.Logic.core.annotations import AnnotatedClass
from ViTTransferFunction.Logic.core.errors import Cancelled, InputError
from ViTTransferFunction.Logic.core.volume import Volume
from ViTTransferFunction.Logic.features.cache import FeatureCache
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession
from ViTTransferFunction.Logic.similarity.cosine import SimilarityMethod
from ViTTransferFunction.Logic.weights.models import pretrained_model
from ViTTransferFunction.Logic.weights.sources import WeightsFile
from ViTTransferFunction.Testing.support.known_features import SETTINGS, cache_known_features

MODEL = pretrained_model(PRESETS[DEFAULT_PRESET].model)
WEIGHTS = WeightsFile(Path("none"), MODEL.sha256 or "", MODEL, "nowhere")
CENTRES_RAS = [(32.0, 50.0, 29.0 + 24.0), (0.0, 0.0, 0.0)]


@pytest.fixture
def session(spheres: tuple[Volume, np.ndarray]) -> SegmentationSession:
    """A session on the spheres whose features, in the cache, tell exactly how much of each label a cell holds."""
    volume, labels = spheres
    cache_known_features(volume, labels)
    session = SegmentationSession(volume, PRESETS[DEFAULT_PRESET], SETTINGS, FeatureCache())
    assert session.load_features(WEIGHTS, torch.device("cpu")).cached
    return session


def centre_ras(spheres: tuple[Volume, np.ndarray], label: int) -> np.ndarray:
    volume, labels = spheres
    return volume.geometry.ijk_to_ras_points(np.argwhere(labels == label).mean(axis=0)[::-1])


def classes_of(spheres: tuple[Volume, np.ndarray], **fields: object) -> list[AnnotatedClass]:
    colors = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    return [AnnotatedClass(f"sphere {n}", colors[n - 1], centre_ras(spheres, n), **fields) for n in (1, 2, 3)]  # type: ignore[arg-type]


def dice(a: np.ndarray, b: np.ndarray) -> float:
    return 2.0 * float((a & b).sum()) / float(a.sum() + b.sum())


@pytest.mark.parametrize(("method", "least"), [("none", 0.7), ("bilateral", 0.9), ("guided", 0.85)])
def test_one_click_a_class_finds_each_sphere(
    session: SegmentationSession, spheres: tuple[Volume, np.ndarray], method: str, least: float
) -> None:
    segmentation = session.segment(classes_of(spheres), method)  # type: ignore[arg-type]
    for label in (1, 2, 3):
        assert dice(segmentation.labels == label, spheres[1] == label) > least


def test_results_say_the_iso_value_and_the_volume_in_millilitres(
    session: SegmentationSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    segmentation = session.segment(classes_of(spheres))
    for label, result in enumerate(segmentation.classes, start=1):
        voxels = int((segmentation.labels == label).sum())
        assert result.name == f"sphere {label}"
        assert result.voxels == voxels
        assert result.millilitres == pytest.approx(voxels * 12.0 / 1000.0)
        assert 0.0 < result.iso < 1.0


def test_an_iso_value_that_the_user_set_is_used_as_it_is(
    session: SegmentationSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    loose, strict = (session.segment(classes_of(spheres, iso=iso)).classes[0] for iso in (0.3, 0.9))
    assert (loose.iso, strict.iso) == (0.3, 0.9)
    assert loose.voxels > strict.voxels


def test_parts_without_a_click_are_dropped_unless_asked_for(
    session: SegmentationSession, spheres: tuple[Volume, np.ndarray]
) -> None:
    both = np.isin(spheres[1], (1, 2))
    volume = spheres[0]
    # Sphere 2's click belongs to no class here, so that spheres 1 and 2, whose features differ, need two clicks.
    points = np.concatenate([centre_ras(spheres, 1), centre_ras(spheres, 2)])
    labels = session.segment([AnnotatedClass("both", (1, 0, 0), points)]).labels
    assert dice(labels > 0, both) > 0.9
    corner = volume.geometry.ijk_to_ras_points(np.array([[1.0, 1.0, 1.0]]))
    assert session.volume.geometry.contains(corner).all()


def test_maps_are_shown_one_by_one_as_they_are_made(session: SegmentationSession, spheres: tuple[Volume, np.ndarray]) -> None:
    shown: list[tuple[str, tuple[int, ...]]] = []
    session.segment(classes_of(spheres), on_map=lambda annotated, full: shown.append((annotated.name, full.similarity.shape)))
    assert shown == [(f"sphere {n}", session.volume.shape) for n in (1, 2, 3)]


def test_a_click_is_answered_at_low_resolution(session: SegmentationSession, spheres: tuple[Volume, np.ndarray]) -> None:
    for low in session.low_resolution_maps(classes_of(spheres)):
        assert low.similarity.shape == session.features.geometry.shape
        assert 0.0 < low.iso < low.similarity.max()


@pytest.mark.parametrize("method", ["kernel", "cosine", "published"])
def test_proximity_fades_a_map_with_distance_whatever_the_method(
    session: SegmentationSession, spheres: tuple[Volume, np.ndarray], method: SimilarityMethod
) -> None:
    chosen = SegmentationSession(
        session.volume, replace(session.preset, similarity=method), session.feature_settings, session.cache
    )
    chosen.load_features(WEIGHTS, torch.device("cpu"))
    (plain,) = chosen.low_resolution_maps(classes_of(spheres)[:1])
    (faded,) = chosen.low_resolution_maps(classes_of(spheres, proximity=1.0)[:1])
    assert faded.similarity.max() > 0.5 * plain.similarity.max()
    far = np.s_[:, :, -3:]
    assert faded.similarity[far].max() <= 0.05 * plain.similarity[far].max() + 1e-6


def test_unusable_classes_are_refused_before_any_work(session: SegmentationSession, spheres: tuple[Volume, np.ndarray]) -> None:
    one, *_ = classes_of(spheres)
    with pytest.raises(InputError, match="2 classes are named"):
        session.segment([one, one])


def test_cancelling_leaves_the_session_usable(session: SegmentationSession, spheres: tuple[Volume, np.ndarray]) -> None:
    def cancel(done: int, total: int, what: str) -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        session.segment(classes_of(spheres), progress=cancel)
    assert session.segment(classes_of(spheres)).labels.any()


def test_the_volume_and_the_points_are_never_altered(session: SegmentationSession, spheres: tuple[Volume, np.ndarray]) -> None:
    array, classes = session.volume.array.copy(), classes_of(spheres)
    points = [annotated.positive.copy() for annotated in classes]
    session.segment(classes)
    np.testing.assert_array_equal(session.volume.array, array)
    for annotated, before in zip(classes, points, strict=True):
        np.testing.assert_array_equal(annotated.positive, before)


def test_features_come_before_maps(spheres: tuple[Volume, np.ndarray]) -> None:
    session = SegmentationSession(spheres[0], PRESETS[DEFAULT_PRESET])
    with pytest.raises(RuntimeError, match="load_features comes first"):
        session.low_resolution_maps(classes_of(spheres))
