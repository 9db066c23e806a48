"""Which views are told to wait for an answer."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from ViTTransferFunction.Logic.scene.views.awaited_answer import AwaitedAnswer, Waiting


@pytest.fixture
def proxy() -> Any:
    """Asked for maps, and without an answer yet."""
    return SimpleNamespace(awaits_views=True, first_up_to_date=False)


@pytest.fixture
def told() -> list[Waiting]:
    return []


@pytest.fixture
def awaited(proxy: Any, told: list[Waiting]) -> AwaitedAnswer:
    return AwaitedAnswer(proxy, told.append)


def test_all_views_wait_for_the_answer_to_a_click_then_3d_views_for_theirs(
    awaited: AwaitedAnswer, proxy: Any, told: list[Waiting]
) -> None:
    awaited.show_before(lambda: False)
    proxy.first_up_to_date = True
    awaited.tell()
    proxy.awaits_views = False
    awaited.tell()
    assert told == ["3D", "all", "3D", "none"]


def test_slices_wait_neither_while_it_is_shown_nor_after_it_was_shown_what_is_known_already(
    awaited: AwaitedAnswer, told: list[Waiting]
) -> None:
    while_shown: list[Waiting] = []

    def show() -> bool:
        while_shown.append(told[-1])
        return True

    awaited.show_before(show)
    awaited.tell()
    assert while_shown == ["3D"]
    assert told[1:] == ["3D", "3D"]
