"""Whether a processor draws: asked of windows that have been drawn, and of no others."""

from __future__ import annotations

import pytest

from ViTTransferFunction.Logic.scene.mrml.software_drawing import draws_in_software


class Window:
    """A vtkRenderWindow, as far as it is asked here."""

    def __init__(self, capabilities: str, drawn: bool = True) -> None:
        self._capabilities = capabilities
        self._drawn = drawn

    def GetNeverRendered(self) -> int:  # noqa: N802
        return int(not self._drawn)

    def ReportCapabilities(self) -> str:  # noqa: N802
        assert self._drawn, "OpenGL has no context"
        return self._capabilities


@pytest.mark.parametrize(
    ("renderer", "in_software"),
    [
        ("llvmpipe (LLVM 15.0.6, 256 bits)", True),
        ("SwiftShader Device (LLVM 16.0.0)", True),
        ("NVIDIA RTX A2000/PCIe/SSE2", False),
    ],
)
def test_the_renderers_name_tells(renderer: str, in_software: bool) -> None:
    assert draws_in_software(Window(f"OpenGL renderer string:  {renderer}\n")) is in_software


def test_a_window_that_was_never_drawn_is_not_asked() -> None:
    assert not draws_in_software(Window("OpenGL renderer string:  llvmpipe\n", drawn=False))
