"""The close-ups that annotated classes ask for: boxes that a file names, and boxes chosen from the classes' maps."""

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
    session: SegmentationSession, classes: Sequence[AnnotatedClass], on_warning: Callable[[str], None]
) -> list[ClassRequest]:
    """The requests of annotated classes, with the close-ups that were still to be chosen.

    Args:
        session: with its features loaded.
        classes: whose points lie inside the volume.
        on_warning: is told of each class that has to be looked at in the whole volume, since its box would be too large.
    """
    requests = [annotated.request for annotated in classes]
    if not any(annotated.close_up_from_map for annotated in classes):
        return requests
    # Of the whole volume: where a structure lies is what is to be found out.
    maps = session.low_resolution_maps([replace(request, close_up=None) for request in requests])
    return [
        _with_close_up(annotated.request, similarity, session.volume.geometry, on_warning)
        if annotated.close_up_from_map
        else annotated.request
        for annotated, similarity in zip(classes, maps, strict=True)
    ]


def _with_close_up(
    request: ClassRequest, similarity: ClassMap, geometry: Geometry, on_warning: Callable[[str], None]
) -> ClassRequest:
    try:
        return replace(request, close_up=close_up_of(similarity, request.positive, geometry))
    except InputError as error:
        on_warning(f"{request.name}: {error} It is looked at in the whole scan.")
        return request
