"""Text from the right, letter after letter from the left: its order, and the forms of letters that join."""

from __future__ import annotations

import unicodedata

import pytest

from ViTTransferFunction.CommandLine.right_to_left import can_be_set, set_from_the_left


@pytest.mark.parametrize(
    ("read", "seen"),
    [
        ("liver 2 (left)", "liver 2 (left)"),
        ("אבג", "גבא"),
        ("אבג 12", "12 גבא"),
        ("12 אבג", "גבא 12"),
        ("אבג (CT)", "(CT) גבא"),
        ("liver (אבג)", "liver (גבא)"),
        ("(אבג)", "(גבא)"),
        ("CT אב 1.5 T", "CT 1.5 בא T"),
        ("אב 1.5 T", "T 1.5 בא"),
        ("CT 2 אב 3 MR", "CT 2 3 בא MR"),
        ("אב 10%", "10% בא"),
        ("אב 1-2", "1-2 בא"),
        ("א-ב, [ג]", "[ג] ,ב-א"),
        ("אב <b> ג", "ג <b> בא"),
    ],
)
def test_letters_stand_where_unicodes_algorithm_puts_them(read: str, seen: str) -> None:
    assert set_from_the_left(read) == seen


def named(text: str) -> list[str]:
    """Forms of Arabic letters by name, from the right."""
    return [unicodedata.name(letter).removeprefix("ARABIC LETTER ").removesuffix(" FORM") for letter in reversed(text)]


@pytest.mark.parametrize(
    ("word", "forms"),
    [
        ("كبد", ["KAF INITIAL", "BEH MEDIAL", "DAL FINAL"]),
        ("دار", ["DAL ISOLATED", "ALEF ISOLATED", "REH ISOLATED"]),
        ("رئة", ["REH ISOLATED", "YEH WITH HAMZA ABOVE INITIAL", "TEH MARBUTA FINAL"]),
        ("بء", ["BEH ISOLATED", "HAMZA ISOLATED"]),
        ("سلام", ["SEEN INITIAL", "LIGATURE LAM WITH ALEF FINAL", "MEEM ISOLATED"]),
        ("لأ", ["LIGATURE LAM WITH ALEF WITH HAMZA ABOVE ISOLATED"]),
        ("پیچ", ["PEH INITIAL", "FARSI YEH MEDIAL", "TCHEH FINAL"]),
        ("ب\u200cب", ["BEH ISOLATED", "BEH ISOLATED"]),
        ("ب\u200d", ["BEH INITIAL"]),
    ],
)
def test_arabic_letters_join(word: str, forms: list[str]) -> None:
    assert [name.replace("ARABIC ", "") for name in named(set_from_the_left(word))] == forms


def test_figures_behind_arabic_letters_are_theirs() -> None:
    assert set_from_the_left("ب 10%") == "%10 \ufe8f"
    assert set_from_the_left("ب 12.5") == "12.5 \ufe8f"
    assert set_from_the_left("ب ٣٫٥") == "٣٫٥ \ufe8f"


@pytest.mark.parametrize(
    ("text", "can"),
    [
        ("liver", True),
        ("e\u0301", True),
        ("כבד 2", True),
        ("كبـد", True),
        ("ء", True),
        ("כָּ", False),
        ("بِ", False),
        ("ܟ", False),
        ("ߞ", False),
    ],
)
def test_what_is_not_known_is_not_set(text: str, can: bool) -> None:
    assert can_be_set(text) == can
