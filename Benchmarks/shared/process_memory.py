"""Memory that this process holds, as Linux counts it; there is no such count on other systems."""

from __future__ import annotations

import sys
from pathlib import Path

_SELF = Path("/proc/self")


def require_linux() -> None:
    """End the program where memory cannot be counted, before anything is measured."""
    if sys.platform != "linux":
        sys.exit("This benchmark counts memory, as only Linux does: run it there.")


def resident_bytes() -> int:
    """Held now."""
    return _status("VmRSS")


def peak_resident_bytes() -> int:
    """The most that was held since the process began, or since `forget_peak`."""
    return _status("VmHWM")


def forget_peak() -> None:
    """Set the peak back to what is held now."""
    (_SELF / "clear_refs").write_text("5", encoding="ascii")


def _status(name: str) -> int:
    lines = (_SELF / "status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(f"{name}:"))
