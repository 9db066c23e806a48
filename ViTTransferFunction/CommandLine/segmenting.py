"""From an opened volume and its annotated classes to a segmentation file and a report on it.

`vittf segment` does this once, `vittf cohort` for many volumes.
"""

from __future__ import annotations

import logging
import platform
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ViTTransferFunction.CommandLine.close_ups import check_close_ups, requests_with_close_ups
from ViTTransferFunction.CommandLine.package_versions import THIS_PROGRAM, package_version
from ViTTransferFunction.Logic.core.classes.annotated_class import AnnotatedClass, scan_of
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest, check_requests
from ViTTransferFunction.Logic.core.system.progress import Progress, no_progress
from ViTTransferFunction.Logic.core.system.stopwatch import peak_memory_bytes
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.measures import decimals_of
from ViTTransferFunction.Logic.core.volumes.missing_intensity import without_intensity, without_intensity_text
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files.segmentation_files import Segment, write_segmentation
from ViTTransferFunction.Logic.refinement.refinement import RefinementMethod
from ViTTransferFunction.Logic.session.refined_map import RefinedMap
from ViTTransferFunction.Logic.session.segmentation import ClassResult, Segmentation
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession

logger = logging.getLogger(__name__)


def segment_classes(
    session: SegmentationSession,
    classes: Sequence[AnnotatedClass],
    method: RefinementMethod,
    only_annotated_components: bool,
    progress: Progress = no_progress,
    on_features: Callable[[SegmentationSession], None] = lambda _: None,
    on_map: Callable[[ClassRequest, RefinedMap], None] | None = None,
    on_warning: Callable[[str], None] = logger.warning,
) -> Segmentation:
    """Load the features of an opened volume and of its close-ups, and segment it.

    Args:
        session: whose features are still to be loaded.
        classes: at least one, of different names, all points inside the volume.
        method: how maps are refined.
        only_annotated_components: drop the parts of a segment that hold none of its positive points.
        progress: called with what is done of each step.
        on_features: is called when the features are there.
        on_map: is shown each class's full-resolution map.
        on_warning: is told what was done otherwise than asked for, of points that contradict each other, stand where there is
            nothing or were placed on another scan, and which classes have no voxel.

    Raises:
        InputError: the annotations are not usable, or the weights are not to be had.
    """
    # Before the features, which may take minutes.
    check_requests([annotated.request for annotated in classes], session.volume.geometry)
    check_close_ups(classes, session.volume.geometry)
    for annotated in classes:
        _warn_of_contradictions(annotated.request, on_warning)
        _warn_of_nothing_there(annotated.request, session.volume, on_warning)
    _warn_of_other_scan(classes, session.volume, on_warning)
    session.load_features(progress)
    on_features(session)
    requests = requests_with_close_ups(session, classes, method, only_annotated_components, on_warning)
    session.look_closer(requests, progress)
    segmentation = session.segment(requests, method, only_annotated_components, progress, on_map)
    for request, result in zip(requests, segmentation.classes, strict=True):
        if not result.voxels:
            on_warning(_why_empty(request, result, session.volume.geometry, segmentation))
    return segmentation


def _warn_of_contradictions(request: ClassRequest, on_warning: Callable[[str], None]) -> None:
    """A list that was given for both polarities, say, would be segmented by as if that were meant."""
    both = set(map(tuple, request.positive.tolist())) & set(map(tuple, request.negative.tolist()))
    if both:
        on_warning(
            f"Class '{request.name}': of {len(request.positive)} positive points, {len(both)} stand among the negative ones as "
            "well. Remove each from one of the two."
        )


def _warn_of_nothing_there(request: ClassRequest, volume: Volume, on_warning: Callable[[str], None]) -> None:
    count = without_intensity(volume.array, volume.geometry, request.positive)
    if count:
        on_warning(f"Class '{request.name}': {without_intensity_text(count)}")


def _warn_of_other_scan(classes: Sequence[AnnotatedClass], volume: Volume, on_warning: Callable[[str], None]) -> None:
    placed_on = scan_of(classes)
    if placed_on is not None and not placed_on.may_be_of(volume.array, volume.geometry):
        on_warning(
            f"The points were placed on a scan that looks different from '{volume.name}', perhaps another patient's. Check "
            "whether they belong to it."
        )


def _why_empty(request: ClassRequest, result: ClassResult, geometry: Geometry, segmentation: Segmentation) -> str:
    """What to tell the user of a class without a voxel."""
    if not result.reaches_iso:
        advice = "Give it a larger 'size'" if request.iso is None else "Lower its 'iso'"
        return (
            f"Class '{request.name}' has no voxel: nothing is as similar to its points as its threshold, iso {result.iso:.2f}, "
            f"asks for. {advice}, or place more points on it."
        )
    k, j, i = geometry.nearest_voxels(request.positive).T
    there = [segmentation.classes[label - 1].name for label in np.unique(segmentation.labels[k, j, i]) if label]
    where = f"; its points lie in {' and '.join(repr(name) for name in there)}" if there else ""
    return (
        f"Class '{request.name}' has no voxel: whatever is similar to its points is more similar to another class{where}. "
        "Check that each point is on its own structure, and place more points on this one."
    )


def write_classes(
    path: Path, session: SegmentationSession, classes: Sequence[AnnotatedClass], segmentation: Segmentation
) -> None:
    """Write a segmentation with its classes' names and colours. Raises InputError where the file cannot be written."""
    segments = [Segment(annotated.name, annotated.color) for annotated in classes]
    with session.watch.step("write"):
        write_segmentation(path, segmentation.labels, session.volume.geometry, segments)


def segmentation_report(
    session: SegmentationSession, segmentation: Segmentation, preset: str, method: RefinementMethod
) -> dict[str, Any]:
    """Versions, settings, timings and volumes, in what JSON has."""
    import torch

    weights = session.provenance.weights
    packages = ("torch", "numpy", "scipy", "SimpleITK", THIS_PROGRAM)
    return {
        "versions": {"python": platform.python_version(), **{name: package_version(name) for name in packages}},
        "volume": {"name": session.volume.name, "size": session.volume.shape[::-1]},
        "model": {"name": weights.model.name, "sha256": weights.sha256, "licence": weights.model.licence},
        "preset": preset,
        "refinement": method,
        "grid": session.features.array.shape[2::-1],
        "device": session.provenance.device,
        "precision": session.provenance.precision,
        "threads": torch.get_num_threads(),
        "seconds": {step: round(seconds, 3) for step, seconds in session.watch.seconds.items()},
        "peak_memory_bytes": peak_memory_bytes(),
        "classes": [
            {
                "name": c.name,
                "label": label,
                "iso": round(c.iso, 4),
                "voxels": c.voxels,
                "millilitres": round(c.millilitres, decimals_of(c.millilitres, 4, 3)),
            }
            for label, c in enumerate(segmentation.classes, start=1)
        ],
    }
