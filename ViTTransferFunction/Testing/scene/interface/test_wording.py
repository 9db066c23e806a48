"""Numbers in words."""

from __future__ import annotations

import pytest

from ViTTransferFunction.Logic.scene.interface.wording import volume_text


@pytest.mark.parametrize(
    ("volume_ml", "text"),
    [
        (None, "–"),
        (0.0, "0.0"),
        (0.0002, "<0.001"),
        (0.0142, "0.014"),  # A nodule of 3 mm.
        (0.0996, "0.10"),
        (0.524, "0.52"),
        (0.998, "1.0"),
        (12.34, "12.3"),
        (99.96, "100"),
        (1512.3, "1512"),
    ],
)
def test_small_structures_have_a_volume_too(volume_ml: float | None, text: str) -> None:
    assert volume_text(volume_ml) == text
