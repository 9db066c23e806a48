"""How far features are from others of the same volume, and what they are worth in clicks."""

from __future__ import annotations

from functools import partial

import numpy as np

from Benchmarks.shared.aim import persons_aims
from Benchmarks.shared.labelled_cases import LabelledVolume
from Benchmarks.shared.segmentation_metrics import mean_dice
from Benchmarks.shared.sessions import labels_of, session_on
from Benchmarks.shared.simulated_clicker import click_in_rounds
from ViTTransferFunction.Logic.core.volumes.orientation import canonical_orientation
from ViTTransferFunction.Logic.core.volumes.resampling import sample_at
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.background_tokens import background_cells
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.features.settings import FeatureSettings
from ViTTransferFunction.Logic.features.whitening import Statistics, normalised_features, unit_vectors

CLICKS = (1, 3, 5, 10)


def cosine_errors(features: FeatureVolume, reference: FeatureVolume, volume: Volume) -> dict[str, float]:
    """Mean 1 − cosine to the reference's features, after centring and after whitening by the reference's statistics.

    Features of another grid are interpolated at the reference's cells. Cells of air do not count: there is nothing to find.
    """
    body = ~_background(volume, reference)
    centres = reference.geometry.voxel_centres_ras()[body.ravel()]
    vectors = sample_at(features.array, features.geometry, centres)
    return {statistics: _mean_error(vectors, reference, statistics, body) for statistics in ("centred", "whitened")}


def _mean_error(vectors: np.ndarray, reference: FeatureVolume, statistics: Statistics, body: np.ndarray) -> float:
    normalised = normalised_features(reference, statistics)
    errors = 1.0 - np.sum(unit_vectors(normalised.transform.apply(vectors)) * normalised.array[body], axis=1)
    return float(errors.mean())


def _background(volume: Volume, features: FeatureVolume) -> np.ndarray:
    orientation = canonical_orientation(volume.geometry)
    shape = orientation.canonical_shape(features.geometry.shape)
    background = np.empty(features.geometry.shape, dtype=bool)
    window = FeatureSettings().channels_for(volume).background
    orientation.to_canonical(background)[...] = background_cells(orientation.to_canonical(volume.array), window, shape)
    return background


def dice_by_clicks(features: FeatureVolume, labelled: LabelledVolume, path: int) -> dict[str, float]:
    """Mean Dice of the structures after each of `CLICKS`, on one path, with everything but the features as in the default."""
    session = session_on(labelled.volume, features)
    segment, aims = partial(labels_of, session, labelled), persons_aims(path, len(labelled.names))
    states = click_in_rounds(labelled.truth, labelled.spacing_mm, segment, max(CLICKS), aims=aims)
    return {
        str(state.number): mean_dice(state.labels, labelled.truth, len(labelled.names))
        for state in states
        if state.number in CLICKS
    }
