"""Learns similarity from the clicks: kernel ridge regression of every class against the rest of the volume.

In Eq. 1 of the paper, the similarity of a cell is the mean of its cosines with the positive points. Such a map cannot take
negative points into account, and the range of cosines differs between organs. Here each class c is a function of the cell,

    S_c(x) = Σ_p α_pc k(x, p),    α = (K + Λ)⁻¹ Y,

over the annotated points and a few random cells p. The target Y_pc is 1 if p is a positive point of c, and 0 if it is a
positive point of other classes only, a negative point of c, or a random cell. Negative points of other classes do not count for
c. Random cells represent the background. Each has little weight (large Λ), since any of them may lie in a structure of
interest, and those that turn out to are dropped.

The kernel k is the similarity of two places (`place_kernel`). For an annotated point p it is multiplied by (1 − b) + b C_p(x),
where C_p is the connectedness of x to p by intensities; between two points, by √((1 − b)(1 − b′)) + √(b b′) C
(`connected_points`). The reach of later points of a class is limited if they look unlike the earlier ones, and that of negative
points if they look like the class (`point_reach`). Points at rims are moved (`point_places`). Structures within walls that
contain a positive point are raised (`closed_structures`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from ..core.classes.class_request import ClassRequest
from ..core.classes.iso_proposals import IsoProposals
from ..core.system.progress import Between, nothing_between, one_at_a_time
from ..core.system.side_thread import Finish, side_thread
from ..core.volumes.volume import Volume
from ..core.volumes.voxel_map import VoxelMap
from ..features.whitening import NormalisedFeatures
from .annotated_points import BACKGROUND_RIDGE, AnnotatedPoints, annotated_points, point_ridge
from .cell_intensities import CellIntensities
from .closed_structures import raise_within
from .connected_points import between_points, point_factors, shares
from .iso_chooser import IsoChooser
from .kernel_rows import KernelRows
from .place_kernel import POSITION_SIGMA, CellKernel, Places, place_kernel
from .point_reach import PointReach, points_before
from .ridge_systems import solve_each
from .similarity_map import SimilarityMap

BACKGROUND_CELLS = 100
BACKGROUND_ROUNDS = 3
BACKGROUND_LIMIT = 0.12
"""Random cells in which a class exceeds this are assumed to lie in it, and dropped, in at most `BACKGROUND_ROUNDS` rounds."""


class KernelRidge:
    """Kernel ridge regression of all classes together. A `SimilarityRule`.

    Args:
        features: unit feature vectors of the volume's cells.
        volume: the volume.
        intensities: intensities of the volume on the same cells; None: they are computed now.
    """

    def __init__(self, features: NormalisedFeatures, volume: Volume, intensities: CellIntensities | None = None) -> None:
        self._features = features
        self._intensities = intensities or CellIntensities(volume, features.geometry)
        self._cdf = self._intensities.cdf
        self._connected = self._intensities.connected
        self._iso_chooser = IsoChooser(self._intensities, volume.geometry)
        centres = self._intensities.centres_ras
        self._centre_ras = centres.mean(axis=0)
        self._sigma_mm = POSITION_SIGMA * volume.longest_edge_mm
        vectors = features.array.reshape(-1, features.array.shape[-1])
        cells = Places(vectors, self._centred(centres), self._intensities.cdf_of_cells)
        self._with_cells = CellKernel(cells, features.geometry, self._sigma_mm)
        self._reach = PointReach(self._with_cells, features.geometry.voxel_volume_mm3 ** (1 / 3) / self._sigma_mm)
        background = self._intensities.drawn[:BACKGROUND_CELLS]
        self._background, self._background_cells = cells.subset(background), background
        self._background_kernel = place_kernel(self._background, self._background).astype(np.float64)
        self._rows = KernelRows(len(background), len(centres))
        self._with_cells.write(self._background, self._rows.background)

    def seen(self, requests: Sequence[ClassRequest]) -> list[ClassRequest]:
        """See `SimilarityRule`: positive points are moved from rims into the structure (`PointPlaces.of_positives`)."""
        seen_at = [self._intensities.point_places.of_positives(request.positive) for request in requests]
        return [
            request if places is request.positive else replace(request, positive=places)
            for request, places in zip(requests, seen_at, strict=True)
        ]

    def maps(
        self, requests: Sequence[ClassRequest], between: Between = nothing_between, first: int | None = None
    ) -> Iterator[tuple[int, SimilarityMap]]:
        """See `SimilarityRule`."""
        between = one_at_a_time(between)
        annotated = annotated_points(requests, self._intensities.point_places.of_negatives)
        with side_thread() as begin:
            # Flood fills work on many small arrays, and run in parallel to kernels and sums, which are limited by memory
            # access.
            finish_joining = begin(partial(self._connected.update, annotated.points_ras, between))
            finish_components = begin(partial(self._intensities.components.update, requests, between))
            solution = self._solve(annotated, finish_joining, between)
            for turn, together in enumerate(_in_turns(len(requests), first)):
                if turn:
                    self._merge_rows(solution, together)
                scores, without_negatives = self._scores(solution, together)
                finish_components()
                for index, of_class, without in zip(together, scores, without_negatives, strict=True):
                    yield index, self._similarity_map(requests, index, of_class, without)

    def iso(self, coarse: SimilarityMap, requests: Sequence[ClassRequest], index: int) -> IsoProposals:
        """See `SimilarityRule`."""
        return self._iso_chooser.iso(coarse, requests, index)

    def refined_iso(
        self,
        similarity: VoxelMap,
        coarse: SimilarityMap,
        requests: Sequence[ClassRequest],
        index: int,
        between: Between = nothing_between,
    ) -> IsoProposals:
        """See `SimilarityRule`."""
        return self._iso_chooser.refined_iso(similarity, coarse, requests, index, between)

    def _solve(self, annotated: AnnotatedPoints, finish_joining: Finish, between: Between) -> _Solution:
        """Compute the kernels of new points, and solve for α.

        Args:
            annotated: all annotated points.
            finish_joining: waits until their connectedness is known.
            between: called between steps; may raise `Cancelled`.
        """
        points = self._looked_at(annotated)
        rows = self._written_rows(points, finish_joining, between)
        finish_joining()
        joined = between_points(self._connected.at(points.keys, self._intensities.cells_at(annotated.points_ras)))
        share = shares(annotated.points_ras, joined, annotated.classes, annotated.positive)
        weights, without_negatives = self._weights(points, joined, share, between)
        return _Solution(points, rows, share, weights, without_negatives)

    def _looked_at(self, annotated: AnnotatedPoints) -> _Points:
        """The features, intensities and positions at annotated points, and the earlier points that limit their reach."""
        places = self._places(self._features.at(annotated.points_ras), annotated.points_ras)
        keys = self._connected.keys(annotated.points_ras)
        before = points_before(annotated.points_ras, annotated.classes, annotated.positive)
        return _Points(annotated, places, keys, before, _row_keys(keys, before, annotated.positive))

    def _written_rows(self, points: _Points, finish_joining: Finish, between: Between) -> np.ndarray:
        """Indices of the points' kernel rows, (P, 2); rows of new points are computed."""
        self._reach.keep(points.row_keys)

        def write(index: int, row: np.ndarray) -> np.ndarray:
            between()
            point = points.places.subset(np.array([index]))
            self._with_cells.write(point, row[None])
            if index in points.before:
                others = points.before[index]
                of_polarity = points.annotated.positive[index]
                apply = self._reach.apply_to_positive if of_polarity else self._reach.apply_to_negative
                keys = [points.row_keys[each] for each in others]
                apply(points.row_keys[index], point, keys, points.places.subset(others), row)
            finish_joining()
            (factors,) = self._connected.at([points.keys[index]])
            return np.asarray(factors)

        return self._rows.indices(points.row_keys, write)

    def _weights(
        self, points: _Points, joined: np.ndarray, share: np.ndarray, between: Between
    ) -> tuple[np.ndarray, np.ndarray]:
        """Solve for α.

        Args:
            points: all annotated points.
            joined: C of each pair of points, (P, P).
            share: b of each point, (P,).
            between: called between steps; may raise `Cancelled`.

        Returns:
            α of points and background cells, (P + B, classes), 0 for those that do not count for a class; and the same without
            negative points, with the background cells that were not dropped.
        """
        annotated, places = points.annotated, points.places
        targets, reach = annotated.targets, self._reach.of(points.row_keys)
        joined_to_background = self._connected.at(points.keys, self._background_cells).T
        to_points = place_kernel(self._background, places).astype(np.float64) * ((1.0 - share) + share * joined_to_background)
        to_points *= reach.factors(places, self._background).T
        of_points = place_kernel(places, places).astype(np.float64) * point_factors(joined, share)
        of_points *= reach.factors_between(places)
        kernel = np.block([[of_points, to_points.T], [to_points, self._background_kernel]])
        background = np.zeros((len(to_points), targets.shape[1]))
        wanted = np.concatenate([targets, background])
        ridge = np.concatenate([point_ridge(annotated), np.full(len(background), BACKGROUND_RIDGE)])
        seen = ~np.isnan(wanted)
        weights = solve_each(kernel, ridge, wanted, seen, between)
        for _ in range(BACKGROUND_ROUNDS):
            scores = kernel[len(targets) :] @ weights
            # A cell inside any of the classes is not used as background of the other classes either.
            stays = seen[len(targets) :] & (scores <= BACKGROUND_LIMIT).all(axis=1, keepdims=True)
            if np.array_equal(stays, seen[len(targets) :]):
                break
            seen[len(targets) :] = stays
            weights = solve_each(kernel, ridge, wanted, seen, between)
        if annotated.positive.all():
            return weights, weights
        seen[: len(targets)][~annotated.positive] = False
        return weights, solve_each(kernel, ridge, wanted, seen, between)

    def _merge_rows(self, solution: _Solution, classes: Sequence[int]) -> None:
        """Merge the two rows of each point of these classes, so that sums read one of them.

        This pays where the kernels of the points do not change until their own class gets another point.
        """
        points = solution.points
        for point in np.flatnonzero(np.isin(points.annotated.classes, classes)):
            self._rows.add_second(points.row_keys[point], float(solution.ratio[point]))

    def _scores(self, solution: _Solution, classes: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        """S of some classes, by their indices.

        Returns:
            S in all cells, (classes, cells) float32 in [0, 1]; and the weights of rows for S without negative points,
            (classes, rows) float32.
        """
        unjoined, added = 1.0 - solution.share, self._rows.added(solution.points.row_keys)
        parts = np.stack([unjoined, unjoined * (solution.ratio - added)], axis=1)
        of_rows, without_negatives = (
            self._weights_of_rows(weights[:, classes], solution.rows, parts)
            for weights in (solution.weights, solution.without_negatives)
        )
        scores = self._rows.weighted(of_rows)
        np.clip(scores, 0.0, 1.0, out=scores)
        return scores, without_negatives

    def _weights_of_rows(self, weights: np.ndarray, rows: np.ndarray, parts: np.ndarray) -> np.ndarray:
        """Convert α of points and background cells to weights of kernel rows, (classes, rows).

        Args:
            weights: α, (P + B, classes).
            rows: indices of the two rows of each point, (P, 2).
            parts: factors of these rows in the point's kernel, (P, 2).
        """
        of_points, of_background = weights[: len(rows)], weights[len(rows) :]
        of_rows = np.zeros((weights.shape[1], self._rows.count), dtype=np.float32)
        of_rows[:, : len(of_background)] = of_background.T
        # Added, because equal points share rows.
        for row, part in zip(rows.T, parts.T, strict=True):
            np.add.at(of_rows.T, row, part[:, None] * of_points)
        return of_rows

    def _similarity_map(
        self, requests: Sequence[ClassRequest], index: int, scores: np.ndarray, without_negatives: np.ndarray
    ) -> SimilarityMap:
        """The map of a class, raised within structures that are closed (`closed_structures`).

        Args:
            requests: all classes.
            index: of the class.
            scores: S of the class, (cells,), changed in place.
            without_negatives: weights of rows for S without negative points, (rows,).
        """
        closed = self._intensities.components.closed(requests, index)
        if closed is not None:
            raise_within(closed, scores)
        prior = self._iso_chooser.prior(requests[index], partial(self._rows.weighted_at, without_negatives))
        return SimilarityMap(scores.reshape(self._features.geometry.shape), prior)

    def _places(self, features: np.ndarray, positions_ras: np.ndarray) -> Places:
        return Places(features, self._centred(positions_ras), self._cdf.around(positions_ras, self._features.geometry))

    def _centred(self, positions_ras: np.ndarray) -> np.ndarray:
        """Positions in units of σ_x relative to the volume's centre, so that float32 is exact enough far from the origin."""
        centred: np.ndarray = ((positions_ras - self._centre_ras) / self._sigma_mm).astype(np.float32)
        return centred


def _row_keys(keys: Sequence[bytes], before: Mapping[int, np.ndarray], positive: np.ndarray) -> list[bytes]:
    """A key for each point's kernel, which changes with the key of the point and those of the points that limit its reach."""
    return [
        b"".join(keys[each] for each in before[index]) + (b"then" if positive[index] else b"not") + key
        if index in before
        else key
        for index, key in enumerate(keys)
    ]


def _in_turns(classes: int, first: int | None) -> list[list[int]]:
    """Groups of classes whose maps are computed together; class `first` is a group of its own, which takes the least time."""
    return [[first], [index for index in range(classes) if index != first]] if first is not None else [list(range(classes))]


@dataclass(frozen=True, eq=False)
class _Points:
    """All annotated points, before their kernels are computed.

    Attributes:
        annotated: positions, classes and polarities.
        places: features, positions and intensities at the points.
        keys: keys of their connectedness (`ConnectedPoints.keys`).
        before: for some points, by index, the earlier points that limit their reach (`points_before`).
        row_keys: keys of their kernels.
    """

    annotated: AnnotatedPoints
    places: Places
    keys: list[bytes]
    before: dict[int, np.ndarray]
    row_keys: list[bytes]


@dataclass(frozen=True, eq=False)
class _Solution:
    """The regression's solution for P annotated points and B background cells.

    Attributes:
        points: the annotated points.
        rows: indices of the two kernel rows of each point, (P, 2).
        share: b of each point, (P,).
        weights: α, (P + B, classes).
        without_negatives: α without negative points, (P + B, classes).
    """

    points: _Points
    rows: np.ndarray
    share: np.ndarray
    weights: np.ndarray
    without_negatives: np.ndarray

    @cached_property
    def ratio(self) -> np.ndarray:
        """The factor of each point's second row relative to that of its first, b / (1 − b), (P,)."""
        ratio: np.ndarray = self.share / (1.0 - self.share)
        return ratio
