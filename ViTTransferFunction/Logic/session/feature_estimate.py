"""The estimated cost of features, as shown to the user."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class WeightsDownload:
    """What a user has to know to allow the download of weights.

    Attributes:
        model: name of the model.
        licence: licence of the weights.
        homepage: homepage of the publisher.
        url: address of the weights.
        target: path that the file will have.
        size_mb: size of the file in megabytes (10⁶ bytes).
        sha256: hexadecimal hash that the file must have; None if none is published, so that the hash of the first download is
            used.
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
    """The estimated cost of features.

    Attributes:
        cached: whether they are in the cache, so that they only have to be loaded.
        seconds: time to compute them; None if it is not known, or if they are in the cache.
        memory_bytes: memory while they are computed and clicks are answered; for features in the cache, their own size.
        download: download of the model's weights; None if they are on this computer, or if nobody publishes them as a file.
        model: name of the model.
    """

    cached: bool
    seconds: float | None
    memory_bytes: int
    download: WeightsDownload | None = None
    model: str = ""
