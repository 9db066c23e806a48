"""Names as menus want them."""

from __future__ import annotations


def in_menu(name: str) -> str:
    """A name that the user gave, for an entry of a menu: there, a single & marks the key of the entry."""
    return name.replace("&", "&&")
