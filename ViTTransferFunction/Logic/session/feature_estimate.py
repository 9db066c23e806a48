"""What features will cost, as shown to the user."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class WeightsDownload:
    """Weights that are not on this computer: what a user has to know to allow their download.

    Attributes:
        model: its name.
        licence: terms of the weights.
        homepage: who publishes them.
        url: where they come from.
        target: the file that they become.
        size_mb: megabytes (10⁶ bytes) of the file.
        sha256: hexadecimal hash that the file must have; None where nobody publishes it, and the first file's counts.
    """

    model: str
    licence: str
    homepage: str
    url: str
    target: str
    size_mb: int
    sha256: str | None


@dataclass(frozen=True)
class FeatureEstimate:
    """What features will cost.

    Attributes:
        cached: whether they only have to be loaded.
        seconds: that computing them will take; None where that is not known.
        memory_bytes: that is in use while they are computed, and clicked on meanwhile; of those in the cache, of these alone.
        download: of the model's weights; None where they are on this computer, or where nobody publishes them.
        model: the name of the model that they are of.
    """

    cached: bool
    seconds: float | None
    memory_bytes: int
    download: WeightsDownload | None = None
    model: str = ""
