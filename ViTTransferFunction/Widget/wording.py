"""Names and messages as widgets want them."""

from __future__ import annotations

import re

_LONG_WORD = re.compile(r"(?<!\S)(?!\S*://)\S{30,}")
"""Longer than what fits into a line of the panel beside some others. Addresses are copied, and Qt breaks them by itself."""
_AFTER_A_MARK = re.compile(r"(?<=[\\_.,-])(?=[^\\_.,-])")
"""Not after a slash, where Qt breaks words by itself."""
_ZERO_WIDTH_SPACE = "\u200b"


def in_menu(name: str) -> str:
    """A name that the user gave, for an entry of a menu: there, a single & marks the key of the entry."""
    return name.replace("&", "&&")


def breakable(text: str) -> str:
    """A text whose long words, such as names and paths of files, may be broken where they have a mark between letters.

    A label is at least as wide as its longest word, and Slicer makes its whole panel so wide.
    """
    return _LONG_WORD.sub(lambda word: _AFTER_A_MARK.sub(_ZERO_WIDTH_SPACE, word[0]), text)


def without_breaks(text: str) -> str:
    """A `breakable` text as it was."""
    return text.replace(_ZERO_WIDTH_SPACE, "")
