"""From similarity maps to labels: which class gets each voxel, and the parts that the user meant."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..core.classes.iso_proposals import SMALLEST_ISO
from ..core.system.progress import Between, nothing_between
from ..core.volumes.bounding_box import common_part, whole_box, within
from ..core.volumes.geometry import Box, Geometry
from ..core.volumes.stepped_work import STEP_VOXELS, finished, slabs
from ..core.volumes.voxel_digest import label_boxes

BLOCK_VOXELS = 64
"""Along each edge of the blocks in which classes compete: what was won is remembered only where there is something."""
TIE = 1e-4
"""By so little, relatively, may a later class exceed an earlier one, and it is a tie. Maps of a structure and its duplicate are
equal but for the order in which sums were made, which is another where the map of one is wanted sooner."""
SLAB_VOXELS = 2**24
"""Components are looked for in parts of so many voxels, each of which takes four bytes then."""


class Competition:
    """Classes compete for voxels, one after the other: each goes to the class whose map exceeds its own iso value by most.

    Args:
        shape: of the volume, (K, J, I).
        dtype: of the labels.

    Attributes:
        labels: (K, J, I), 0 where no class reaches its iso value, else 1 + the index of the class; a tie (`TIE`) stays with the
            class that came first.
    """

    def __init__(self, shape: tuple[int, int, int], dtype: type[np.unsignedinteger[Any]]) -> None:
        self.labels = np.zeros(shape, dtype)
        self._entered = 0
        self._best: dict[tuple[int, int, int], np.ndarray] = {}

    def enter(self, similarity: np.ndarray | None, iso: float, box: Box | None) -> bool:
        """Let the next class compete.

        Args:
            similarity: its map in [0, 1], (K, J, I) of the box.
            iso: its iso value; one below `SMALLEST_ISO` counts as that.
            box: outside of which it does not reach that; None, and no map: it does nowhere.

        Returns:
            Whether it reaches its iso value anywhere, be it where an earlier class exceeds its own by more.
        """
        self._entered += 1
        reaches_anywhere = False
        if similarity is None or box is None:
            return reaches_anywhere
        for block in _blocks(self.labels.shape):
            part = common_part(block, box)
            if part is None:
                continue
            ratio = over_iso(similarity[within(part, box)], iso)
            reaches = ratio >= 1.0
            if not reaches.any():
                continue
            reaches_anywhere = True
            corner = block[0].start, block[1].start, block[2].start
            if corner not in self._best:
                self._best[corner] = np.ones(self.labels[block].shape, dtype=np.float32)
            labels, best = self.labels[part], self._best[corner][within(part, block)]
            wins = (ratio > best) | ((labels == 0) & reaches)
            labels[wins] = self._entered
            # What a later class has to exceed; in place, as blocks are large.
            ratio *= np.float32(1.0 + TIE)
            best[wins] = ratio[wins]
        return reaches_anywhere


def _blocks(shape: tuple[int, ...]) -> Iterator[Box]:
    """A volume in blocks."""
    extents = ([slice(n, min(n + BLOCK_VOXELS, size)) for n in range(0, size, BLOCK_VOXELS)] for size in shape)
    yield from itertools.product(*extents)


def over_iso(similarity: np.ndarray, iso: float) -> np.ndarray:
    """By which factor a map (any shape) exceeds its iso value: what classes compete by."""
    ratio: np.ndarray = similarity / np.float32(max(iso, SMALLEST_ISO))
    return ratio


def count_labels(labels: np.ndarray, count: int) -> list[int]:
    """How many voxels carry each of the labels 1 to `count` in a label map (K, J, I)."""
    # One slab and label at a time: NumPy's bincount would first make eight bytes of each voxel.
    counts = [0] * count
    for slab in slabs(whole_box(labels.shape)):
        part = labels[slab]
        if part.any():
            counts = [known + int(np.count_nonzero(part == label)) for label, known in enumerate(counts, start=1)]
    return counts


def keep_annotated_components(
    labels: np.ndarray,
    geometry: Geometry,
    points_of_label: Mapping[int, np.ndarray],
    between: Between = nothing_between,
) -> None:
    """Keep of some labels only the connected components (26-neighbourhood) that hold a point; in place.

    Where no point lies in any component, the label is left as it is: better a visible surplus than a vanished segment.

    Args:
        labels: (K, J, I) label map, changed in place.
        geometry: of the label map.
        points_of_label: the points of each label, (N, 3) RAS millimetres.
        between: called between short steps; may raise `Cancelled`, and the labels are of no use then.
    """
    boxes = finished(label_boxes(labels), between)
    for label, points_ras in points_of_label.items():
        if label in boxes:
            between()
            part = labels[boxes[label]]
            nearest = geometry.nearest_voxels(points_ras) - [extent.start for extent in boxes[label]]
            _keep_components(part, label, nearest[((nearest >= 0) & (nearest < part.shape)).all(axis=1)])


def _keep_components(labels: np.ndarray, label: int, seeds: np.ndarray) -> None:
    """Keep of one label in `labels` (K, J, I) the components that hold one of the voxels `seeds` (N, 3), if any does."""
    components = _SlabComponents(labels, label)
    # Slab by slab: the numbers of one are kept at a time, and take a quarter of a second to find again.
    of_seeds = np.array([components.at(seed) for seed in seeds[np.argsort(seeds[:, 0])]], dtype=int)
    kept = np.isin(components.groups, components.groups[of_seeds[of_seeds > 0]])
    if not kept.any():
        return
    kept[0] = True  # The number of all voxels that do not carry the label.
    for part, numbers in components.parts():
        part[~kept[numbers]] = 0


class _SlabComponents:
    """Connected components of a label, found slab by slab: numbered all at once they would take four bytes of each voxel.

    Args:
        labels: (K, J, I).
        label: which label.

    Attributes:
        groups: (numbers,) which numbers are of one component; number 0 is of none.
    """

    def __init__(self, labels: np.ndarray, label: int) -> None:
        self._labels, self._label = labels, label
        self._thickness = max(SLAB_VOXELS // (labels.shape[1] * labels.shape[2]), 1)
        self._first_numbers: list[int] = []
        self._last: tuple[int, np.ndarray] | None = None
        count, links = 0, [np.zeros((2, 0), dtype=int)]
        above: np.ndarray | None = None
        for slab in range(-(-len(labels) // self._thickness)):
            self._first_numbers.append(count)
            numbers = self._numbers(slab)
            count += int(numbers.max())
            if above is not None:
                links.append(_touching(above, self._shifted(slab, numbers[0])))
            above = self._shifted(slab, numbers[-1])
        pairs = np.concatenate(links, axis=1)
        linked = coo_array((np.ones(pairs.shape[1], dtype=bool), pairs), (count + 1, count + 1))
        self.groups: np.ndarray = connected_components(linked, directed=False)[1]

    def at(self, voxel: np.ndarray) -> int:
        """The number at a voxel (k, j, i)."""
        slab, k = divmod(int(voxel[0]), self._thickness)
        return int(self._shifted(slab, self._numbers(slab)[k, voxel[1], voxel[2]]))

    def parts(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Some slices of the labels after the other, and their numbers, (slices, J, I) both."""
        step = max(STEP_VOXELS // (self._labels.shape[1] * self._labels.shape[2]), 1)
        for slab in range(len(self._first_numbers)):
            labels, numbers = self._slab(slab), self._numbers(slab)
            for k in range(0, len(labels), step):
                yield labels[k : k + step], self._shifted(slab, numbers[k : k + step])

    def _slab(self, slab: int) -> np.ndarray:
        return self._labels[slab * self._thickness : (slab + 1) * self._thickness]

    def _numbers(self, slab: int) -> np.ndarray:
        """(slices, J, I): components within a slab, from 1 up. Kept until another slab is asked for."""
        if self._last is None or self._last[0] != slab:
            self._last = None
            self._last = slab, ndimage.label(self._slab(slab) == self._label, structure=np.ones((3, 3, 3)))[0]
        return self._last[1]

    def _shifted(self, slab: int, numbers: np.ndarray) -> np.ndarray:
        """Numbers within a slab as numbers among all."""
        return np.where(numbers > 0, numbers + self._first_numbers[slab], 0)


def _touching(above: np.ndarray, below: np.ndarray) -> np.ndarray:
    """Pairs of numbers that meet across two neighbouring planes (J, I) of components, (2, pairs)."""
    rows, columns = below.shape
    padded = np.pad(above, 1)
    pairs = [np.zeros((2, 0), dtype=int)]
    for j, i in np.ndindex(3, 3):
        both = np.stack([padded[j : j + rows, i : i + columns], below]).reshape(2, -1)
        pairs.append(np.unique(both[:, (both > 0).all(axis=0)], axis=1))
    return np.concatenate(pairs, axis=1)
