"""The methods that ours is compared with, on three spheres in noise."""

from __future__ import annotations

import numpy as np
import pytest

from Benchmarks.accuracy.baseline_grow_from_seeds import GrowFromSeeds
from Benchmarks.accuracy.baseline_threshold import ClickedThreshold
from Benchmarks.accuracy.local_features import COUNT, LocalFeatures
from Benchmarks.accuracy.seeds import BACKGROUND_VOXELS, Seeds, painted, random_seeds, random_voxels, seeds_of
from Benchmarks.shared.simulated_clicker import Click
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.features.whitening import normalised_features
from ViTTransferFunction.Testing.support.masks import dice
from ViTTransferFunction.Testing.support.spheres import Spheres
from ViTTransferFunction.Testing.support.volumes import volume_of

CENTRES = ((16, 20, 12), (16, 20, 36), (8, 10, 24))


def clicks_on_the_centres() -> list[list[Click]]:
    return [[Click(centre, positive=True)] for centre in CENTRES]


def test_a_negative_click_says_what_is_there(spheres: Spheres) -> None:
    _, truth = spheres
    clicks = clicks_on_the_centres()
    clicks[0] += [Click(CENTRES[2], positive=False), Click((0, 0, 0), positive=False)]
    seeds = seeds_of(clicks, truth)
    assert seeds.labels[seeds.is_click].tolist() == [1, 3, 0, 2, 3]
    assert np.count_nonzero(~seeds.is_click) == BACKGROUND_VOXELS


def test_background_is_drawn_from_where_it_is_or_from_anywhere() -> None:
    truth = np.zeros((10, 10, 10), dtype=np.uint8)
    truth[:, :, :5] = 1
    clicks = [[Click((5, 5, 2), positive=True)]]
    informed, blind = (seeds_of(clicks, truth, true_background) for true_background in (True, False))
    assert not truth[tuple(informed.of_class(0).T)].any()
    assert truth[tuple(blind.of_class(0).T)].any()


def test_true_samples_are_as_many_of_every_class_as_there_are(spheres: Spheres) -> None:
    _, truth = spheres
    seeds = random_seeds(truth, 10_000)
    inside = np.bincount(truth.ravel())
    assert np.bincount(seeds.labels).tolist() == [min(10_000, count) for count in inside]
    assert (truth[tuple(seeds.kji.T)] == seeds.labels).all()


def test_random_voxels_differ_and_are_the_same_each_time() -> None:
    mask = np.zeros((5, 6, 7), dtype=bool)
    mask[1:4] = True
    voxels = random_voxels(mask, 50)
    assert mask[tuple(voxels.T)].all()
    assert len(np.unique(voxels, axis=0)) == 50
    np.testing.assert_array_equal(voxels, random_voxels(mask, 50))


def test_local_features_are_the_intensity_its_neighbours_the_gradient_and_the_place() -> None:
    # A step along I: features are standardised, so only their order is known.
    array = np.zeros((6, 7, 8), dtype=np.float32)
    array[..., 4:] = 100.0
    volume = volume_of(array)
    features = LocalFeatures(volume).of(np.arange(array.size)).reshape(*array.shape, COUNT)
    np.testing.assert_allclose(features.mean(axis=(0, 1, 2)), 0.0, atol=1e-5)
    dark, bright = features[2, 3, 3], features[2, 3, 4]
    assert bright[0] > dark[0]
    # The bright voxel lies one further along I, so its neighbour before is the dark one; across I they are equal.
    assert bright[5] < features[2, 3, 5, 5]
    assert dark[6] > features[2, 3, 2, 6]
    assert dark[7] == bright[7] > features[2, 3, 0, 7]
    assert (np.diff(features[2, 3, :, 10]) > 0.0).all()
    assert (np.diff(features[:, 3, 4, 8]) > 0.0).all()


def test_thresholds_take_what_is_as_bright_as_the_clicked_place(spheres: Spheres) -> None:
    volume, truth = spheres
    labels = ClickedThreshold(volume)(seeds_of(clicks_on_the_centres(), truth))
    # Two spheres are equally bright; a range of two standard deviations leaves out one voxel in twenty.
    assert dice((labels == 1) | (labels == 2), (truth == 1) | (truth == 2)) > 0.9
    assert dice(labels == 3, truth == 3) > 0.9


