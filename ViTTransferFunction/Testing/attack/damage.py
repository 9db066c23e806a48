"""What happens to files: bits flip, ends are lost, something is appended."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any


def flip_bits(content: bytes, chance: random.Random, within: int | None = None) -> bytes:
    """One to eight bits are another value, among the first `within` bytes."""
    damaged = bytearray(content)
    for _ in range(chance.choice((1, 1, 2, 8))):
        damaged[chance.randrange(min(within or len(damaged), len(damaged)))] ^= 1 << chance.randrange(8)
    return bytes(damaged)


def truncate(content: bytes, chance: random.Random) -> bytes:
    """The end is missing, of any length."""
    lost = chance.choice((1, 2, 100, chance.randint(1, len(content)), len(content)))
    return content[: max(0, len(content) - lost)]


def replace_a_part(content: bytes, chance: random.Random) -> bytes:
    """Some bytes in a row are zero, random, or the highest."""
    start = chance.randrange(len(content))
    length = min(chance.choice((1, 4, 64, 512)), len(content) - start)
    part = chance.choice((bytes(length), b"\xff" * length, chance.randbytes(length)))
    return content[:start] + part + content[start + length :]


DAMAGES: tuple[Callable[[bytes, random.Random], bytes], ...] = (flip_bits, truncate, replace_a_part)


def damage_file(path: Path, chance: random.Random) -> str:
    """Damage a file in one of these ways; returns how."""
    how = chance.choice(DAMAGES)
    path.write_bytes(how(path.read_bytes(), chance))
    return how.__name__


ODD_VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2**31, 2**63, -(2**64), 10**400, 0.5, -0.0, 1e-320, 1e308, float("nan"), float("inf"),
    float("-inf"), "", "x", "0.5", "\ud800", "\x00", "a" * 5000, "liver\n\r\t\x1b[31m", "../../x", "%s%n", [], {}, [[]], [None],
    [[1, 2]], [[1, 2, 3], [4]], [[1, 2, "3"]], [[True, False, True]], [[1e400, 0, 0]], {"a": 1}, [[[0, 0, 0]]],
)  # fmt: skip
"""Values in the place of others in JSON files."""


def change_json(content: Any, chance: random.Random) -> Any:
    """The same with one to three of its values replaced, removed, repeated, or moved one level down."""
    for _ in range(chance.choice((1, 1, 2, 3))):
        content = _changed(content, chance, depth=chance.randint(0, 5))
    return content


def _changed(content: Any, chance: random.Random, depth: int) -> Any:
    if depth and isinstance(content, dict) and content:
        return _changed_entry(content, chance, depth)
    if depth and isinstance(content, list) and content:
        at = chance.randrange(len(content))
        how = chance.randrange(8)
        if how == 0:
            return content[:at] + content[at + 1 :]
        if how == 1:
            return content + [content[at]] * chance.choice((1, 3, 300))
        return [*content[:at], _changed(content[at], chance, depth - 1), *content[at + 1 :]]
    how = chance.randrange(6)
    if how == 0:
        return [content]
    if how == 1:
        return {"markups": content}
    if how == 2 and isinstance(content, float):
        return content * chance.choice((-1, 0.5, 1000, 1e300))
    return chance.choice(ODD_VALUES)


def _changed_entry(content: dict[str, Any], chance: random.Random, depth: int) -> dict[str, Any]:
    name = chance.choice(list(content))
    how = chance.randrange(8)
    if how == 0:
        return {key: value for key, value in content.items() if key != name}
    if how == 1:
        return {**content, chance.choice(("iso", "size", "Color", "", "opacity", name * 2)): chance.choice(ODD_VALUES)}
    return {**content, name: _changed(content[name], chance, depth - 1)}
