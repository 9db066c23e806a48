"""Requests to the compute process and its replies, each a dataclass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..core.classes.class_map import ClassMap
from ..core.classes.class_request import ClassRequest
from ..core.volumes.geometry import Geometry
from ..refinement.refinement import RefinementMethod
from ..session.settings import SessionSettings

RenderingMode = Literal["similarity", "transfer function"]
"""How structures are rendered: as smooth surfaces of their maps, or from maps and the volume's intensities."""


@dataclass(frozen=True)
class Refinement:
    """How full-resolution maps and labels are made.

    Attributes:
        method: how maps are sharpened.
        only_annotated_components: drop the parts of a segment that hold none of its positive points.
    """

    method: RefinementMethod = "bilateral"
    only_annotated_components: bool = True


@dataclass(frozen=True, eq=False)
class TakeVolume:
    """Take a volume; everything that follows is about it. Replied to by `Taken`.

    Attributes:
        array: voxels (K, J, I), unchecked.
        geometry: where they lie.
        name: what users call it.
    """

    array: np.ndarray
    geometry: Geometry
    name: str


@dataclass(frozen=True)
class Taken:
    """The volume can be segmented. `digest`: `Volume.digest` in hexadecimal, by which its voxels are recognised."""

    digest: str


@dataclass(frozen=True)
class ReleaseVolume:
    """Free the volume, its features, and everything else that was made from it. Replied to by `Done`."""


@dataclass(frozen=True)
class Prepare:
    """Choose the settings. Replied to by `FeatureEstimate`."""

    settings: SessionSettings


@dataclass(frozen=True)
class Extract:
    """Load the features, from the cache or by computing them. Replied to by `Loaded`, after any number of `CoarseFeatures`."""


@dataclass(frozen=True)
class LookCloser:
    """Load the features of all classes' close-ups, from the cache or by computing them. Replied to by `Loaded`."""

    classes: tuple[ClassRequest, ...]


@dataclass(frozen=True)
class ComputeMaps:
    """Compute S_L of all classes. Replied to by `Maps`, perhaps after a `FirstMap`; served in parallel to other requests.

    Attributes:
        classes: the classes.
        first: id of the class whose map is wanted before the others; "": none.
    """

    classes: tuple[ClassRequest, ...]
    first: str = ""


@dataclass(frozen=True)
class MeasureMaps:
    """Measure the segments that the last S_L give; apart from `ComputeMaps`, so that maps do not wait. Replied to by `Volumes`.

    Attributes:
        classes: the classes.
        only_annotated_components: whether only components that contain a positive point count, see `Refinement`.
    """

    classes: tuple[ClassRequest, ...]
    only_annotated_components: bool = True


@dataclass(frozen=True)
class RefineMaps:
    """Compute S_H of all classes, each cropped to its relevant box, uint8. Replied to by `RefinedMaps`."""

    classes: tuple[ClassRequest, ...]
    refinement: Refinement


@dataclass(frozen=True)
class SegmentClasses:
    """Compute the label map of all classes. Replied to by `Labels`."""

    classes: tuple[ClassRequest, ...]
    refinement: Refinement


@dataclass(frozen=True)
class Render:
    """Combine the last maps into a volume of structures. Replied to by `StructureVolume`.

    Attributes:
        mode: how structures are rendered.
        refined: for each class, whether to use its last refined map.
        casting: for each class, whether it casts shadows on the others.
        surroundings: whether to include everything outside the structures, to the borders of the volume.
    """

    mode: RenderingMode
    refined: tuple[bool, ...]
    casting: tuple[bool, ...]
    surroundings: bool = False


@dataclass(frozen=True)
class Cancel:
    """Cancel these requests. It has no reply of its own."""

    numbers: tuple[int, ...]


@dataclass(frozen=True)
class Started:
    """The compute process has started, with this process id. It answers no request."""

    pid: int


@dataclass(frozen=True)
class Done:
    """The request is done, and has no result to reply."""


@dataclass(frozen=True)
class Loaded:
    """The features are loaded.

    Attributes:
        not_kept: see `SegmentationSession.not_kept`.
    """

    not_kept: str


@dataclass(frozen=True)
class FirstMap:
    """S_L of the class `first` of the request, as soon as it is there; `Maps` with all others follows."""

    map: ClassMap


@dataclass(frozen=True)
class Maps:
    """S_L of each class, in the order of the request.

    Attributes:
        maps: S_L, without that of a `FirstMap`.
        awaiting_close_ups: ids of the classes whose maps are of the whole volume only until `LookCloser`.
    """

    maps: tuple[ClassMap, ...]
    awaiting_close_ups: tuple[str, ...] = ()


@dataclass(frozen=True)
class Volumes:
    """The volume of each class's segment in millilitres, estimated on the cells, in the order of the request."""

    volumes_ml: tuple[float, ...]


@dataclass(frozen=True)
class RefinedMaps:
    """S_H of each class, in the order of the request.

    Attributes:
        maps: S_H.
        volumes_ml: the volume of each class's segment that these maps give, millilitres.
    """

    maps: tuple[ClassMap, ...]
    volumes_ml: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Labels:
    """The label map, cropped to the smallest box that contains all classes.

    Attributes:
        array: (K, J, I) of the box, uint8 for up to 255 classes, else uint16: 1 + index of the class in the request, 0
            elsewhere. Empty if no class has a voxel.
        first: k, j and i of the box's first voxel in the volume.
    """

    array: np.ndarray
    first: tuple[int, int, int]


@dataclass(frozen=True)
class Progressed:
    """`done` of `total` steps of the work named `what`; more replies follow."""

    done: int
    total: int
    what: str


@dataclass(frozen=True)
class CoarseFeatures:
    """Coarse or finer features are there, and maps can be computed from them; more replies follow."""


@dataclass(frozen=True)
class GivenUp:
    """The request was cancelled."""


@dataclass(frozen=True)
class Failed:
    """An input of the user's cannot be used, or there is not enough memory or disk space; `message` tells the user which."""

    message: str


UNFINISHED = (Progressed, CoarseFeatures, FirstMap)
"""Replies that are followed by others to the same request."""
