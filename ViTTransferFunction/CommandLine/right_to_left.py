"""Text that is written from the right, as one that sets letter after letter from the left is to be given it.

Arabic letters join: each has a form for where it stands in its word, which Unicode has as a letter of its own
(Arabic Presentation Forms A and B). The order is that of Unicode's bidirectional algorithm (UAX #9) for a line without
explicit directions, which names are.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from itertools import pairwise
from typing import Literal

FORMS_A_AND_B = (*range(0xFB50, 0xFE00), *range(0xFE70, 0xFEFD))
MIRRORED = dict(zip("()[]{}<>«»", ")(][}{><»«", strict=True))
LAM_ALEF = frozenset("\u0644" + alef for alef in "\u0622\u0623\u0625\u0627")
"""Two letters that become one where they join."""
JOINERS = "\u0640\u200d"
"""What has no forms, but has the letters beside it join."""

HEBREW = frozenset(map(chr, range(0x5D0, 0x5F3)))
_UNSEEN = "\u200c\u200d"
"""What keeps letters apart, or has them join."""
_FROM_THE_RIGHT = ("R", "AL")

_Direction = Literal["L", "R", "N", ""]
"""Of a letter: from the left, from the right, of a number, written from the left; "": that of what stands around it."""


def can_be_set(text: str) -> bool:
    """Whether `set_from_the_left` knows what to do with all letters: of those from the right, with Hebrew and Arabic ones.

    Signs above and below those, such as vowels, would have to be put in their places.
    """
    from_the_right = [letter for letter in text if unicodedata.bidirectional(letter) in _FROM_THE_RIGHT]
    known = all(letter in HEBREW or letter in _FORMS or letter in JOINERS for letter in from_the_right)
    return not from_the_right or (known and not any(unicodedata.category(letter) == "Mn" for letter in text))


def set_from_the_left(text: str) -> str:
    """The letters of a line in the order in which they stand from left to right, each in the form that it has there."""
    if not any(unicodedata.bidirectional(letter) in _FROM_THE_RIGHT for letter in text):
        return text
    letters = _joined(text)
    return "".join(_in_order(letters, _levels(letters)))


def _forms() -> dict[str, dict[str, str]]:
    """By a letter, or two that become one, its forms: "<isolated>", "<final>", "<initial>", "<medial>"."""
    forms: dict[str, dict[str, str]] = {}
    for code in FORMS_A_AND_B:
        kind, *of = unicodedata.decomposition(chr(code)).split() or [""]
        joined = "".join(chr(int(each, 16)) for each in of)
        if kind.startswith("<") and (len(joined) == 1 or joined in LAM_ALEF):
            forms.setdefault(joined, {}).setdefault(kind, chr(code))
    return forms


_FORMS = _forms()


def _joined(text: str) -> list[str]:
    """Letters in the forms that they have in their words, still in the order in which they are read."""
    units: list[str] = []
    for letter in text:
        if units and units[-1] + letter in LAM_ALEF:
            units[-1] += letter
        else:
            units.append(letter)
    joins = [_joins_next(one) and _joins_previous(other) for one, other in pairwise(units)]
    before, after = [False, *joins], [*joins, False]
    return [_form(unit, *sides) for unit, *sides in zip(units, before, after, strict=True) if unit not in _UNSEEN]


def _joins_next(unit: str) -> bool:
    return unit in JOINERS or "<initial>" in _FORMS.get(unit, {})


def _joins_previous(unit: str) -> bool:
    return unit in JOINERS or "<final>" in _FORMS.get(unit, {})


def _form(unit: str, after_other: bool, before_other: bool) -> str:
    kind = ("<medial>" if before_other else "<final>") if after_other else ("<initial>" if before_other else "<isolated>")
    return _FORMS.get(unit, {}).get(kind, unit)


def _levels(letters: Sequence[str]) -> list[int]:
    """How deep each letter lies in directions within directions: odd from the right, even from the left."""
    kinds = [unicodedata.bidirectional(letter) for letter in letters]
    base: _Direction = next(("L" if kind == "L" else "R" for kind in kinds if kind in ("L", "R", "AL")), "L")
    directions: list[_Direction] = []
    strong = base
    for kind in _numbers_as_they_follow(kinds):
        if kind in ("L", "R", "AL"):
            strong = "L" if kind == "L" else "R"
            directions.append(strong)
        elif kind == "EN":
            # A part of what it follows, where that is written from the left.
            directions.append("L" if strong == "L" else "N")
        else:
            directions.append("N" if kind == "AN" else "")
    resolved = [each or _direction_between(directions, index, base) for index, each in enumerate(directions)]
    of_direction = {"L": 0, "R": 1, "N": 2} if base == "L" else {"L": 2, "R": 1, "N": 2}
    return [of_direction[each] for each in resolved]


def _numbers_as_they_follow(kinds: Sequence[str]) -> list[str]:
    """Kinds of letters, where figures behind Arabic letters are Arabic, and what belongs to a number is of its kind."""
    kinds, strong = list(kinds), ""
    for index, kind in enumerate(kinds):
        strong = kind if kind in ("L", "R", "AL") else strong
        if kind == "EN" and strong == "AL":
            kinds[index] = "AN"
    for index in range(1, len(kinds) - 1):
        before, kind, after = kinds[index - 1 : index + 2]
        if before == after and (kind, before) in (("CS", "EN"), ("CS", "AN"), ("ES", "EN")):
            kinds[index] = before
    beside = [{"EN"} & {*kinds[max(0, index - 1) : index], *kinds[index + 1 : index + 2]} for index in range(len(kinds))]
    return ["EN" if kind == "ET" and near else kind for kind, near in zip(kinds, beside, strict=True)]


def _direction_between(directions: Sequence[_Direction], index: int, base: _Direction) -> _Direction:
    """That of both neighbours that have one, numbers counting as written from the right; where these differ, the line's."""
    before = next((each for each in reversed(directions[:index]) if each), base)
    after = next((each for each in directions[index + 1 :] if each), base)
    sides = {"L" if each == "L" else "R" for each in (before, after)}
    return "L" if sides == {"L"} else "R" if sides == {"R"} else base


def _in_order(letters: Sequence[str], levels: Sequence[int]) -> list[str]:
    ordered = [
        (MIRRORED.get(letter, letter) if level % 2 else letter, level) for letter, level in zip(letters, levels, strict=True)
    ]
    for level in (2, 1):
        start = 0
        while start < len(ordered):
            end = start
            while end < len(ordered) and ordered[end][1] >= level:
                end += 1
            ordered[start:end] = ordered[start:end][::-1]
            start = max(end, start + 1)
    return [letter for letter, _ in ordered]
