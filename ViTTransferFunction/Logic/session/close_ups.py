"""Close-ups: classes that are looked at by themselves, each in a box of the volume with features of its own.

In the whole scan, a small or thin structure is narrower than a patch of the network, so that its features are mostly those of
its neighbours. Whitening over the whole scan also favours the differences that are largest there, which are others than those
that tell this structure from its surroundings. In a box of its own, the structure spans many patches, and features are whitened
over the box. Intensity windows and the scale of distances stay those of the whole volume: a click means the same in both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from ..core.classes.class_map import ClassMap
from ..core.classes.class_request import ClassRequest
from ..core.system.errors import InputError
from ..core.system.progress import Between, Progress
from ..core.volumes.geometry import Box, Geometry
from ..core.volumes.resampling import sample_at
from ..core.volumes.volume import Volume
from ..features.settings import FeatureSettings
from ..refinement.refinement import RefinementMethod
from .refined_map import RefinedMap

MOST_PATCHES = 8_000
"""Most patches of a close-up, in all slices together: 20 000 give no better result, and take more than twice as long."""


class PartSession(Protocol):
    """The methods of `SegmentationSession` that a part calls. A protocol, because that file imports this one."""

    @property
    def volume(self) -> Volume:
        """The part."""

    def load_features(self, progress: Progress) -> Any:
        """See `SegmentationSession`; so for the methods below."""

    def prepare_clicks(self) -> None:
        """See there."""

    def low_resolution_maps(self, requests: Sequence[ClassRequest], between: Between) -> list[ClassMap]:
        """See there."""

    def refined_map(
        self,
        low: ClassMap,
        requests: Sequence[ClassRequest],
        index: int,
        method: RefinementMethod,
        between: Between,
    ) -> RefinedMap:
        """See there."""


class Part:
    """A part of a volume in which a class is looked at by itself.

    Attributes:
        box: where it lies in the volume.
        session: on it, with its features.
    """

    def __init__(self, box: Box, session: PartSession) -> None:
        self.box = box
        self.session = session
        self._last: tuple[ClassRequest, Geometry, ClassMap] | None = None

    def requests(self, requests: Sequence[ClassRequest], index: int) -> tuple[list[ClassRequest], int]:
        """The requests to make of the part: all classes with positive points in it, with only the points in it.

        Returns:
            These requests, and the index among them of the class that is `requests[index]`, which must have a positive point
            in the part.
        """
        geometry = self.session.volume.geometry
        inside = [
            replace(
                request,
                positive=_inside(request.positive, geometry),
                negative=_inside(request.negative, geometry),
                close_up=None,
            )
            for request in requests
            if geometry.contains(request.positive).any()
        ]
        return inside, [request.id for request in inside].index(requests[index].id)

    def map_on(self, cells: Geometry, requests: Sequence[ClassRequest], index: int, between: Between) -> ClassMap:
        """S_L of the index-th class on a grid of the whole volume: its largest value within each cell, 0 outside the part.

        The last answer is returned again as long as the class's own request and the grid are the same, even if other classes
        have changed: a click on one class often lies in the boxes of several. `refined_map` does not use this answer.
        """
        if self._last is None or self._last[:2] != (requests[index], cells):
            asked, place = self.requests(requests, index)
            low = self.session.low_resolution_maps(asked, between)[place]
            on_cells = ClassMap(largest_within(low, cells), cells, low.iso, low.proposals)
            self._last = requests[index], cells, on_cells
        return self._last[2]

    def refined_map(
        self,
        shape: tuple[int, int, int],
        requests: Sequence[ClassRequest],
        index: int,
        method: RefinementMethod,
        between: Between,
    ) -> RefinedMap:
        """S_H of the index-th class on the whole volume of `shape` (K, J, I); 0 outside the part. See `SegmentationSession`."""
        asked, place = self.requests(requests, index)
        low = self.session.low_resolution_maps(asked, between)[place]
        refined = self.session.refined_map(low, asked, place, method, between)
        return RefinedMap(refined.voxels.placed(shape, self.box), refined.iso)


class CloseUps:
    """The parts of a volume in which classes are looked at.

    Args:
        volume: the whole volume.
        open_part: makes a session on a part of it; None: there are no close-ups, and all classes use the whole volume.

    Attributes:
        not_kept: why the features of a close-up could not be stored in the cache, the first time that this happened; "" if it
            never has.
    """

    def __init__(self, volume: Volume, open_part: Callable[[Volume], PartSession] | None) -> None:
        self._volume = volume
        self._open_part = open_part
        self._parts: dict[str, Part | None] = {}
        self.not_kept = ""

    def of(self, request: ClassRequest) -> Part | None:
        """The part in which a class is looked at; None if that is the whole volume, perhaps only until `load` is called."""
        return None if request.close_up is None else self._parts.get(self._name(request))

    def missing(self, requests: Sequence[ClassRequest]) -> list[ClassRequest]:
        """The requests of the classes whose close-ups have not been loaded yet."""
        if self._open_part is None:
            return []
        return [request for request in requests if request.close_up is not None and self._name(request) not in self._parts]

    def load(self, requests: Sequence[ClassRequest], progress: Progress) -> None:
        """Load the features of all close-ups, which takes one to three seconds each; close-ups of no class are forgotten.

        Raises:
            InputError, Cancelled: as `SegmentationSession.load_features`.
        """
        wanted = {self._name(request) for request in requests if request.close_up is not None}
        self._parts = {name: part for name, part in self._parts.items() if name in wanted}
        for request in self.missing(requests):
            # A new dictionary each time, because other threads read it meanwhile.
            self._parts = {**self._parts, self._name(request): self._loaded(request, progress)}

    def _loaded(self, request: ClassRequest, progress: Progress) -> Part | None:
        assert self._open_part is not None
        box = self._box(request)
        try:
            session = self._open_part(self._volume.part(box))
        except InputError:
            return None  # It has a single intensity, or fewer voxels along its longest edge than a grid has cells.
        provenance = session.load_features(lambda done, total, what: progress(done, total, f"Looking closer at {request.name}"))
        # The first reason stays, because a full disk is described in megabytes, which differ from close-up to close-up.
        self.not_kept = self.not_kept or provenance.not_kept
        session.prepare_clicks()
        return Part(box, session)

    def _name(self, request: ClassRequest) -> str:
        return str(self._box(request))

    def _box(self, request: ClassRequest) -> Box:
        assert request.close_up is not None
        return request.close_up.box_in(self._volume.geometry, request.positive)


def close_up_settings(settings: FeatureSettings, part: Geometry) -> FeatureSettings:
    """Settings to extract a part's features with, given those of the whole volume.

    The grid is made coarser where its cells would be smaller than a voxel's shortest edge. In scans with thick slices, cells
    may therefore be as fine as the pixels of a slice.

    Args:
        settings: of the whole volume.
        part: geometry of the part's voxels.

    Raises:
        InputError: the part is so short that the grid would have fewer cells than a grid must have (`SMALLEST_GRID`).
    """
    most_cells = round(part.extent_mm.max() / part.spacing_mm.min()) if settings.isotropic else max(part.shape)
    return replace(settings.with_grid(min(settings.grid, most_cells)), most_patches=MOST_PATCHES)


def largest_within(part: ClassMap, cells: Geometry) -> np.ndarray:
    """The largest value of a part's map within each cell of another grid, (K', J', I') float32; 0 outside the part.

    The mean would be below the iso value everywhere in a structure that is thinner than a cell. Cells that are smaller than
    those of the part's map get the value at their centre.
    """
    largest = np.zeros(cells.shape, dtype=np.float32)
    np.maximum.at(largest, tuple(cells.nearest_voxels(part.geometry.voxel_centres_ras()).T), part.array.ravel())
    corners = part.geometry.ijk_to_ras_points(np.array([np.zeros(3), part.geometry.shape[::-1]]) - 0.5)
    first, last = np.sort(cells.ras_to_ijk(corners)[:, ::-1] + 0.5, axis=0)
    k, j, i = (
        slice(max(int(np.floor(a)), 0), min(int(np.ceil(b)), size)) for a, b, size in zip(first, last, cells.shape, strict=True)
    )
    covered = cells.part((k, j, i))
    centres = covered.voxel_centres_ras()
    inside = part.geometry.contains(centres)
    values = np.where(inside, sample_at(part.array[..., None], part.geometry, centres)[:, 0], 0.0)
    largest[k, j, i] = np.maximum(largest[k, j, i], values.reshape(covered.shape))
    return largest


def _inside(points_ras: np.ndarray, geometry: Geometry) -> np.ndarray:
    inside: np.ndarray = points_ras[geometry.contains(points_ras)]
    return inside
