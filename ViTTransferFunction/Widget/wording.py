"""Durations and sizes in words, as coarse as people talk about them, and names as menus want them."""

from __future__ import annotations

from slicer.i18n import tr as _


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
    """How far a structure is from the size that was chosen, such as "one step larger"; `fixed`: nothing is chosen."""
    if fixed:
        return _("set by hand")
    if steps == 0.0:
        return _("as chosen")
    if abs(steps) == 1.0:
        return _("one step larger") if steps > 0.0 else _("one step smaller")
    count = f"{abs(steps):g}"
    return _("{count} steps larger").format(count=count) if steps > 0.0 else _("{count} steps smaller").format(count=count)


def in_menu(name: str) -> str:
    """A name that the user gave, for an entry of a menu: there, a single & marks the key of the entry."""
    return name.replace("&", "&&")