def test_a_click_paints_a_ball_in_millimetres_and_over_no_edge() -> None:
    truth = np.zeros((11, 11, 11), dtype=np.uint8)
    truth[:, :, 4:] = 2
    seeds = Seeds(np.array([(5, 5, 5), (0, 0, 0)]), np.array([2, 0]), np.array([True, False]))
    brushed = painted(seeds, truth, (2.0, 1.0, 1.0), 2.0)
    voxels = {tuple(kji) for kji in brushed.kji[brushed.is_click].tolist()}
    # Two voxels along I and J, one along K, but for the one that lies in the background.
    assert {(5, 5, 5), (5, 5, 4), (5, 5, 7), (5, 3, 5), (4, 5, 5), (6, 5, 5)} <= voxels
    assert not {(5, 5, 3), (7, 5, 5), (5, 5, 8)} & voxels
    assert set(brushed.labels[brushed.is_click]) == {2}
    assert brushed.kji[~brushed.is_click].tolist() == [[0, 0, 0]]


def test_seeds_grow_up_to_the_edges(spheres: Spheres) -> None:
    pytest.importorskip("slicer")
    volume, truth = spheres
    labels = GrowFromSeeds(volume)(seeds_of(clicks_on_the_centres(), truth))
    for label in (1, 2, 3):
        assert dice(labels == label, truth == label) > 0.9


@pytest.mark.parametrize("kind", ["SVM", "RF"])
def test_classifiers_of_local_features_learn_from_many_samples(spheres: Spheres, kind: str) -> None:
    pytest.importorskip("sklearn")
    from Benchmarks.accuracy.baseline_classifiers import LocalClassifier

    volume, truth = spheres
    labels = LocalClassifier(volume, kind)(random_seeds(truth, 200))  # type: ignore[arg-type]
    for label in (1, 2, 3):
        assert dice(labels == label, truth == label) > 0.85


@pytest.mark.parametrize("kind", ["SVM", "RF"])
def test_classifiers_of_network_features_learn_from_a_few_clicks(spheres: Spheres, kind: str) -> None:
    pytest.importorskip("sklearn")
    from Benchmarks.accuracy.baseline_classifiers import FeatureClassifier

    volume, truth = spheres
    one_hot = np.stack([truth == label for label in range(4)], axis=-1).astype(np.float32)
    cells = one_hot.reshape(16, 2, 20, 2, 24, 2, 4).mean(axis=(1, 3, 5))
    features = FeatureVolume(cells, volume.geometry.resized((16, 20, 24)), "known")
    labels = FeatureClassifier(volume, normalised_features(features, "none"), kind)(  # type: ignore[arg-type]
        seeds_of(clicks_on_the_centres(), truth)
    )
    for label in (1, 2, 3):
        assert dice(labels == label, truth == label) > 0.85


def test_scores_of_classes_that_a_classifier_never_saw_are_the_least() -> None:
    pytest.importorskip("sklearn")
    from Benchmarks.accuracy.baseline_classifiers import class_scores, trained

    features = np.array([[0.0], [0.1], [1.0], [1.1]])
    for kind in ("SVM", "RF"):
        classifier = trained(kind, features, np.array([0, 0, 2, 2]))
        scores = class_scores(classifier, [features[:1], features[1:]], 4)
        assert scores.argmax(axis=1).tolist() == [0, 0, 2, 2]
        assert (scores[:, 1] <= scores[:, [0, 2]].min(axis=1)).all()


def test_fast_scores_of_a_support_vector_machine_are_those_of_scikit_learn() -> None:
    svm = pytest.importorskip("sklearn.svm")
    from Benchmarks.accuracy.svm_scores import svm_scores

    rng = np.random.default_rng(0)
    features = rng.normal(size=(200, 5))
    labels = (features[:, 0] > 0.0).astype(int) + 2 * (features[:, 1] + 0.3 * rng.normal(size=200) > 0.5)
    machine = svm.SVC(class_weight="balanced").fit(features, labels)
    others = rng.normal(size=(5000, 5))
    np.testing.assert_allclose(svm_scores(machine, others), machine.decision_function(others), atol=1e-3)
