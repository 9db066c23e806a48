"""How far features are from others of the same volume, and what they are worth in clicks."""

from __future__ import annotations

import numpy as np

from Benchmarks.shared.labelled_cases import Case, classes_of
from Benchmarks.shared.segmentation_metrics import segmentation_metrics
from Benchmarks.shared.simulated_clicker import MOST_CLICKS, Clicks, click_in_rounds
from ViTTransferFunction.Logic.core.orientation import upright_orientation
from ViTTransferFunction.Logic.core.volume import Volume
from ViTTransferFunction.Logic.features.background_tokens import air_cells
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume, sample_at
from ViTTransferFunction.Logic.features.settings import FeatureSettings
from ViTTransferFunction.Logic.features.whitening import Statistics, comparable_features, unit_vectors
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession


def cosine_errors(features: FeatureVolume, reference: FeatureVolume, volume: Volume) -> dict[str, float]:
    """Mean 1 − cosine to the reference's features, after centring and after whitening by the reference's statistics.

    Features of another grid are interpolated at the reference's cells. Cells of air do not count: there is nothing to find.
    """
    body = ~_air(volume, reference)
    centres = reference.geometry.voxel_centres_ras()[body.ravel()]
    vectors = sample_at(features.array, features.geometry, centres)
    return {statistics: _mean_error(vectors, reference, statistics, body) for statistics in ("centred", "whitened")}


def _mean_error(vectors: np.ndarray, reference: FeatureVolume, statistics: Statistics, body: np.ndarray) -> float:
    comparable = comparable_features(reference, statistics)
    errors = 1.0 - np.sum(unit_vectors(comparable.transform.apply(vectors)) * comparable.array[body], axis=1)
    return float(errors.mean())


def _air(volume: Volume, features: FeatureVolume) -> np.ndarray:
    orientation = upright_orientation(volume.geometry)
    shape = orientation.upright_shape(features.geometry.shape)
    air = air_cells(orientation.upright(volume.array), FeatureSettings().windows_for(volume), shape)
    return orientation.restored(air[..., None])[..., 0]


def dice_by_clicks(features: FeatureVolume, volume: Volume, truth: np.ndarray, case: Case) -> dict[str, float]:
    """Mean Dice of the case's structures after each number of clicks, with everything but the features as in the default."""
    session = SegmentationSession(volume, PRESETS[DEFAULT_PRESET])
    session.use_features(features)
    names, spacing_mm = list(case.structures), volume.geometry.spacing_mm[::-1].tolist()

    def segment(clicks: Clicks) -> np.ndarray:
        return session.segment(classes_of(names, clicks, volume.geometry)).labels

    return {
        str(state.number): float(
            np.mean(
                [
                    segmentation_metrics(state.labels == label, truth == label, spacing_mm).dice
                    for label in range(1, len(names) + 1)
                ]
            )
        )
        for state in click_in_rounds(truth, spacing_mm, segment, MOST_CLICKS)
    }
