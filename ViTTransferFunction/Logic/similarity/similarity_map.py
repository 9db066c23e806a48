"""What a rule makes of a class's points on the feature cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class SimilarityMap:
    """S_L of a class.

    Attributes:
        array: (K', J', I') float32 in [0, 1].
        prior: what the points alone lead to expect of its iso value; None where a rule expects nothing.
    """

    array: np.ndarray
    prior: float | None = None
