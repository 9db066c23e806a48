"""What the page's files say and look like, read without a browser: words and colours."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from ViTTransferFunction.Logic.features.settings import LARGEST_GRID
from ViTTransferFunction.WebApp.panel_form import panel_form

STATIC = Path(__file__).parents[2] / "WebApp" / "static"
PAGE = (STATIC / "page.html").read_text(encoding="utf-8")
STYLE = (STATIC / "page.css").read_text(encoding="utf-8")

READABLE, SEEN = 4.5, 3.0
"""Contrast that WCAG 2.1 asks for on level AA: of text, and of what shows where a control is."""


def test_all_words_that_the_page_takes_from_the_panel_are_there() -> None:
    form = panel_form()
    taken = re.findall(r"\bform\.(\w+)\.(\w+)", PAGE)
    for repeated in PAGE.split('v-for="name in [')[1:]:
        names = re.findall(r"'(\w+)'", repeated.partition("]")[0])
        of_each = re.findall(r"form\[name \+ '(\w+)'\]\.(\w+)", repeated)
        taken += [(name + kind, word) for name in names for kind, word in of_each]
    assert len(taken) > 60
    for widget, word in taken:
        assert form[widget][word], f"{widget}: {word}"


def test_words_and_ranges_are_those_of_the_panels_form() -> None:
    grid = panel_form()["gridSpinBox"]
    assert (grid["label"], grid["special"]) == ("Grid", "as in the preset")
    assert grid["range"] == {"max": LARGEST_GRID, "step": 8.0}
    assert grid["about"]["aria-label"] == "Grid"
    assert grid["about"]["title"].startswith("How finely the volume is looked at")
    assert panel_form()["renderingSoloCheckBox"]["text"] == "Selected structure alone"


def themes() -> dict[str, dict[str, str]]:
    """The colours of the page by their names, by theme."""
    blocks = re.findall(r"^\.vittf(\[data-theme=\"light\"\])? \{(.*?)\}", STYLE, re.DOTALL | re.MULTILINE)
    dark, light = (dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", block)) for _, block in blocks[:2])
    return {"dark": dark, "light": dark | light}


def contrast(color: str, other: str) -> float:
    """The contrast ratio of two colours (WCAG 2.1), 1 to 21."""
    darker, lighter = sorted(map(luminance, (color, other)))
    return (lighter + 0.05) / (darker + 0.05)


def luminance(color: str) -> float:
    """The relative luminance of a colour as CSS writes it (WCAG 2.1)."""
    parts = [int(color[start : start + 2], 16) / 255 for start in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return sum(weight * part for weight, part in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def test_contrast_is_computed_as_wcag_does() -> None:
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)


@pytest.mark.parametrize("theme", ["dark", "light"])
def test_text_can_be_read_and_controls_be_seen_on_all_grounds(theme: str) -> None:
    colors = themes()[theme]
    for ground in ("ground", "panel", "raised", "chosen"):
        for text in ("text", "dim", "warn"):
            assert contrast(colors[text], colors[ground]) >= READABLE, (text, ground)
        assert contrast(colors["focus"], colors[ground]) >= SEEN, ground
    assert contrast(colors["on-accent"], colors["accent"]) >= READABLE
    for part in ("accent", "track"):
        assert contrast(colors[part], colors["panel"]) >= SEEN, part
    # On the pictures, which are mostly black.
    assert contrast(themes()["dark"]["focus"], "#000000") >= SEEN
