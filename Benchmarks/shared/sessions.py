"""Segmentation sessions as users have them, on labelled volumes and simulated clicks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from Benchmarks.shared.labelled_cases import LabelledVolume, classes_of
from Benchmarks.shared.simulated_clicker import Click
from ViTTransferFunction.CommandLine.progress_bar import ProgressBar
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.features.feature_volume import FeatureVolume
from ViTTransferFunction.Logic.refinement.refinement import RefinementMethod
from ViTTransferFunction.Logic.session.opening import open_session
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, PRESETS, Preset
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Logic.weights.sources import WeightsFile


def load_features(volume: Volume, weights: WeightsFile, preset: str = DEFAULT_PRESET) -> FeatureVolume:
    """The features of a preset, from the cache if they are there."""
    settings = SessionSettings(model=weights.model.name, weights_path=str(weights.path), preset=preset)
    session = open_session(volume, settings)
    with ProgressBar() as progress:
        session.load_features(progress)
    return session.features.source


def session_on(volume: Volume, features: FeatureVolume, preset: Preset | None = None) -> SegmentationSession:
    """A session on a volume whose features are at hand; of the default preset if not given."""
    session = SegmentationSession(volume, preset or PRESETS[DEFAULT_PRESET])
    session.use_features(features)
    return session


def labels_of(
    session: SegmentationSession,
    labelled: LabelledVolume,
    clicks: Sequence[Sequence[Click]],
    refinement: RefinementMethod = "bilateral",
    with_negatives: bool = True,
) -> np.ndarray:
    """Labels (K, J, I) that the session makes of the clicks of each structure; without negatives, those are left out.

    Args:
        session: on the labelled volume, with features.
        labelled: the volume, for the structures' names.
        clicks: of each structure, at least one positive.
        refinement: how maps are refined.
        with_negatives: whether the session is told of negative clicks.
    """
    classes = classes_of(labelled.names, clicks, labelled.volume.geometry, with_negatives)
    return session.segment(classes, refinement).labels
