"""What was written into a segmentation, as its node notes it: by attributes, which are saved with the scene alone.

By these, segments whose classes were removed in this scene are told from finished ones that came in a file of segments, which
have no such note and are somebody else's; and segments that are as the structures are now from those that are not any more.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Sequence
from typing import Any
from urllib.parse import quote, unquote

import numpy as np

from ..core.class_request import ClassRequest
from .classes import ClassState
from .parameters import SceneParameters
from .segment_tags import segments_of_classes

CLASSES_ATTRIBUTE = "ViTTransferFunction.writtenClasses"
"""Ids of all classes that were ever written there, percent-encoded, with spaces between."""
SOURCE_ATTRIBUTE = "ViTTransferFunction.writtenFrom"
"""What the segments were made from when they were written last (`source_digest`)."""
DECISIVE = ("preset", "model", "grid", "refinement", "onlyAnnotatedParts", "respectOtherSegments")
"""Parameters that segments follow from. Device and file of weights are those of a computer; `window` says its own."""
DECIMALS = 3
"""Of millimetres and colours: a file and a transform there and back change the digits behind, and no voxel."""


def note_written(segmentation_node: Any, class_ids: Collection[str], source: str) -> None:
    """Note that classes were written, made from `source`."""
    ids = written_classes(segmentation_node) | set(class_ids)
    segmentation_node.SetAttribute(CLASSES_ATTRIBUTE, " ".join(sorted(quote(id_, safe="") for id_ in ids)))
    segmentation_node.SetAttribute(SOURCE_ATTRIBUTE, source)


def written_classes(segmentation_node: Any) -> set[str]:
    """Ids of all classes that were ever written there."""
    return {unquote(id_) for id_ in (segmentation_node.GetAttribute(CLASSES_ATTRIBUTE) or "").split()}


def written_source(segmentation_node: Any) -> str:
    """What its segments were made from when they were written last; empty: nobody noted it."""
    return segmentation_node.GetAttribute(SOURCE_ATTRIBUTE) or ""


def left_segments(segmentation_node: Any, present: Collection[str]) -> dict[str, str]:
    """IDs of the segments that were written for classes which are not `present` any more, by class."""
    return segments_of_classes(segmentation_node.GetSegmentation(), written_classes(segmentation_node) - set(present))


def source_digest(states: Sequence[ClassState], requests: Sequence[ClassRequest], parameters: SceneParameters) -> str:
    """Of all that segments follow from, with their names and colours: the same as long as writing again would change nothing.

    The voxels of the volume are not in it, only which volume it is.

    Args:
        states: the classes.
        requests: what is asked for of them.
        parameters: say which volume, and how.
    """
    looks = {state.id: (state.name, _rounded(state.color)) for state in states}
    # While a scene is closed, requests may be of classes that are gone already.
    of_classes = sorted((request.id, looks.get(request.id), *_values(request)) for request in requests)
    window = () if parameters.get("windowAutomatic") else parameters.window
    settings = [parameters.get(name) for name in DECISIVE]
    volume = parameters.volume.GetID() if parameters.volume else ""
    return hashlib.sha256(repr((of_classes, window, settings, volume)).encode()).hexdigest()


def _values(request: ClassRequest) -> tuple[Any, ...]:
    box = request.close_up
    close_up = () if box is None else (_rounded(box.centre_ras), _rounded(box.size_mm))
    points = _rounded(request.positive), _rounded(request.negative)
    return (*points, repr(request.iso), request.size, request.proximity, request.refine, close_up)


def _rounded(numbers: Any) -> bytes:
    # The sum makes zero of minus zero.
    rounded: np.ndarray = np.round(np.asarray(numbers, dtype=np.float64), DECIMALS) + 0.0
    return rounded.tobytes()
