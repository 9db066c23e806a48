"""From similarity maps to labels: which class each voxel belongs to, and which connected components are kept."""

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
"""Edge of the blocks in which classes compete; the best ratio is stored only for blocks that some class reaches."""
TIE = 1e-4
"""A later class wins only if it exceeds an earlier one by more than this share. The maps of a structure and its duplicate are
equal except for rounding, which differs if one of the maps is computed before the others."""
SLAB_VOXELS = 2**24
"""Voxels in which components are found at once; each takes four bytes meanwhile."""


class Competition:
    """Assigns each voxel to the class whose map exceeds its own iso value by the largest factor; classes enter one by one.

    Args:
        shape: shape of the volume, (K, J, I).
        dtype: dtype of the labels.

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
            similarity: the class's map in [0, 1], (K, J, I) of the box.
            iso: its iso value; values below `SMALLEST_ISO` count as that.
            box: the map is below its iso value outside this box; None, without a map: it is everywhere.

        Returns:
            Whether the map reaches its iso value anywhere, even where an earlier class exceeds its own by more.
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
            # The ratio that a later class has to exceed; computed in place, as blocks are large.
            ratio *= np.float32(1.0 + TIE)
            best[wins] = ratio[wins]
        return reaches_anywhere


def _blocks(shape: tuple[int, ...]) -> Iterator[Box]:
    """The blocks of a volume of `shape`."""
    extents = ([slice(n, min(n + BLOCK_VOXELS, size)) for n in range(0, size, BLOCK_VOXELS)] for size in shape)
    yield from itertools.product(*extents)


def over_iso(similarity: np.ndarray, iso: float) -> np.ndarray:
    """The factor by which a map (of any shape) exceeds its iso value; classes compete by it."""
    ratio: np.ndarray = similarity / np.float32(max(iso, SMALLEST_ISO))
    return ratio


def count_labels(labels: np.ndarray, count: int) -> list[int]:
    """The number of voxels with each of the labels 1 to `count` in a label map (K, J, I)."""
    # One slab and label at a time, because NumPy's bincount would first convert each voxel to eight bytes.
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
    """Remove the connected components (26-neighbourhood) of labels that contain no point, in place.

    If no point lies in any component of a label, the label stays as it is: better a visible surplus than a vanished segment.

    Args:
        labels: (K, J, I) label map, changed in place.
        geometry: geometry of the label map.
        points_of_label: points of the labels to change, (N, 3) RAS millimetres each.
        between: called between short steps; may raise `Cancelled`, which leaves the labels incomplete.
    """
    boxes = finished(label_boxes(labels), between)
    for label, points_ras in points_of_label.items():
        if label in boxes:
            between()
            part = labels[boxes[label]]
            nearest = geometry.nearest_voxels(points_ras) - [extent.start for extent in boxes[label]]
            _keep_components(part, label, nearest[((nearest >= 0) & (nearest < part.shape)).all(axis=1)])


def _keep_components(labels: np.ndarray, label: int, seeds: np.ndarray) -> None:
    """Remove the components of one label that contain none of the voxels `seeds` (N, 3), unless this would remove all."""
    components = _SlabComponents(labels, label)
    of_seeds = components.at(seeds)
    kept = np.isin(components.groups, components.groups[of_seeds[of_seeds > 0]])
    if not kept.any():
        return
    kept[0] = True  # The number of all voxels that do not carry the label.
    for part, numbers in components.parts():
        part[~kept[numbers]] = 0


class _SlabComponents:
    """Connected components of a label, found slab by slab: found all at once, they would take four bytes a voxel.

    Args:
        labels: (K, J, I).
        label: the label.

    Attributes:
        groups: (numbers,) the component that each number of a slab's component belongs to; number 0 is the background.
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

    def at(self, voxels: np.ndarray) -> np.ndarray:
        """The numbers at voxels (N, 3), which are (k, j, i), as (N,) int."""
        slabs, k = np.divmod(voxels[:, 0], self._thickness)
        numbers = np.zeros(len(voxels), dtype=int)
        # Slab by slab: only one slab's numbers are kept, and they take a quarter of a second to compute.
        for slab in np.unique(slabs).tolist():
            here = slabs == slab
            numbers[here] = self._shifted(slab, self._numbers(slab)[k[here], voxels[here, 1], voxels[here, 2]])
        return numbers

    def parts(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yields the labels of some slices after the other, and their numbers, both (slices, J, I)."""
        step = max(STEP_VOXELS // (self._labels.shape[1] * self._labels.shape[2]), 1)
        for slab in range(len(self._first_numbers)):
            labels, numbers = self._slab(slab), self._numbers(slab)
            for k in range(0, len(labels), step):
                yield labels[k : k + step], self._shifted(slab, numbers[k : k + step])

    def _slab(self, slab: int) -> np.ndarray:
        return self._labels[slab * self._thickness : (slab + 1) * self._thickness]

    def _numbers(self, slab: int) -> np.ndarray:
        """Numbers of components within a slab, from 1 up, (slices, J, I). Kept until another slab is requested."""
        if self._last is None or self._last[0] != slab:
            self._last = None
            self._last = slab, ndimage.label(self._slab(slab) == self._label, structure=np.ones((3, 3, 3)))[0]
        return self._last[1]

    def _shifted(self, slab: int, numbers: np.ndarray) -> np.ndarray:
        """Converts numbers within a slab to numbers that are unique in the volume."""
        return np.where(numbers > 0, numbers + self._first_numbers[slab], 0)


def _touching(above: np.ndarray, below: np.ndarray) -> np.ndarray:
    """Pairs of numbers of components that touch each other in two neighbouring planes (J, I), (2, pairs)."""
    rows, columns = below.shape
    padded = np.pad(above, 1)
    pairs = [np.zeros((2, 0), dtype=int)]
    for j, i in np.ndindex(3, 3):
        both = np.stack([padded[j : j + rows, i : i + columns], below]).reshape(2, -1)
        pairs.append(np.unique(both[:, (both > 0).all(axis=0)], axis=1))
    return np.concatenate(pairs, axis=1)
