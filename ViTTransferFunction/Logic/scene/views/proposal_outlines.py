"""Faint outlines, in the slice views, of the smaller and larger proposals for the selected class.

They are computed from S_L, because S_H is only known near the surface that is shown. As in segments, voxels that other classes
claim and components without a point are left out. The result after a change of size is refined, and thus differs slightly.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ...core.classes.class_map import ClassMap
from ...core.classes.colors import Color
from ...core.volumes.stepped_work import SteppedWork, Steps
from ...session.labels import keep_annotated_components, over_iso
from .contours import Contours, OutlineStyle, Surface, iso_surface

if TYPE_CHECKING:
    import slicer

SIZES = (0.0, -1.0, 1.0)
"""Sizes of the proposals: the chosen, the smaller and the larger one."""
LEAST_DIFFERENCE = 0.1
"""Least relative difference in volume for a separate outline: with less, it would look like the same line drawn twice."""
MOST_AMBIGUOUS_POINTS = 2
"""Classes with more points have outlines only while another size than 0 is chosen. Their size is well known: another one hardly
helps (docs/RESULTS.md), and its outlines would confuse."""
JUST_BELOW = 0.98
"""Factor of the iso value to which a map is limited in voxels that the class does not get."""

STYLE = OutlineStyle("Similarity proposals", line_pixels=1, opacity=0.6)
"""Thinner and fainter than the outline of the structure."""


@dataclass(frozen=True, eq=False)
class Proposals:
    """A class whose proposals are outlined.

    Attributes:
        class_id: id of the class.
        color: colour of the class.
        map: S_L of the class, with its proposals and the iso value that is shown.
        others: S_L of all other classes, with their iso values.
        points_ras: positive points, (N, 3) RAS millimetres, in the coordinate frame of the maps.
        only_annotated_components: whether components without any of the points are left out.
    """

    class_id: str
    color: Color
    map: ClassMap
    others: tuple[ClassMap, ...]
    points_ras: np.ndarray
    only_annotated_components: bool

    def is_like(self, other: Proposals | None) -> bool:
        """Whether the outlines of both are the same."""
        return self.is_of_map_of(other) and other is not None and self.map.iso == other.map.iso

    def is_of_map_of(self, other: Proposals | None) -> bool:
        """Whether both differ at most in the iso value that is shown, as after a change of size."""
        if other is None or len(self.others) != len(other.others):
            return False
        mine, theirs = (
            (p.class_id, p.color, p.map.proposals, p.only_annotated_components, *(m.iso for m in p.others))
            for p in (self, other)
        )
        arrays = ((one.map.array, *(m.array for m in one.others), one.points_ras) for one in (self, other))
        return mine == theirs and all(map(np.array_equal, *arrays))


class ProposalOutlines:
    """Shows the outlines of one class's proposals in all slice views; they are computed in steps by `advance`.

    Args:
        scene: the scene.
    """

    def __init__(self, scene: slicer.vtkMRMLScene) -> None:
        self._contours = Contours(scene, STYLE)
        self._volume: slicer.vtkMRMLScalarVolumeNode | None = None
        self._transform = ""
        self._wanted: Proposals | None = None
        self._shown: tuple[Proposals, Surface] | None = None
        self._made: Made | None = None
        self._work: tuple[Proposals, SteppedWork[Surface]] | None = None

    def show(self, volume: slicer.vtkMRMLScalarVolumeNode, proposals: Proposals | None) -> None:
        """Show these proposals, from one of the next calls of `advance` on; None: nothing."""
        if proposals is None:
            self.hide()
            return
        before = self._volume, self._transform
        self._volume, self._transform = volume, volume.GetTransformNodeID() or ""
        if self._shown is not None and self._shown[0].class_id != proposals.class_id:
            self._shown = None
            self._contours.hide()
        elif self._shown is not None and (self._volume, self._transform) != before:
            self._draw(*self._shown)
        if not proposals.is_like(self._wanted):
            if not proposals.is_of_map_of(self._wanted):
                self._made, self._work = Made(), None
            self._wanted = proposals
            # Work for another size is not restarted at each wheel event, because most of it can be reused.
            self._work = self._work or self._begun(proposals)

    @property
    def pending(self) -> bool:
        """Whether `advance` has something to do."""
        return self._work is not None

    def advance(self) -> None:
        """Continue to compute the outlines, and show them when they are complete."""
        while self._work is not None and self._wanted is not None and self._work[1].advance():
            proposals, work = self._work
            if proposals is self._wanted:
                self._work = None
                self._draw(proposals, work.result or [])
            else:
                # All surfaces exist by now, so it takes only a moment to choose those to show.
                self._work = self._begun(self._wanted)

    def _begun(self, proposals: Proposals) -> tuple[Proposals, SteppedWork[Surface]]:
        return proposals, SteppedWork(outlines(proposals, self._made))

    def _draw(self, proposals: Proposals, surface: Surface) -> None:
        self._shown = proposals, surface
        self._contours.show(self._volume, [(proposals.color, surface)])

    def hide(self) -> None:
        """Show nothing."""
        self._contours.hide()
        self._volume = self._wanted = self._shown = self._made = self._work = None

    def remove(self) -> None:
        """Remove all nodes that were added to the scene."""
        self.hide()
        self._contours.remove()


@dataclass
class Made:
    """Intermediate results for a map's proposals, which do not depend on the one that is shown.

    Attributes:
        claimed: the largest ratio of another class's map to its iso value, (K', J', I'); None until computed.
        volumes: number of cells that the class gets, by iso value.
        surfaces: the surface of these cells, by iso value.
    """

    claimed: np.ndarray | None = None
    volumes: dict[float, int] = field(default_factory=dict)
    surfaces: dict[float, Surface] = field(default_factory=dict)


def outlines(proposals: Proposals, made: Made | None = None) -> Steps[Surface]:
    """The surfaces of all proposals that are distinct from what is shown and from each other; in steps.

    Args:
        proposals: the proposals of a class.
        made: earlier intermediate results for the same map; new ones are added.
    """
    made = made or Made()
    surface: Surface = []
    shown, known = proposals.map, proposals.map.proposals
    if made.claimed is None:
        made.claimed = _claimed(proposals.others, shown.array.shape)
    volumes = [int(np.count_nonzero(_inside(proposals, shown.iso, made.claimed)))]
    for iso in (known.at(size) for size in SIZES) if known is not None else ():
        if iso not in made.volumes:
            yield shown.array.size
            made.volumes[iso] = int(np.count_nonzero(_inside(proposals, iso, made.claimed)))
        volume = made.volumes[iso]
        if all(abs(volume - other) >= LEAST_DIFFERENCE * max(volume, other, 1) for other in volumes):
            volumes.append(volume)
            if iso not in made.surfaces:
                inside = _inside(proposals, iso, made.claimed)
                enclosing = np.where(inside, np.maximum(shown.array, iso), np.minimum(shown.array, JUST_BELOW * iso))
                made.surfaces[iso] = yield from iso_surface(ClassMap(enclosing.astype(np.float32), shown.geometry, iso))
            surface += made.surfaces[iso]
    return surface


def _claimed(others: tuple[ClassMap, ...], shape: tuple[int, ...]) -> np.ndarray:
    """The largest ratio of another class's map to its iso value, (K', J', I') float32."""
    most = np.zeros(shape, dtype=np.float32)
    for other in others:
        np.maximum(most, over_iso(other.array, other.iso), out=most)
    return most


def _inside(proposals: Proposals, iso: float, claimed: np.ndarray) -> np.ndarray:
    """The cells that the class gets at an iso value, (K', J', I') uint16, 1 or 0."""
    array = proposals.map.array
    inside = ((array >= iso) & (over_iso(array, iso) > claimed)).astype(np.uint16)
    if proposals.only_annotated_components:
        keep_annotated_components(inside, proposals.map.geometry, {1: proposals.points_ras})
    return inside
