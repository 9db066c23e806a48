"""Whether a processor draws, for want of a graphics card."""

from __future__ import annotations

from typing import Any

_NAMES = ("llvmpipe", "softpipe", "swiftshader", "software rasterizer")


def draws_in_software(window: Any) -> bool:
    """Whether a processor draws what a vtkRenderWindow shows; False where it has not been drawn yet.

    Then, OpenGL would be asked without a context, as that of a view that is in no layout yet, and may say anything.
    """
    if window.GetNeverRendered():
        return False
    capabilities = window.ReportCapabilities().lower()
    return any(name in capabilities for name in _NAMES)
