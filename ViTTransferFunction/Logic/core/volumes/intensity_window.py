"""Which intensities matter: windows that map them to [0, 1], chosen from the volume so that outliers have no say."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..system.errors import InputError
from .orientation import canonical_orientation
from .volume import Volume, finite_range

_SINGLE = np.finfo(np.float32)

NARROWEST = 1e-35
"""Width of a window. Some thousand parts of it are counted in single precision, which ends where they are 1e38 to a unit."""

LOWEST_CT = -4096.0
"""Hounsfield units: no CT measures less, and most that is written where nothing was measured is more."""

HIGHEST_CT = 30710.0
"""Hounsfield units: the end of the extended scale, in which metal is measured."""

FAR_AWAY = 2.0
"""How far from all that was measured a value lies that stands for what was not, of what the measured ones span."""

SAMPLE_SIZE = 2_000_000
"""Percentiles are taken over at most this many voxels, spread evenly: more would only take longer."""


@dataclass(frozen=True)
class IntensityWindow:
    """Intensities from `low` to `high` map linearly to [0, 1]; what lies outside is clamped.

    Raises:
        InputError: the bounds are not finite in single precision, in which intensities are computed with, or `high` is not
            above `low` by `NARROWEST`.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        bounds = np.array([self.low, self.high, self.width], dtype=np.float64)
        if not (np.abs(bounds) <= _SINGLE.max).all() or self.width < NARROWEST:
            raise InputError(
                f"The intensity window needs two numbers, the lower first; got {self.low:g} and {self.high:g}. "
                "Change one, or have them chosen automatically."
            )

    @property
    def width(self) -> float:
        """Intensity range covered."""
        return self.high - self.low

    def apply(self, intensities: np.ndarray) -> np.ndarray:
        """Intensities of any shape to float32 in [0, 1]; +inf becomes 1, NaN and -inf become 0."""
        # The largest number that there is stands in some scans for what was not measured.
        with np.errstate(over="ignore"):
            scaled = (np.asarray(intensities, dtype=np.float32) - np.float32(self.low)) / np.float32(self.width)
        shown: np.ndarray = np.clip(np.nan_to_num(scaled, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0)
        return shown


def telling_decimals(span: float) -> int:
    """Digits after the point, 6 at most, that tell intensities apart which lie a thousandth of a span apart."""
    return min(max(3 - math.floor(math.log10(max(span, 1e-9))), 0), 6)


CT_SOFT_TISSUE = IntensityWindow(-160.0, 240.0)
CT_LUNG = IntensityWindow(-1000.0, -200.0)
CT_BONE = IntensityWindow(0.0, 1000.0)


def check_shows_something(window: IntensityWindow, volume: Volume) -> None:
    """Raise InputError where all of a volume lies on one side of a window, so that it looks the same everywhere."""
    minimum, maximum = finite_range(volume.array)
    if window.high <= minimum or maximum <= window.low:
        raise InputError(
            f"The intensity window from {window.low:g} to {window.high:g} shows nothing of '{volume.name}', whose intensities "
            f"are {minimum:g} to {maximum:g}. Change it, or have it chosen automatically."
        )


def looks_like_hounsfield_units(volume: Volume) -> bool:
    """Whether the intensities are a CT's: a good share of air far below zero, which no other common modality has.

    A CT cropped to soft tissue fails the test and is windowed by its percentiles instead, which suits it as well.
    """
    sample = _measured_or_low(volume)
    shares = np.array([1.0, 99.9]) / 100.0
    low, high = quantiles(sample, shares)
    if low < LOWEST_CT and low == sample.min() < sample.max():
        # One value far below what is measured fills the corners of some scans.
        low, high = quantiles(sample[sample > low], shares)
    return bool(LOWEST_CT <= low <= -500.0 and -200.0 <= high <= 32767.0)


def display_window(volume: Volume) -> IntensityWindow:
    """The one window in which a person would look at the volume: soft tissue for CT, the central 99 % otherwise.

    Parts of a volume are looked at in the same window as the whole.
    """
    volume = volume.whole
    if looks_like_hounsfield_units(volume):
        return CT_SOFT_TISSUE
    return percentile_window(volume)


def percentile_window(volume: Volume, outside_percent: float = 0.5) -> IntensityWindow:
    """The window that leaves `outside_percent` of the finite voxels out at either end.

    Of a scan that is padded with one value far below or above all else, and beyond what any scanner measures, it is that of all
    else: in a window that reaches to the padding, everything would be one grey. Falls back to the full range where almost all
    voxels are equal, so that the window never collapses.
    """
    sample = _measured_or_low(volume)
    shares = np.array([outside_percent, 100.0 - outside_percent]) / 100.0
    low, high = quantiles(sample, shares)
    if low < LOWEST_CT and low == sample.min() < high:
        measured = sample[sample > low]
        lowest = measured.min()
        if lowest < high and lowest - low > FAR_AWAY * (high - lowest):
            low, high = quantiles(measured, shares)
    if low < high:
        return IntensityWindow(float(low), float(high))
    return full_range_window(volume)


def without_high_padding(volume: Volume) -> Volume:
    """The volume as it is to be drawn: with its lowest intensity where it is padded with one value far above all else.

    Otherwise the padding would look like bone around the scan. A volume without such padding is returned as it is.
    """
    sample = finite_sample(volume)
    padding = _high_padding(sample, volume)
    if padding is None:
        return volume
    lowest = sample.min().astype(volume.array.dtype)
    return replace(volume, array=np.where(volume.array == padding, lowest, volume.array))


def _measured_or_low(volume: Volume) -> np.ndarray:
    """Finite voxels, as `finite_sample` has them, without high padding."""
    sample = finite_sample(volume)
    padding = _high_padding(sample, volume)
    return sample if padding is None else sample[sample < padding]


def _high_padding(sample: np.ndarray, volume: Volume) -> float | None:
    """The high intensity that surrounds a scan where nothing was measured; None if there is none.

    It is the highest one, far above all else, and some of its voxels are at the border: saturated metal has neighbours of
    nearly its value, and what was burnt in lies within.
    """
    highest = float(sample.max())
    if highest <= HIGHEST_CT:
        return None
    measured = sample[sample < highest]
    if measured.size and measured.min() < LOWEST_CT:
        # That may be padding as well, and says nothing about how far measured intensities reach.
        measured = measured[measured > measured.min()]
    if not measured.size or highest - measured.max() <= FAR_AWAY * (float(measured.max()) - float(measured.min())):
        return None
    return highest if _is_at_border(highest, volume.array) else None


def _is_at_border(intensity: float, array: np.ndarray) -> bool:
    """Whether an outermost voxel of an array (K, J, I) has this intensity."""
    return any((np.take(array, (0, -1), axis) == intensity).any() for axis in range(array.ndim))


def full_range_window(volume: Volume) -> IntensityWindow:
    """From the smallest to the largest finite intensity: the paper's way, which one metal voxel can spoil."""
    return IntensityWindow(*finite_range(volume.array))


def finite_sample(volume: Volume) -> np.ndarray:
    """Finite voxels, (N,): where there are many, every n-th along each axis, the same ones however a scan is stored.

    Whole numbers of up to 16 bits are int32, which `quantiles` counts; all else is float64.
    """
    array = volume.array
    spread = np.ascontiguousarray(canonical_orientation(volume.geometry).spread(array, SAMPLE_SIZE))
    if np.issubdtype(spread.dtype, np.integer) and spread.dtype.itemsize <= 2:
        return spread.ravel().astype(np.int32)
    finite = spread[np.isfinite(spread)]
    # Where finite voxels are so few that the steps missed them all, look at every one.
    sample: np.ndarray = (finite if finite.size else array[np.isfinite(array)]).astype(np.float64)
    return sample


def quantiles(sample: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """As `numpy.quantile`, to the last bit, of what `finite_sample` returns; of whole numbers in a tenth of the time or less.

    Args:
        sample: (N,), N ≥ 1.
        shares: (Q,) in [0, 1].
    """
    if not np.issubdtype(sample.dtype, np.integer):
        of_fractions: np.ndarray = np.quantile(sample, shares)
        return of_fractions
    # There are few different numbers: counted, they are as good as sorted.
    lowest = sample.min()
    ranks_below = np.bincount(sample - lowest).cumsum()
    ranks = shares * (len(sample) - 1)
    below = np.floor(ranks)
    beyond = ranks - below
    neighbours = np.minimum(np.stack([below, below + 1.0]), len(sample) - 1)
    lower, upper = (lowest + np.searchsorted(ranks_below, neighbours, side="right")).astype(np.float64)
    from_lower, from_upper = lower + (upper - lower) * beyond, upper - (upper - lower) * (1.0 - beyond)
    # From the nearer one, as NumPy does it.
    between: np.ndarray = np.where(beyond >= 0.5, from_upper, from_lower)
    return between
