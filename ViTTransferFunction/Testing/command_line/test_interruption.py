"""`vittf` that is interrupted, or asked to end."""

from __future__ import annotations

import os
import signal
import sys
import time
from contextlib import suppress

import pytest

from ViTTransferFunction.CommandLine import cache_command
from ViTTransferFunction.CommandLine.interruption import Terminated, ending_on_request
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
    with pytest.raises(KeyboardInterrupt), ending_on_request():  # noqa: PT012
        try:
            raise KeyboardInterrupt
        finally:
            raise ValueError("the archive cannot be closed while it is being written")
    with pytest.raises(ValueError, match="no archive"), ending_on_request():
        raise ValueError("no archive")


SIGNALS = [(signal.SIGTERM, Terminated), (signal.SIGINT, KeyboardInterrupt)]


@pytest.mark.skipif(sys.platform == "win32", reason="there, nobody can ask a program to end")
@pytest.mark.parametrize(("number", "interruption"), SIGNALS)
def test_an_interruption_is_one_though_a_library_forgot_it(number: signal.Signals, interruption: type[BaseException]) -> None:
    with pytest.raises(interruption), ending_on_request():  # noqa: PT012
        with suppress(interruption):
            os.kill(os.getpid(), number)
        raise TypeError("arrays cannot be compared")


@pytest.mark.skipif(sys.platform == "win32", reason="there, nobody can ask a program to end")
@pytest.mark.parametrize(("number", "interruption"), SIGNALS)
def test_an_interruption_comes_again_after_one_that_came_while_an_object_was_deleted(
    number: signal.Signals, interruption: type[BaseException], capsys: pytest.CaptureFixture[str]
) -> None:
    class InterruptedWhileDeleted:
        def __del__(self) -> None:
            os.kill(os.getpid(), number)

    with pytest.raises(interruption), ending_on_request():  # noqa: PT012
        deleted = InterruptedWhileDeleted()
        del deleted
        time.sleep(60.0)
    assert not capsys.readouterr().err


def test_who_embeds_the_program_keeps_his_own_way_of_ending() -> None:
    signals = (signal.SIGTERM, signal.SIGINT)
    before = [signal.getsignal(number) for number in signals]
    with ending_on_request():
        assert signal.getsignal(signal.SIGTERM) != before[0]
    assert [signal.getsignal(number) for number in signals] == before
