"""Features in use, and what is made of them, and of intensities, once: by whichever thread needs it first."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock

from ..core.volumes.geometry import Geometry
from ..core.volumes.volume import Volume
from ..features.whitening import NormalisedFeatures
from ..similarity.cell_intensities import CellIntensities
from ..similarity.similarity_rule import SimilarityRule


class LoadedFeatures:
    """Features, and the rule on them.

    Args:
        features: of a volume.
        make_rule: makes the rule, which takes a moment.

    Attributes:
        features: as they were given.
    """

    def __init__(self, features: NormalisedFeatures, make_rule: Callable[[], SimilarityRule]) -> None:
        self.features = features
        self._make_rule = make_rule
        self._rule: SimilarityRule | None = None
        self._making = Lock()

    @property
    def rule(self) -> SimilarityRule:
        """From annotations to maps and thresholds by these features."""
        with self._making:
            if self._rule is None:
                self._rule = self._make_rule()
            return self._rule


class SharedIntensities:
    """A volume's intensities, looked at once for the same cells, however often their features become finer.

    Not the session's own method: what a session has would then lead back to it, and volume and features stay in memory after
    it until Python looks for such circles, which it does for many small objects and not for a few large arrays.
    """

    def __init__(self, volume: Volume) -> None:
        self._volume = volume
        self._of_cells: CellIntensities | None = None
        self._looking = Lock()

    def on(self, cells: Geometry) -> CellIntensities:
        """The intensities as they are on these cells."""
        with self._looking:
            if self._of_cells is None or not self._of_cells.are_of(cells):
                self._of_cells = CellIntensities(self._volume, cells)
            return self._of_cells
