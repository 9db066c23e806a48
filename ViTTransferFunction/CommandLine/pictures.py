"""Pictures of a segmentation to look at: slices with overlay, and a rendering in 3D."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ViTTransferFunction.CommandLine.canvas import PictureSegment
from ViTTransferFunction.CommandLine.lettering import legible_names
from ViTTransferFunction.CommandLine.rendering_path import rendering_path
from ViTTransferFunction.CommandLine.rendering_picture import BONE_HU, Rendering, render_3d
from ViTTransferFunction.CommandLine.slice_picture import PicturePoint, draw_slices
from ViTTransferFunction.Logic.core.classes.annotated_class import AnnotatedClass
from ViTTransferFunction.Logic.core.system.progress import Progress
from ViTTransferFunction.Logic.core.volumes.intensity_window import display_window, looks_like_hounsfield_units
from ViTTransferFunction.Logic.core.volumes.volume import Volume
from ViTTransferFunction.Logic.files.segmentation_files import Segment
from ViTTransferFunction.Logic.rendering.appearance import DEFAULT_STYLE
from ViTTransferFunction.Logic.scene.views.png_file import save_png

NO_CONTEXT = "off"


def draw_pictures(
    path: Path,
    volume: Volume,
    labels: np.ndarray,
    segments: Sequence[Segment],
    classes: Sequence[AnnotatedClass],
    progress: Progress,
) -> tuple[Path, Path]:
    """Draw the slices to `path` and the 3D rendering beside it, as `<name>_3d.png`.

    Args:
        path: of the slice picture.
        volume: the intensities.
        labels: (K, J, I), 1 + index for each segment.
        segments: names and colours.
        classes: annotations to mark in the slices; in the order of the segments.
        progress: called with pictures drawn.

    Returns:
        The two paths.

    Raises:
        InputError: a picture cannot be drawn or written.
    """
    shown = shown_segments(labels, segments)
    progress(0, 2, "Drawing pictures")
    draw_slice_picture(path, volume, shown, classes)
    progress(1, 2, "Drawing pictures")
    save_png(render_3d(volume, shown, context_above=_context_above(volume)), rendering_path(path))
    progress(2, 2, "Drawing pictures")
    return path, rendering_path(path)


def shown_segments(
    labels: np.ndarray, segments: Sequence[Segment], opacities: Sequence[float] | None = None
) -> list[PictureSegment]:
    """The segments of labels (K, J, I), 1 + index for each, under names that can be drawn; opaque without `opacities`."""
    names = legible_names([segment.name for segment in segments])
    each = zip(names, segments, opacities or [1.0] * len(segments), strict=True)
    return [
        PictureSegment(name, segment.color, opacity, labels == label)
        for label, (name, segment, opacity) in enumerate(each, start=1)
    ]


def draw_slice_picture(path: Path, volume: Volume, shown: Sequence[PictureSegment], classes: Sequence[AnnotatedClass]) -> None:
    """Draw the slices with overlay, and mark the points of the annotations, which are in the order of what is shown.

    Raises:
        InputError: the picture cannot be written.
    """
    window = display_window(volume)
    points = [
        PicturePoint(position, index, positive)
        for index, annotated in enumerate(classes)
        for positive, positions in ((True, annotated.request.positive), (False, annotated.request.negative))
        for position in positions
    ]
    save_png(draw_slices(volume, shown, window=(window.low, window.high), points=points), path)


def open_rendering(
    volume: Volume, shown: Sequence[PictureSegment], context: str | None, style: str = DEFAULT_STYLE
) -> Rendering:
    """The segments in 3D, one of which at least has voxels.

    Args:
        volume: where the segments lie.
        shown: the segments.
        context: what is around them, one of `CONTEXTS`, or `NO_CONTEXT`; None: in CT, bones.
        style: of the segments, one of `STYLES`.

    Raises:
        InputError: OpenGL is missing.
    """
    if context is None:
        return Rendering(volume, shown, context_above=_context_above(volume), style=style)
    return Rendering(volume, shown, context=None if context == NO_CONTEXT else context, style=style)


def _context_above(volume: Volume) -> float | None:
    return BONE_HU if looks_like_hounsfield_units(volume) else None
