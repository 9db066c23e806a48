"""Where a class's structure may end: the iso value that was chosen, and those of a smaller and a larger structure.

A click is ambiguous: on a tumour it may mean the tumour, its organ, or both. So there are three proposals, of which the user
sees one and reaches the others, and everything between and beyond, by a *size*.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SMALLEST_SIZE, LARGEST_SIZE = -3.0, 3.0
SMALLEST_ISO, LARGEST_ISO = 0.01, 0.98
SMALLER, LARGER = 1.7, 0.3
"""Iso values of the smaller and the larger proposal over the chosen one."""
STEP_OF_FIXED_ISO = 2.0
"""Factor of one size step where the user fixed the iso value, so that nothing is proposed: about that between proposals."""


@dataclass(frozen=True)
class IsoProposals:
    """Three iso values of a map, each in (0, 1): the larger the structure, the lower its iso value.

    Attributes:
        smaller: of the smaller structure.
        chosen: of the one that is shown unless the user says otherwise.
        larger: of the larger structure.
    """

    smaller: float
    chosen: float
    larger: float

    def at(self, size: float) -> float:
        """The iso value of a size: −1 the smaller, 0 the chosen, 1 the larger proposal.

        Between and beyond them, the logarithm of the iso value is linear in the size, up to `SMALLEST_ISO` and `LARGEST_ISO`.

        Args:
            size: from `SMALLEST_SIZE` to `LARGEST_SIZE`.
        """
        step = np.log(self.larger / self.chosen) if size > 0.0 else np.log(self.chosen / self.smaller)
        return float(np.clip(self.chosen * np.exp(size * step), min(SMALLEST_ISO, self.chosen), max(LARGEST_ISO, self.chosen)))


def resized_iso(iso: float, steps: float) -> float:
    """A fixed iso value in [0, 1], so many size steps larger, or smaller where negative: the sizes of proposals around it."""
    resized = iso * STEP_OF_FIXED_ISO**-steps
    # At its limits it stays where it is: larger must never make the structure smaller.
    limit = max(LARGEST_ISO, iso) if steps < 0.0 else min(SMALLEST_ISO, iso)
    return float(min(resized, limit) if steps < 0.0 else max(resized, limit))
