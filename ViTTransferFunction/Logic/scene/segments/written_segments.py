"""Notes in a segmentation's node about what was written into it: attributes, which are saved with the scene only.

They distinguish segments of classes that were removed in this scene from segments that came in a file, which have no such note
and belong to somebody else; and segments that are up to date with the classes from those that are not.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Sequence
from typing import Any
from urllib.parse import quote, unquote

import numpy as np
from vtkmodules.vtkCommonMath import vtkMatrix4x4

from ...core.classes.class_request import ClassRequest
from ...core.volumes.geometry import transform_points
from ..classes.class_state import ClassState
from ..classes.of_volume import bring_back, put_away, set_volume_of, volume_of
from ..interface.parameters import REFERENCES, SceneParameters
from ..mrml.nodes import nodes_of_class
from ..mrml.transforms import numpy_matrix
from ..volumes.volume_content import changes_with, frame_of
from .segment_tags import segments_of_classes

CLASSES_ATTRIBUTE = "ViTTransferFunction.writtenClasses"
"""Ids of the classes that were written there, percent-encoded, with spaces between."""
SOURCE_ATTRIBUTE = "ViTTransferFunction.writtenFrom"
"""What the segments were made from when they were last written (`WrittenSegments.source_now`)."""
FRAME_ATTRIBUTE = "ViTTransferFunction.writtenFrame"
"""If the volume is a sequence, the number of the frame that was segmented, from 1."""
DECISIVE = ("preset", "model", "grid", "refinement", "onlyAnnotatedParts", "respectOtherSegments")
"""Parameters that segments depend on, beside the window. Device and weights file differ between computers and do not count."""
DECIMALS = 3
"""Decimals of millimetres and colours that count: files and transforms change further ones, which affect no voxel."""
SAME_PLACE = 1e-5
"""Share of the volume's size by which a corner may deviate, since files round positions (NIfTI to 32 bits)."""


class WrittenSegments:
    """The segments of a session's classes in the chosen segmentation, and the classes as they are now.

    Args:
        parameters: give the chosen segmentation, and the settings that segments depend on.
        classes: returns the session's classes.
        requests: returns their requests.
        voxels: returns a digest of the volume's voxels; "" if it is not known.
    """

    def __init__(
        self,
        parameters: SceneParameters,
        classes: Callable[[], Sequence[ClassState]],
        requests: Callable[[], Sequence[ClassRequest]],
        voxels: Callable[[], str],
    ) -> None:
        self._parameters = parameters
        self._classes = classes
        self._requests = requests
        self._voxels = voxels

    @property
    def exist(self) -> bool:
        """Whether there are segments, including those of classes that are gone."""
        node = self._parameters.segmentation
        return node is not None and bool(self._of({state.id for state in self._classes()} | self._written))

    @property
    def outdated(self) -> bool:
        """Whether the segments differ from the present classes, so that writing again would change them."""
        if self._parameters.volume is None or not self.exist:
            return False
        asked = {request.id for request in self._requests()}
        return bool(asked - self._of(asked).keys() or self.left) or not _are_alike(self.source, self.source_now)

    @property
    def left(self) -> dict[str, str]:
        """IDs of segments, by class, whose class is gone or has no point: the next writing removes those not corrected."""
        gone = self._written - {state.id for state in self._classes() if state.positive}
        return self._of(gone) if gone else {}

    @property
    def source(self) -> str:
        """What the segments were made from (see `source_now`); "" if there are none."""
        return self._parameters.segmentation.GetAttribute(SOURCE_ATTRIBUTE) or "" if self.exist else ""

    @property
    def source_now(self) -> str:
        """A text that identifies what segments would be made from now.

        It consists of `source_digest`, the position of the volume, and the digest of its voxels if that is known.
        """
        digest = source_digest(self._classes(), self._requests(), self._parameters)
        return f"{digest}@{_place(self._parameters.volume)} {self._voxels()}".rstrip()

    def of(self, id_: str) -> str | None:
        """ID of the segment that a class was written to; None if there is none."""
        return self._of({id_}).get(id_) if self._parameters.segmentation else None

    @property
    def _written(self) -> set[str]:
        node = self._parameters.segmentation
        return written_classes(node, self._parameters.volume) if node else set()

    def _of(self, class_ids: Collection[str]) -> dict[str, str]:
        return segments_of_classes(self._parameters.segmentation.GetSegmentation(), class_ids)


def note_written(segmentation_node: Any, class_ids: Collection[str], source: str, volume_node: Any) -> None:
    """Note that classes were written, from which `source`, volume and frame of it."""
    _note_classes(segmentation_node, written_classes(segmentation_node, volume_node) | set(class_ids))
    segmentation_node.SetAttribute(SOURCE_ATTRIBUTE, source)
    set_volume_of(segmentation_node, volume_node)
    frame = frame_of(volume_node)
    segmentation_node.SetAttribute(FRAME_ATTRIBUTE, str(frame.number) if frame else None)


def _note_classes(segmentation_node: Any, class_ids: Collection[str]) -> None:
    text = " ".join(sorted(quote(id_, safe="") for id_ in class_ids))
    segmentation_node.SetAttribute(CLASSES_ATTRIBUTE, text or None)


def written_classes(segmentation_node: Any, volume_node: Any) -> set[str]:
    """Ids of a volume's classes that were written there, except those whose segments are finished (`finish_segments`).

    If the segmentation is of another volume, there are none.
    """
    if volume_node is not None and volume_of(segmentation_node) is not volume_node:
        return set()
    return {unquote(id_) for id_ in (segmentation_node.GetAttribute(CLASSES_ATTRIBUTE) or "").split()}


