"""The close-ups of annotated classes: boxes that a file names, and boxes chosen from the classes' maps.

Such a box is asked for by a file, or comes unasked, as in panel and app: for what is small, and unlike its outline.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ViTTransferFunction.Logic.core.classes.annotated_class import AnnotatedClass
from ViTTransferFunction.Logic.core.classes.class_map import ClassMap
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.core.classes.close_up_choice import close_up_of
from ViTTransferFunction.Logic.core.classes.region_points import points_of_outline
from ViTTransferFunction.Logic.core.classes.small_outlines import is_small, unasked_close_up
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.measures import two_figures
from ViTTransferFunction.Logic.refinement.refinement import RefinementMethod
from ViTTransferFunction.Logic.session.map_crop import SegmentCrops
from ViTTransferFunction.Logic.session.segmentation_session import SegmentationSession


def check_close_ups(classes: Sequence[AnnotatedClass], geometry: Geometry) -> None:
    """Raise InputError where a box that a file names holds none of its class's positive points, and so is a mistake.

    It would be enlarged to hold them, and show neither.
    """
    for request in (annotated.request for annotated in classes):
        if request.close_up is None:
            continue
        offsets = geometry.ras_to_ijk(request.positive) - geometry.ras_to_ijk(np.array([request.close_up.centre_ras]))
        beyond = np.abs(offsets) * geometry.spacing_mm > np.array(request.close_up.size_mm) / 2.0
        if beyond.any(axis=1).all():
            centre = ", ".join(f"{x:.1f}" for x in request.close_up.centre_ras)
            raise InputError(
                f"The close-up of class '{request.name}' holds none of the class's {len(request.positive)} positive points: "
                f"its centre is RAS ({centre}) mm. Check its 'center', its 'size_mm', and the coordinate system; or give "
                'true for "close_up", and the box is chosen from the points.'
            )


def requests_with_close_ups(
    session: SegmentationSession,
    classes: Sequence[AnnotatedClass],
    method: RefinementMethod,
    only_annotated_components: bool,
    on_warning: Callable[[str], None],
) -> list[ClassRequest]:
    """The requests of annotated classes, with the close-ups that were still to be chosen.

    Args:
        session: with its features loaded.
        classes: whose points lie inside the volume.
        method: how the maps that outlines are compared with are refined; "none": they are not compared.
        only_annotated_components: as `segment_classes` is told.
        on_warning: is told of each class that has to be looked at in the whole volume, since its box would be too large, and of
            each that is looked at closely unasked.
    """
    requests = [annotated.request for annotated in classes]
    if any(annotated.close_up_from_map for annotated in classes):
        # Of the whole volume: where a structure lies is what is to be found out.
        maps = session.low_resolution_maps(_in_whole(requests))
        requests = [
            _with_close_up(annotated.request, similarity, session.volume.geometry, on_warning)
            if annotated.close_up_from_map
            else annotated.request
            for annotated, similarity in zip(classes, maps, strict=True)
        ]
    outlines = [annotated.outline_ras for annotated in classes]
    small = [outline is not None and _is_small(outline, session) for outline in outlines]
    if method == "none" or not any(small):
        return requests
    crops = SegmentCrops()
    labels = session.segment(_in_whole(requests), method, only_annotated_components, on_map=crops.take).labels
    shown = [crop.on(session.volume.geometry) for crop in crops.of(labels)]
    return [
        request if outline is None else _with_unasked_close_up(session, request, similarity, outline, on_warning)
        for request, similarity, outline in zip(requests, shown, outlines, strict=True)
    ]


def _with_unasked_close_up(
    session: SegmentationSession,
    request: ClassRequest,
    shown: ClassMap,
    outline_ras: np.ndarray,
    on_warning: Callable[[str], None],
) -> ClassRequest:
    """The request with a close-up, where it is small and unlike its outline in the whole, and its box is not too large."""
    if request.close_up is not None:
        return request
    close_up = unasked_close_up(shown, outline_ras, request.positive, session.volume.geometry, _cell_mm(session))
    if close_up is None:
        return request
    box = " × ".join(two_figures(edge) for edge in close_up.size_mm)
    on_warning(f"{request.name}: small, and in the whole scan unlike its outline: looked at closely, in a box of {box} mm.")
    return replace(request, close_up=close_up)


def _is_small(outline_ras: np.ndarray, session: SegmentationSession) -> bool:
    return is_small(np.concatenate(points_of_outline(outline_ras, session.volume.geometry.body_scale)), _cell_mm(session))


def _cell_mm(session: SegmentationSession) -> float:
    """The longest edge of the whole volume's cells."""
    return float(session.features.source.cells.spacing_mm.max())


def _in_whole(requests: Sequence[ClassRequest]) -> list[ClassRequest]:
    return [replace(request, close_up=None) for request in requests]


def _with_close_up(
    request: ClassRequest, similarity: ClassMap, geometry: Geometry, on_warning: Callable[[str], None]
) -> ClassRequest:
    try:
        return replace(request, close_up=close_up_of(similarity, request.positive, geometry))
    except InputError as error:
        on_warning(f"{request.name}: {error} It is looked at in the whole scan.")
        return request
