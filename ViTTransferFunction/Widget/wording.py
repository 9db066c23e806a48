"""Names and messages as widgets want them."""

from __future__ import annotations

import re

_LONG_WORD = re.compile(r"(?<!\S)(?!\S*://)\S{30,}")
"""Longer than what fits into a line of the panel beside some others. Addresses are copied, and Qt breaks them by itself."""
_AFTER_A_MARK = re.compile(r"(?<=[\\_.,-])(?=[^\\_.,-])")
"""Not after a slash, where Qt breaks words by itself."""
_ZERO_WIDTH_SPACE = "\u200b"
_BEGINS_WITH_ISOLATED = re.compile(r"^(?=[^\w\n]*\u2068)", re.MULTILINE)
"""Lines whose first letters are a name that `in_text` isolated."""
_LEFT_TO_RIGHT_MARK = "\u200e"


def in_menu(name: str) -> str:
    """A name that the user gave, for an entry of a menu: there, a single & marks the key of the entry."""
    return name.replace("&", "&&")


def breakable(text: str) -> str:
    """A text whose long words, such as names and paths of files, may be broken where they have a mark between letters.

    A label is at least as wide as its longest word, and Slicer makes its whole panel so wide. In labels whose text can be
    selected, Qt looks for a line's direction in isolated names, too (`QTextBlock::textDirection`): a mark before them tells it.
    """
    text = _BEGINS_WITH_ISOLATED.sub(_LEFT_TO_RIGHT_MARK, text)
    return _LONG_WORD.sub(lambda word: _AFTER_A_MARK.sub(_ZERO_WIDTH_SPACE, word[0]), text)


def without_breaks(text: str) -> str:
    """A text without what `breakable` breaks its words by."""
    return text.replace(_ZERO_WIDTH_SPACE, "")
