"""Names in messages."""

from __future__ import annotations

from ViTTransferFunction.Logic.scene.interface.message_texts import empty_text, left_behind_text


def test_of_many_structures_a_message_names_as_many_as_one_reads() -> None:
    names = ["a", "b", "c", "d", "e", "f"]
    assert "of 'a', 'b', 'c', 'd', 'e':" in empty_text(names[:5])
    assert "of 'a', 'b', 'c', 'd', 'e' …:" in empty_text(names)


def test_names_from_the_right_leave_the_direction_of_a_message_alone() -> None:
    text = left_behind_text("בטן CT", ["كبد (2)", "liver"], None)
    assert text.startswith("'\u2068בטן CT\u2069' was moved, and the points of '\u2068كبد (2)\u2069', 'liver' were not")
