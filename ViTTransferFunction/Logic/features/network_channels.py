"""What the network sees of a volume: its intensities as three colour channels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..core.volumes.intensity_window import (
    CT_LUNG,
    CT_SOFT_TISSUE,
    IntensityWindow,
    looks_like_hounsfield_units,
    percentile_window,
)
from ..core.volumes.volume import Volume


@dataclass(frozen=True)
class WeightedWindows:
    """Windows beside each other as one curve: intensities of any width in [0, 1], those that matter most with most of it.

    Attributes:
        parts: share and window of each; the shares sum to 1.
    """

    parts: tuple[tuple[float, IntensityWindow], ...]

    def apply(self, intensities: np.ndarray) -> np.ndarray:
        """Intensities of any shape to float32 in [0, 1]; +inf becomes 1, NaN and -inf become 0."""
        shown: np.ndarray = sum(window.apply(intensities) * np.float32(share) for share, window in self.parts)
        return shown


@dataclass(frozen=True)
class NetworkChannels:
    """How intensities become the network's colours.

    Attributes:
        colors: of red, green and blue, increasing functions from intensities to [0, 1].
        background: the window in which what surrounds the body is dark (`background_cells`).
    """

    colors: tuple[IntensityWindow | WeightedWindows, IntensityWindow | WeightedWindows, IntensityWindow | WeightedWindows]
    background: IntensityWindow

    @classmethod
    def grey(cls, window: IntensityWindow) -> NetworkChannels:
        """One window for all, as in the paper."""
        return cls((window, window, window), window)


CT_EVERYTHING = WeightedWindows(
    (
        (0.15, IntensityWindow(-1000.0, CT_SOFT_TISSUE.low)),
        (0.55, CT_SOFT_TISSUE),
        (0.3, IntensityWindow(CT_SOFT_TISSUE.high, 1000.0)),
    )
)
CT_ORGANS = IntensityWindow(-20.0, 140.0)
CT_CHANNELS = NetworkChannels((CT_EVERYTHING, CT_SOFT_TISSUE, CT_ORGANS), CT_LUNG)
"""Three greys, each of which shows less, and that in more contrast: lungs, bones and bright vessels are there, organs differ,
and colours are as pale as in the photographs that the network has learned from. Windows of lung, soft tissue and bone paint a
body in cyan and white."""


def network_channels(volume: Volume) -> NetworkChannels:
    """The network's colour channels: those of a CT, or the central 99 % of intensities, the same in each.

    Parts of a volume have the channels of the whole.
    """
    volume = volume.whole
    return CT_CHANNELS if looks_like_hounsfield_units(volume) else NetworkChannels.grey(percentile_window(volume))
