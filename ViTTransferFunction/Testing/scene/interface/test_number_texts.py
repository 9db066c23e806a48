"""Numbers as users read them."""

from __future__ import annotations

import pytest

from ViTTransferFunction.Logic.scene.interface.number_texts import (
    close_up_text,
    duration,
    size,
    size_in_steps,
    volume_text,
    volume_unit,
)


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
    assert volume_text(volume_ml, volume_unit(1.0)) == text


@pytest.mark.parametrize(
    ("volume_ml", "text"),
    [(None, "–"), (0.0, "0.0"), (2e-8, "<0.0001"), (2.5e-7, "0.0003"), (3.14e-5, "0.031"), (0.0002, "0.20"), (0.35, "350")],
)
def test_in_small_specimens_volumes_are_told_in_cubic_millimetres(volume_ml: float | None, text: str) -> None:
    assert (volume_unit(0.76), volume_unit(0.05)) == ("ml", "mm³")
    assert volume_text(volume_ml, volume_unit(0.05)) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.2, "1 s"),
        (7.4, "7 s"),
        (19.0, "19 s"),
        (42.0, "40 s"),
        (43.0, "45 s"),
        (60.0, "1 min"),
        (100.0, "2 min"),
        (3500.0, "58 min"),
        (3600.0, "1 h 0 min"),
        (9000.0, "2 h 30 min"),
    ],
)
def test_the_longer_something_takes_the_less_exactly_it_is_said(seconds: float, text: str) -> None:
    assert duration(seconds) == text


@pytest.mark.parametrize(("n_bytes", "text"), [(88.4e6, "88 MB"), (999e6, "999 MB"), (1e9, "1.0 GB"), (20.26e9, "20.3 GB")])
def test_files_and_memory_are_told_in_mb_or_gb(n_bytes: float, text: str) -> None:
    assert size(n_bytes) == text


@pytest.mark.parametrize(
    ("steps", "text"),
    [
        (0.0, "as chosen"),
        (1.0, "one step larger"),
        (-1.0, "one step smaller"),
        (1.25, "larger (+1.25)"),
        (-0.5, "smaller (−0.5)"),
    ],
)
def test_the_size_of_a_structure_is_told_in_steps_unless_it_was_set_by_hand(steps: float, text: str) -> None:
    assert size_in_steps(steps, fixed=False) == text
    assert size_in_steps(steps, fixed=True) == "set by hand"


@pytest.mark.parametrize(
    ("edges_mm", "text"), [((64.3, 80.0, 9.97), "64 × 80 × 10 mm"), ((6.43, 0.8, 0.052), "6.4 × 0.80 × 0.052 mm")]
)
def test_boxes_in_small_specimens_have_a_size_too(edges_mm: tuple[float, float, float], text: str) -> None:
    assert close_up_text(edges_mm) == f"In a box of {text}"
    assert close_up_text(edges_mm, failed=True).startswith(f"Its box of {text} could not be looked at")
    assert close_up_text(None) == ""
