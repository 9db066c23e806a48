"""Whether a processor draws, for want of a graphics card."""

from __future__ import annotations

from typing import Any

_NAMES = ("llvmpipe", "softpipe", "swiftshader", "software rasterizer")


def draws_in_software(window: Any) -> bool:
    """Whether a processor draws what a vtkRenderWindow shows, which has been drawn before."""
    capabilities = window.ReportCapabilities().lower()
    return any(name in capabilities for name in _NAMES)
