"""`vittf` that is interrupted, or asked to end."""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress

import pytest

from ViTTransferFunction.CommandLine import cache_command
from ViTTransferFunction.CommandLine.interruption import Terminated, ending_on_request, interruption_behind
from ViTTransferFunction.CommandLine.vittf import main


@pytest.mark.skipif(sys.platform == "win32", reason="there, nobody can ask a program to end")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_what_is_under_way_is_tidied_up_and_one_line_says_so(
    number: signal.Signals, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tidied_up = []

    def run(_: object) -> int:
        try:
            os.kill(os.getpid(), number)
        finally:
            tidied_up.append(True)
        return 0

    monkeypatch.setattr(cache_command, "run", run)
    assert main(["cache", "info"]) == code
    assert tidied_up
    assert capsys.readouterr().err == "interrupted; nothing was left half-written\n"


def test_an_interruption_is_one_whatever_was_raised_while_it_was_handled() -> None:
    with pytest.raises(ValueError, match="closed") as raised:  # noqa: PT012
        try:
            raise KeyboardInterrupt
        finally:
            raise ValueError("the archive cannot be closed while it is being written")
    assert isinstance(interruption_behind(raised.value), KeyboardInterrupt)
    assert interruption_behind(ValueError()) is None


@pytest.mark.skipif(sys.platform == "win32", reason="there, nobody can ask a program to end")
def test_a_request_to_end_is_one_though_a_library_forgot_it() -> None:
    with pytest.raises(Terminated), ending_on_request():  # noqa: PT012
        with suppress(Terminated):
            os.kill(os.getpid(), signal.SIGTERM)
        raise TypeError("arrays cannot be compared")


def test_who_embeds_the_program_keeps_his_own_way_of_ending() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with ending_on_request():
        assert signal.getsignal(signal.SIGTERM) != before
    assert signal.getsignal(signal.SIGTERM) == before
