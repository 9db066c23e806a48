"""Names and messages as widgets want them."""

from __future__ import annotations

import re

_LONGEST_WORD = 30
"""Letters that fit into a line of the panel, and some more."""
_AFTER_A_MARK = re.compile(r"(?<=[\\/_.,-])(?=[^\\/_.,-])")
_ZERO_WIDTH_SPACE = "\u200b"


def in_menu(name: str) -> str:
    """A name that the user gave, for an entry of a menu: there, a single & marks the key of the entry."""
    return name.replace("&", "&&")


def breakable(text: str) -> str:
    """A text whose long words, such as names and paths of files, may be broken where they have a mark between letters.

    A label is at least as wide as its longest word, and Slicer makes its whole panel so wide.
    """
    return re.sub(rf"\S{{{_LONGEST_WORD},}}", lambda word: _AFTER_A_MARK.sub(_ZERO_WIDTH_SPACE, word[0]), text)
