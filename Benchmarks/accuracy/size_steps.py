"""What a user reaches who may also say "smaller" or "larger", once for each structure, where that makes it better.

The user sees the proposals and takes the best one. Each structure is judged with the others as chosen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from Benchmarks.accuracy.runs import Rounds, rounded_metrics
from Benchmarks.shared.click_sequence import ClickSequence
from Benchmarks.shared.labelled_cases import LabelledVolume, classes_of
from Benchmarks.shared.segmentation_metrics import dice
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.volumes.bounding_box import whole_box
from ViTTransferFunction.Logic.session.labels import Competition, keep_annotated_components
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession

STEPS = (-1.0, 1.0)
"""`ClassRequest.size` of the smaller and the larger proposal."""

Map = tuple[np.ndarray, float]
"""A full-resolution map (K, J, I) and its iso value."""


def run_size_steps(
    labelled: LabelledVolume, session: SegmentationSession, clicks: ClickSequence, rounds: Sequence[int]
) -> Rounds:
    """Metrics after the clicks of some rounds and at most one step a structure; `step` says which was taken."""
    return {str(number): _best_steps(labelled, session, clicks, number) for number in rounds}


def _best_steps(
    labelled: LabelledVolume, session: SegmentationSession, clicks: ClickSequence, number: int
) -> dict[str, dict[str, float]]:
    requests = classes_of(labelled.names, clicks.at(number), labelled.volume.geometry)
    maps: list[Map] = []
    labels = session.segment(requests, on_map=lambda _, full: maps.append((full.voxels.array, full.iso))).labels
    measured = {}
    for index, name in enumerate(labelled.names):
        truth = labelled.truth == index + 1
        proposals = {0.0: labels == index + 1}
        proposals |= {step: _proposal(session, requests, index, step, maps) for step in STEPS}
        # Of equals the one that needs no step.
        best = max(proposals, key=lambda step: (dice(proposals[step], truth), step == 0.0))
        measured[name] = rounded_metrics(proposals[best], truth, labelled, step=best)
    return measured


def _proposal(
    session: SegmentationSession, requests: Sequence[ClassRequest], index: int, step: float, maps: Sequence[Map]
) -> np.ndarray:
    """(K, J, I) bool: the segment of the index-th class after a step, the other classes' maps being as they are."""
    stepped = [replace(request, size=step) if n == index else request for n, request in enumerate(requests)]
    low = session.low_resolution_maps(stepped)[index]
    full = session.refined_map(low, stepped, index, "bilateral")
    geometry = session.volume.geometry
    competition = Competition(geometry.shape, np.uint16)
    for similarity, iso in (*maps[:index], (full.voxels.array, full.iso), *maps[index + 1 :]):
        competition.enter(similarity, iso, whole_box(geometry.shape))
    keep_annotated_components(competition.labels, geometry, {index + 1: requests[index].positive})
    labels: np.ndarray = competition.labels
    return labels == index + 1
