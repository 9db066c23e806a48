"""What `dev.py` does with the arguments of its commands."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from types import FunctionType

import pytest

DEV = Path(__file__).parents[3] / "dev.py"


def called(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> list[tuple[str, ...]]:
    """With what Python of the environment would be run; nothing is installed."""
    main = runpy.run_path(str(DEV))["main"]
    assert isinstance(main, FunctionType)
    runs: list[tuple[str, ...]] = []

    def run(*given: str) -> int:
        runs.append(given)
        return 0

    main.__globals__.update(set_up=lambda *_: None, run=run)
    monkeypatch.setattr(sys, "argv", ["dev.py", *arguments])
    assert main() == 0
    return runs


@pytest.mark.parametrize("command", [["screenshots"], ["gallery"], ["attack"], ["app"], ["test"], ["bench", "solver"]])
def test_help_that_is_asked_of_a_command_is_the_commands_own(monkeypatch: pytest.MonkeyPatch, command: list[str]) -> None:
    (run,) = called(monkeypatch, *command, "--help")
    assert run[-1] == "--help"


@pytest.mark.parametrize("command", ["demo", "rooms", "lock"])
def test_a_command_without_arguments_refuses_them(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    with pytest.raises(SystemExit):
        called(monkeypatch, command, "--quick")
    assert f"{command} takes no arguments" in capsys.readouterr().err
