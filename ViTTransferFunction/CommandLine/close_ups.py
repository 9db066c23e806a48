"""The close-ups of annotated classes: boxes that a file names, and boxes chosen from the classes' maps.

Such a box is asked for by a file, or comes unasked, as in panel and app: for what is small, and unlike its outline.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ViTTransferFunction.Logic.core.annotated_class import AnnotatedClass
from ViTTransferFunction.Logic.core.class_map import ClassMap
from ViTTransferFunction.Logic.core.class_request import ClassRequest
from ViTTransferFunction.Logic.core.close_up_choice import close_up_of
from ViTTransferFunction.Logic.core.errors import InputError
from ViTTransferFunction.Logic.core.geometry import Geometry
from ViTTransferFunction.Logic.core.region_points import points_of_outline
from ViTTransferFunction.Logic.core.small_outlines import asks_for_close_up, is_small
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
    outlined = [annotated.outline_ras is not None and annotated.request.refine for annotated in classes]
    if method == "none" or not any(outlined):
        return requests
    outlines = [annotated.outline_ras for annotated in classes]
    return _with_unasked(session, requests, outlines, method, only_annotated_components, on_warning)


def _with_unasked(
    session: SegmentationSession,
    requests: list[ClassRequest],
    outlines: Sequence[np.ndarray | None],
    method: RefinementMethod,
    only_annotated_components: bool,
    on_warning: Callable[[str], None],
) -> list[ClassRequest]:
    """The requests, with close-ups of those that are small and unlike their outlines in the whole volume."""
    geometry, whole, crops = session.volume.geometry, _in_whole(requests), SegmentCrops()
    cell_mm = float(session.low_resolution_maps(whole)[0].geometry.spacing_mm.max())
    if not any(outline is not None and is_small(np.concatenate(points_of_outline(outline)), cell_mm) for outline in outlines):
        return requests
    labels = session.segment(whole, method, only_annotated_components, on_map=crops.take).labels
    looked_at = []
    for request, outline, crop in zip(requests, outlines, crops.of(labels), strict=True):
        shown = crop.on(geometry)
        if outline is None or request.close_up is not None or not asks_for_close_up(shown, outline, cell_mm):
            looked_at.append(request)
            continue
        try:
            close_up = close_up_of(shown, request.positive, geometry)
        except InputError:
            looked_at.append(request)
            continue
        edges = " × ".join(f"{edge:.0f}" for edge in close_up.size_mm)
        on_warning(
            f"{request.name}: small, and in the whole scan unlike its outline: looked at closely, in a box of {edges} mm."
        )
        looked_at.append(replace(request, close_up=close_up))
    return looked_at


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
