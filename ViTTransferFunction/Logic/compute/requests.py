"""What the compute process is asked for, and what it replies: one dataclass each."""

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
"""Smooth surfaces alone, or where the volume's own detail takes them."""


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
    """The volume can be segmented. `digest`: hexadecimal, of its voxels, by which they are known again (`Volume.digest`)."""

    digest: str


@dataclass(frozen=True)
class ReleaseVolume:
    """Let go of the volume, its features, and all else that is known of it. Replied to by `Done`."""


@dataclass(frozen=True)
class Prepare:
    """Choose the settings. Replied to by `FeatureEstimate`."""

    settings: SessionSettings


@dataclass(frozen=True)
class Extract:
    """Load the features, from the cache or by computing them. Replied to by `Loaded`, after any number of `CoarseFeatures`."""


@dataclass(frozen=True)
class LookCloser:
    """Load the features of all classes' close-ups, from the cache or by computing them. Replied to by `Done`."""

    classes: tuple[ClassRequest, ...]


@dataclass(frozen=True)
class ComputeMaps:
    """S_L of all classes. Replied to by `Maps`, after a `FirstMap` maybe, while other requests are still being served.

    Attributes:
        classes: of which classes.
        first: id of the class whose map somebody waits for; "" if nobody does more than for the others.
    """

    classes: tuple[ClassRequest, ...]
    first: str = ""


@dataclass(frozen=True)
class MeasureMaps:
    """How large the segments are by the S_L that were replied last, which did not wait for it. Replied to by `Volumes`.

    Attributes:
        classes: of which classes.
        only_annotated_components: whether the parts alone count that hold a positive point, see `Refinement`.
    """

    classes: tuple[ClassRequest, ...]
    only_annotated_components: bool = True


@dataclass(frozen=True)
class RefineMaps:
    """S_H of all classes, each on the box that matters, uint8. Replied to by `RefinedMaps`."""

    classes: tuple[ClassRequest, ...]
    refinement: Refinement


@dataclass(frozen=True)
class SegmentClasses:
    """Labels of all classes. Replied to by `Labels`."""

    classes: tuple[ClassRequest, ...]
    refinement: Refinement


@dataclass(frozen=True)
class Render:
    """The maps that were replied last as a volume of structures. Replied to by `StructureVolume`.

    Attributes:
        mode: what decides where structures are.
        refined: of each class, whether its last refined map is meant.
        casting: of each class, whether it casts shadows on the others.
        surroundings: whether what belongs to no structure is wanted as well, as far as the volume reaches.
    """

    mode: RenderingMode
    refined: tuple[bool, ...]
    casting: tuple[bool, ...]
    surroundings: bool = False


@dataclass(frozen=True)
class Cancel:
    """Give up these requests. It has no reply of its own."""

    numbers: tuple[int, ...]


@dataclass(frozen=True)
class Started:
    """The compute process is there, and this is its own number. It answers no request."""

    pid: int


@dataclass(frozen=True)
class Done:
    """It is done, and there is nothing more to say."""


@dataclass(frozen=True)
class Loaded:
    """The features are there.

    Attributes:
        not_kept: see `FeatureProvenance`.
    """

    not_kept: str


@dataclass(frozen=True)
class FirstMap:
    """S_L of the class that is waited for, as soon as it is there; `Maps` with all others follow."""

    map: ClassMap


@dataclass(frozen=True)
class Maps:
    """S_L of each class, in the order of the request.

    Attributes:
        maps: S_L; without that of the first class, where it was replied before.
        awaiting_close_ups: ids of the classes that are looked at in the whole volume only until `LookCloser`.
    """

    maps: tuple[ClassMap, ...]
    awaiting_close_ups: tuple[str, ...] = ()


@dataclass(frozen=True)
class Volumes:
    """Of the segment of each class, in the order of the request, millilitres, to the size of a cell."""

    volumes_ml: tuple[float, ...]


@dataclass(frozen=True)
class RefinedMaps:
    """S_H of each class, in the order of the request.

    Attributes:
        maps: S_H.
        volumes_ml: of the segment that each class gets by these maps, millilitres.
    """

    maps: tuple[ClassMap, ...]
    volumes_ml: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Labels:
    """Which class each voxel belongs to, on the smallest box that holds them all.

    Attributes:
        array: (K, J, I) of the box, uint8 where that has room for all classes, else uint16: 1 + index of the class in the
            request, 0 elsewhere. Empty where no class has a voxel.
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
    """Maps can be had of the features that there are so far; more replies follow."""


@dataclass(frozen=True)
class GivenUp:
    """The request was cancelled."""


@dataclass(frozen=True)
class Failed:
    """Something that the user gave cannot be used, or memory or disk are too small; `message` says what, in words for users."""

    message: str


UNFINISHED = (Progressed, CoarseFeatures, FirstMap)
"""Replies that are followed by others to the same request."""
