"""How much memory is available, and a check before work that needs much of it.

If memory runs out, the operating system kills the program without a message, after minutes of work.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from .errors import InputError


def require_memory(needed_bytes: int, what: str, advice: str) -> None:
    """Check that work fits into the available memory, swap space included.

    Args:
        needed_bytes: memory that the work needs, in addition to what is in use.
        what: the work, as the beginning of a sentence: "Segmenting 'scan'".
        advice: what the user can do, as a sentence.

    Raises:
        InputError: less memory is available. Never raised if the system does not report how much there is.
    """
    available = available_memory_bytes()
    if available is not None and needed_bytes > available:
        raise InputError(
            f"{what} takes at least {needed_bytes / 1e9:.1f} GB of memory more than is in use, and {available / 1e9:.1f} GB "
            f"are free. {advice}"
        )


def available_memory_bytes(root: Path = Path("/"), with_swap: bool = True) -> int | None:
    """The available memory in bytes; None if the system does not report it. On macOS, the total memory.

    Args:
        root: root of the file system with Linux's `/proc` and `/sys`.
        with_swap: whether swap space counts as well, on Windows and Linux.
    """
    if sys.platform == "win32":
        return _on_windows(with_swap)
    meminfo = root / "proc/meminfo"
    if not meminfo.is_file():
        # macOS has no simple query for available memory; the total is an upper bound.
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") if "SC_PHYS_PAGES" in os.sysconf_names else None
    fields = dict(line.split(":") for line in _text(meminfo).splitlines() if ":" in line)
    names = ("MemAvailable", "SwapFree") if with_swap else ("MemAvailable",)
    of_system = sum(1024 * int(fields[name].split()[0]) for name in names if name in fields)
    return min([of_system, *_of_control_groups(root)])


def _of_control_groups(root: Path) -> list[int]:
    """Memory left by the limits of control groups (containers, cluster jobs): of this process's group and all its parents."""
    membership = root / "proc/self/cgroup"
    if not membership.is_file():
        return []
    left = []
    for line in _text(membership).splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers not in ("", "memory"):
            continue
        top = root / "sys/fs/cgroup" / controllers
        names = ("memory.max", "memory.current") if not controllers else ("memory.limit_in_bytes", "memory.usage_in_bytes")
        folder = top / path.lstrip("/")
        for group in (folder, *folder.parents):
            if group == top.parent:
                break
            limit, used = (_number(group / name) for name in names)
            if limit is not None and used is not None:
                # Memory used by the file cache is reclaimed when needed.
                left.append(max(limit - used + _reclaimable(group / "memory.stat"), 0))
    return left


def _number(path: Path) -> int | None:
    """The number in a file; None if it contains none (such as "max") or cannot be read."""
    try:
        return int(_text(path))
    except (OSError, ValueError):
        return None


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace")


def _reclaimable(path: Path) -> int:
    try:
        fields = dict(line.split() for line in _text(path).splitlines())
        return int(fields.get("active_file", 0)) + int(fields.get("inactive_file", 0))
    except (OSError, ValueError):
        return 0


def _on_windows(with_swap: bool) -> int | None:
    import ctypes

    class MemoryStatus(ctypes.Structure):
        """MEMORYSTATUSEX."""

        _fields_ = (
            ("length", ctypes.c_ulong),
            ("load", ctypes.c_ulong),
            *((name, ctypes.c_ulonglong) for name in ("physical", "free_physical", "commit", "free_commit")),
            *((name, ctypes.c_ulonglong) for name in ("virtual", "free_virtual", "free_extended_virtual")),
        )

    status = MemoryStatus(length=ctypes.sizeof(MemoryStatus))
    told = ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status))  # type: ignore[attr-defined,unused-ignore]
    return int(status.free_commit if with_swap else status.free_physical) if told else None
