"""Colours that classes get by themselves."""

from __future__ import annotations

import numpy as np

from ViTTransferFunction.Logic.core.classes.colors import DEFAULT_COLORS, MOST_FURTHER_COLORS, default_color


def test_colours_do_not_repeat_after_the_first_ones_and_are_far_from_each_other() -> None:
    count = len(DEFAULT_COLORS) + MOST_FURTHER_COLORS
    colors = np.array([default_color(index) for index in range(count)])
    assert [tuple(color) for color in colors[: len(DEFAULT_COLORS)]] == list(DEFAULT_COLORS)
    assert ((colors >= 0.0) & (colors <= 1.0)).all()
    assert colors.max(axis=1).min() > 0.5  # Seen on a dark image.
    apart = np.linalg.norm(colors[:, None] - colors, axis=-1) + np.eye(count)
    assert apart[:20, :20].min() > 0.15
    assert apart.min() > 0.07


def test_there_is_a_colour_for_any_number() -> None:
    assert default_color(10_000) == default_color(10_000 % (len(DEFAULT_COLORS) + MOST_FURTHER_COLORS))
