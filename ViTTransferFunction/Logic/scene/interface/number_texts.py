"""Numbers as users read them: times, sizes, volumes and thresholds."""

from __future__ import annotations

from ...core.classes.close_up import EdgesMm
from ...core.system.progress import WorkProgress
from ...core.volumes.measures import decimals_of, two_figures
from .translation import tr as _

_SMALL_SPECIMEN = 0.75
"""Scans below this `body_scale` (shorter than 48 mm) use mm³: organs in them have only thousandths of a millilitre."""


def duration(seconds: float) -> str:
    """Such as "40 s", "2 min" or "1 h 10 min"."""
    if seconds < 60:
        return _("{seconds} s").format(seconds=max(1, round(seconds / 5) * 5 if seconds > 20 else round(seconds)))
    minutes = round(seconds / 60)
    if minutes < 60:
        return _("{minutes} min").format(minutes=minutes)
    return _("{hours} h {minutes} min").format(hours=minutes // 60, minutes=minutes % 60)


def size(n_bytes: float) -> str:
    """Such as "88 MB" or "1.2 GB"."""
    if n_bytes < 1e9:
        return _("{megabytes} MB").format(megabytes=round(n_bytes / 1e6))
    return _("{gigabytes} GB").format(gigabytes=f"{n_bytes / 1e9:.1f}")


def size_in_steps(steps: float, fixed: bool) -> str:
    """A structure's size, counted in steps as in annotation files, in words; `fixed`: the user set the threshold instead."""
    if fixed:
        return _("set by hand")
    if steps == 0.0:
        return _("as chosen")
    if abs(steps) == 1.0:
        return _("one step larger") if steps > 0.0 else _("one step smaller")
    size = f"{abs(steps):g}"
    return _("larger (+{size})").format(size=size) if steps > 0.0 else _("smaller (−{size})").format(size=size)


def progress_text(progress: WorkProgress) -> str:
    """The running work, and how long it will still take."""
    if progress.seconds_left is None:
        return _("{what}…").format(what=progress.what)
    return _("{what}: about {time} left").format(what=progress.what, time=duration(progress.seconds_left))


def threshold_text(iso: float | None, chosen: float | None) -> str:
    """A class's threshold: `iso` if the user set one, else `chosen` in brackets; "–" if there is no map yet (None)."""
    if iso is not None:
        return f"{iso:.2f}"
    return "–" if chosen is None else f"({chosen:.2f})"


def volume_unit(body_scale: float) -> str:
    """The unit for volumes of structures: "ml", or "mm³" in scans of small specimens.

    Args:
        body_scale: factor for lengths that suit human bodies; less than 1 in smaller scans.
    """
    return "mm³" if body_scale < _SMALL_SPECIMEN else "ml"


def volume_text(volume_ml: float | None, unit: str) -> str:
    """A volume as a number, without its unit: with two significant figures if it is small, from 99.95 on without decimals.

    Args:
        volume_ml: millilitres; None: not known.
        unit: the unit of the number, one of `volume_unit`.
    """
    if volume_ml is None:
        return "–"
    volume, most_decimals = (1000.0 * volume_ml, 4) if unit == "mm³" else (volume_ml, 3)
    if 0.0 < volume < 0.5 * 10.0**-most_decimals:
        return f"<{10.0**-most_decimals:.{most_decimals}f}"
    decimals = 0 if volume >= 99.95 else decimals_of(volume, 2, least_decimals=1)
    return f"{volume:.{min(decimals, most_decimals)}f}"


def close_up_text(edges_mm: EdgesMm | None, failed: bool = False) -> str:
    """The close-up of a class, such as "In a box of 64 × 80 × 52 mm"; "" if there is none (None).

    `failed`: the close-up could not be made, and the class is looked at in the whole volume.
    """
    if edges_mm is None:
        return ""
    edges = " × ".join(two_figures(edge) for edge in edges_mm)
    if failed:
        return _('Its box of {edges} mm could not be looked at: shown as in the whole scan. "Look closer" tries again.').format(
            edges=edges
        )
    return _("In a box of {edges} mm").format(edges=edges)
