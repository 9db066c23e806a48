"""What ITK complains of, in words for users."""

from __future__ import annotations

import re

_NO_PIXELS = re.compile(
    "Cannot read requested file|Failed to get the buffer|Failed to change to Implicit Transfer|An invalid logic behavior"
)
"""How sentences begin that GDCM has for whatever it cannot decode, and that say nothing to users."""

_NO_SPACING = re.compile(r"Refusing to change spacing from .* to \[([^]]*)\]|axis \d+ spacing \((\S*)\) invalid")
"""Messages of ITK and Teem about unusable spacings."""


def last_line(error: Exception) -> str:
    """SimpleITK's own sentence, without the C++ source lines above it, and a matrix of numbers below."""
    lines = [line.strip() for line in str(error).splitlines() if re.search("[A-Za-z]", line)]
    # ITK names the object that complains, and where that is in memory: 0x5633f3821b90, on Windows 00007F7CE1C2E600.
    line = re.sub(r"^ITK ERROR: \w+\([0-9A-Fa-fx]+\): *", "", lines[-1]) if lines else repr(error)
    if _NO_PIXELS.match(line):
        return (
            "it holds no pixels, or they are damaged, or compressed in a way that is not known. Copy it again, or export it "
            "without compression."
        )
    if spacing := _NO_SPACING.search(line):
        return f"its spacing is {spacing[1] or spacing[2]} mm; expected numbers above 0. Save it again from its source."
    return line
