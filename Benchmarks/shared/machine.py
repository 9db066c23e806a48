"""The machine that figures were measured on."""

from __future__ import annotations

import os
import platform
from typing import Any


def machine() -> dict[str, Any]:
    """Its processor, and how many cores that has."""
    return {"processor": platform.processor() or platform.machine(), "cores": os.cpu_count()}