def finish_segments(segmentation_node: Any, present: Collection[str]) -> None:
    """Finish the segments of classes that are not `present` any more: later writing leaves them as they are."""
    _note_classes(segmentation_node, written_classes(segmentation_node, volume_of(segmentation_node)) & set(present))


def finish_segments_elsewhere(volume_node: Any, class_ids: Collection[str]) -> None:
    """Finish what was written for these classes in segmentations of other volumes: they belong to this volume now."""
    for node in nodes_of_class(volume_node.GetScene(), REFERENCES["segmentation"]):
        if volume_of(node) is not volume_node:
            finish_segments(node, written_classes(node, volume_of(node)) - set(class_ids))


def choose_segmentation_of(volume_node: Any, parameters: SceneParameters) -> bool:
    """Choose the segmentation for a volume, or a frame of it, that has just been chosen (`segmentation_for`).

    The segmentation is shown, and the former one, which belongs to another image, is hidden.

    Returns:
        Whether another segmentation was chosen that has segments already.
    """
    before = parameters.segmentation
    node = segmentation_for(volume_node, before)
    if node is before:
        return False
    parameters.set_reference("segmentation", node)
    if before is not None:
        put_away(before)
    if node is not None:
        bring_back(node)
    return node is not None


def segmentation_for(volume_node: Any, chosen: Any) -> Any:
    """The segmentation for the segments of a volume, or a frame of it, that has just been chosen; None: a new one.

    The segments of one scan must not be overwritten by those of the next. If the chosen segmentation has segments of another
    scan, the latest one with segments of this volume is returned, or None. If it has none of ours, it stays the chosen one.

    Frames of a sequence count as different scans, unless the segmentation is a sequence that changes with them.
    """
    if chosen is not None and (not _was_written(chosen) or _is_of(chosen, volume_node)):
        return chosen
    known = nodes_of_class(volume_node.GetScene(), REFERENCES["segmentation"])
    return next((node for node in reversed(known) if _was_written(node) and _is_of(node, volume_node)), None)


def _was_written(segmentation_node: Any) -> bool:
    return segmentation_node.GetAttribute(SOURCE_ATTRIBUTE) is not None


def _is_of(segmentation_node: Any, volume_node: Any) -> bool:
    if volume_of(segmentation_node) is not volume_node:
        return False
    frame = frame_of(volume_node)
    noted = segmentation_node.GetAttribute(FRAME_ATTRIBUTE)
    return frame is None or noted == str(frame.number) or changes_with(segmentation_node, volume_node)


def source_digest(states: Sequence[ClassState], requests: Sequence[ClassRequest], parameters: SceneParameters) -> str:
    """A digest of all that segments depend on, and of their names and colours: it changes if writing again would change them.

    Of the volume, only the node's ID is part of it, not the voxels and their position.

    Args:
        states: the classes.
        requests: their requests.
        parameters: give the volume and the settings.
    """
    looks = {state.id: (state.name, _rounded(state.color)) for state in states}
    # While a scene is closed, requests may be of classes that are gone already.
    of_classes = sorted((request.id, looks.get(request.id), *_values(request)) for request in requests)
    window = () if parameters.get("windowAutomatic") else parameters.window
    settings = [parameters.get(name) for name in DECISIVE]
    volume = parameters.volume.GetID() if parameters.volume else ""
    return hashlib.sha256(repr((of_classes, window, settings, volume)).encode()).hexdigest()


def _are_alike(source: str, other: str) -> bool:
    """Whether both sources give the same segments. Voxels and positions that are not known (yet) are taken to be equal."""
    (made_from, _, voxels), (other_made_from, _, other_voxels) = source.partition(" "), other.partition(" ")
    (classes, _, place), (other_classes, _, other_place) = made_from.partition("@"), other_made_from.partition("@")
    alike = classes == other_classes and (not voxels or not other_voxels or voxels == other_voxels)
    return alike and (not place or not other_place or _is_same_place(place, other_place))


def _place(volume_node: Any) -> str:
    """Position of a volume's voxels in its local frame: four corners, RAS millimetres, as a text without spaces."""
    image = volume_node.GetImageData() if volume_node is not None else None
    if image is None:
        return ""
    matrix = vtkMatrix4x4()
    volume_node.GetIJKToRASMatrix(matrix)
    corners_ijk = np.vstack([np.zeros(3), np.diag(image.GetDimensions())])
    return ",".join(f"{number:.9g}" for number in transform_points(numpy_matrix(matrix), corners_ijk).ravel())


def _is_same_place(place: str, other: str) -> bool:
    corners, other_corners = (np.array(text.split(","), dtype=np.float64).reshape(4, 3) for text in (place, other))
    size_mm = float(np.linalg.norm(np.ptp(corners, axis=0)))
    return bool(np.abs(corners - other_corners).max() <= SAME_PLACE * size_mm)


def _values(request: ClassRequest) -> tuple[Any, ...]:
    box = request.close_up
    close_up = () if box is None else (_rounded(box.centre_ras), _rounded(box.size_mm))
    points = _rounded(request.positive), _rounded(request.negative)
    return (*points, repr(request.iso), request.size, request.proximity, request.refine, close_up)


def _rounded(numbers: Any) -> bytes:
    # The sum turns minus zero into zero.
    rounded: np.ndarray = np.round(np.asarray(numbers, dtype=np.float64), DECIMALS) + 0.0
    return rounded.tobytes()
