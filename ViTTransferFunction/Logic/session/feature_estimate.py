"""What features will cost, as it is told to the user."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FeatureEstimate:
    """What features will cost.

    Attributes:
        cached: whether they only have to be loaded.
        seconds: that computing them will take; None where that is not known.
        memory_bytes: that is in use while they are computed; of the features alone where that is not known.
        download_mb: of the model's weights, 0 where they are on this computer.
    """

    cached: bool
    seconds: float | None
    memory_bytes: int
    download_mb: int
