"""The session under actions that hypothesis chooses; `session_machine` says what holds."""

from __future__ import annotations

import os
import sys
from typing import Any

import hypothesis
import pytest
from hypothesis.stateful import run_state_machine_as_test

from ViTTransferFunction.Testing.attack.session_machine import Desk, machine_at
from ViTTransferFunction.Testing.support.spheres import Spheres

EXAMPLES_VARIABLE = "VITTF_ATTACK_SESSIONS"
"""Environment variable by which `dev.py attack` asks for more sequences than the tests run, and for other ones."""
EXAMPLES, STEPS = 12, 30


@pytest.mark.slow
def test_whatever_is_done_points_undo_and_segments_hold_and_nothing_is_left(
    slicer_app: Any, spheres: Spheres, monkeypatch: pytest.MonkeyPatch
) -> None:
    # VTK prints exceptions of observers and goes on.
    raised: list[Any] = []
    monkeypatch.setattr(sys, "excepthook", lambda *exception: raised.append(exception))
    wanted = os.environ.get(EXAMPLES_VARIABLE)
    settings = hypothesis.settings(
        max_examples=int(wanted or EXAMPLES), stateful_step_count=STEPS, derandomize=wanted is None, database=None
    )
    desk = Desk(slicer_app, spheres)
    try:
        run_state_machine_as_test(machine_at(desk), settings=settings)
    finally:
        desk.session.close()
    assert raised == []
