"""The text of the shader; what it draws is tested by its pixels, in `Testing/scene` and `Testing/command_line`."""

from __future__ import annotations

import re

import pytest

from ViTTransferFunction.Logic.rendering.composition import MOST_STRUCTURES
from ViTTransferFunction.Logic.rendering.shader import CONTEXT_COLORS, capacity, shader_pieces


@pytest.fixture
def program() -> str:
    """The pieces, in the order in which VTK puts them together, without comments."""
    return re.sub(r"//.*", "", "\n".join(shader_pieces(3).values()))


def test_there_is_room_for_all_structures_and_for_none_which_is_number_0() -> None:
    assert [capacity(structures) for structures in (0, 15, 16, 31)] == [16, 16, 32, 32]
    # OpenGL promises 4096 numbers. Lights, matrices and all else that VTK needs take some hundreds.
    assert 16 * capacity(MOST_STRUCTURES) + 4 * CONTEXT_COLORS < 4096 - 400


def test_all_that_is_named_is_defined_before_it_is_used_and_used(program: str) -> None:
    places: dict[str, list[int]] = {}
    for found in re.finditer(r"\bvittf_\w+", program):
        places.setdefault(found[0], []).append(found.start())
    defined = {
        found[1]: found.start(1) for found in re.finditer(r"^(?:uniform |const )?\w+ (vittf_\w+)", program, re.MULTILINE)
    }
    assert {name: at[0] for name, at in places.items()} == defined
    assert [name for name, at in places.items() if len(at) < 2] == []


def test_drivers_read_it_on_any_system() -> None:
    """Some refuse other letters, in comments as well."""
    assert all(piece.isascii() for piece in shader_pieces(3).values())
