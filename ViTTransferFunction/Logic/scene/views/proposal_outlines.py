"""What the selected class might be instead: faint outlines of its smaller and larger proposals over the slices.

They are made of S_L, since S_H is known near the surface alone that is shown; and as segments are made: without what other
classes claim, and without parts that hold no point. What a step leads to is refined, and so differs a little.
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
"""Of the proposals: the chosen one, the smaller and the larger one."""
LEAST_DIFFERENCE = 0.1
"""Share of a volume by which another has to differ to be worth an outline: less looks like the same line drawn twice."""
MOST_AMBIGUOUS_POINTS = 2
"""Of a class. More say how large it is: another size is hardly worth anything (docs/RESULTS.md), and its outlines confuse."""
JUST_BELOW = 0.98
"""Share of the iso value that a map has at most where the class does not get what it claims."""

STYLE = OutlineStyle("Similarity proposals", line_pixels=1, opacity=0.6)
"""Thinner and fainter than what is shown as the structure."""


@dataclass(frozen=True, eq=False)
class Proposals:
    """A class with other proposals than the one that is shown.

    Attributes:
        class_id: of the class.
        color: of the class.
        map: S_L of the class with the iso value that is shown, and with proposals.
        others: S_L of all other classes with theirs.
        points_ras: (N, 3), on the structure, in the maps' frame.
        only_annotated_components: whether parts that hold none of the points are dropped.
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
        """Whether the outlines of both are the same but for which of them is shown, as by another size."""
        if other is None or len(self.others) != len(other.others):
            return False
        mine, theirs = (
            (p.class_id, p.color, p.map.proposals, p.only_annotated_components, *(m.iso for m in p.others))
            for p in (self, other)
        )
        arrays = ((one.map.array, *(m.array for m in one.others), one.points_ras) for one in (self, other))
        return mine == theirs and all(map(np.array_equal, *arrays))


class ProposalOutlines:
    """Shows the outlines of one class's proposals in all slice views, a little later by `advance`.

    Args:
        scene: where the volumes are.
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
        """Show these, or others instead, from the next calls of `advance` on; None: nothing."""
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
            # What is under way for another size is not begun anew at every notch of the wheel: most of it is of use.
            self._work = self._work or self._begun(proposals)

    @property
    def pending(self) -> bool:
        """Whether there is something still to be shown."""
        return self._work is not None

    def advance(self) -> None:
        """Go on to make the outlines, and show them when they are ready."""
        while self._work is not None and self._wanted is not None and self._work[1].advance():
            proposals, work = self._work
            if proposals is self._wanted:
                self._work = None
                self._draw(proposals, work.result or [])
            else:
                # All surfaces are there by now: which of them to show is found at once, before the next notch.
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
        """Take all that was made out of the scene."""
        self.hide()
        self._contours.remove()


@dataclass
class Made:
    """What was made of a map's proposals, whichever is shown.

    Attributes:
        claimed: by which factor the other classes exceed their iso values at most, (K', J', I'); None until known.
        volumes: by iso value, how many cells the class gets.
        surfaces: by iso value, their surface.
    """

    claimed: np.ndarray | None = None
    volumes: dict[float, int] = field(default_factory=dict)
    surfaces: dict[float, Surface] = field(default_factory=dict)


def outlines(proposals: Proposals, made: Made | None = None) -> Steps[Surface]:
    """The surfaces of all proposals that are distinct from what is shown and from each other; in steps.

    Args:
        proposals: of a class.
        made: of the same map before, to which is added what is made now.
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
    """By which factor the other classes exceed their iso values at most, (K', J', I')."""
    most = np.zeros(shape, dtype=np.float32)
    for other in others:
        np.maximum(most, over_iso(other.array, other.iso), out=most)
    return most


def _inside(proposals: Proposals, iso: float, claimed: np.ndarray) -> np.ndarray:
    """(K', J', I') uint16: 1 in the cells that the class gets at an iso value."""
    array = proposals.map.array
    inside = ((array >= iso) & (over_iso(array, iso) > claimed)).astype(np.uint16)
    if proposals.only_annotated_components:
        keep_annotated_components(inside, proposals.map.geometry, {1: proposals.points_ras})
    return inside
