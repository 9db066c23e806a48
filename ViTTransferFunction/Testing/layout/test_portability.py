"""What no shipped file does, since it goes well on Linux only. What modules lack on other systems, `dev.py lint` finds."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

MODULE = Path(__file__).parents[2]
SHIPPED = [path for path in sorted(MODULE.rglob("*.py")) if "Testing" not in path.relative_to(MODULE).parts]
OF_DEVELOPERS = MODULE.parent / "dev.py"
STARTS = {"Popen", "run", "call", "check_call", "check_output"}
OF_ONE_SYSTEM = {"preexec_fn", "pass_fds"}


def mistakes(source: str) -> list[str]:
    """What a file does that goes wrong elsewhere, and in which line."""
    return [f"{call.lineno}: {what}" for call in _calls(source) for what in _mistakes_of(call)]


def _calls(source: str) -> Iterator[ast.Call]:
    return (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call))


def _mistakes_of(call: ast.Call) -> Iterator[str]:
    keywords = {keyword.arg for keyword in call.keywords if keyword.arg is not None}
    if _opens_text(call) and "encoding" not in keywords:
        yield "text in the code page of the computer's language; give an encoding"
    if _starts_program(call) and "creationflags" not in keywords:
        yield "a console window over Slicer, on Windows; give CREATE_NO_WINDOW"
    if _starts_program(call) and keywords & {"text", "universal_newlines"} and "encoding" not in keywords:
        yield "text of a program in the code page of the computer's language; give an encoding"
    if keywords & OF_ONE_SYSTEM:
        yield f"{', '.join(sorted(keywords & OF_ONE_SYSTEM))}: not on Windows"


def _opens_text(call: ast.Call) -> bool:
    name = _name(call)
    if name in ("read_text", "write_text"):
        return True
    if name not in ("open", "fdopen"):
        return False
    of = call.func.value if isinstance(call.func, ast.Attribute) and name == "open" else None
    given = [*call.args[0 if of else 1 :], *(keyword.value for keyword in call.keywords if keyword.arg == "mode")]
    if not given:
        # Volumes, addresses and members of archives are opened as well.
        return of is None or (not call.args and ast.unparse(of).endswith("path"))
    mode = given[0].value if isinstance(given[0], ast.Constant) else None
    return isinstance(mode, str) and set(mode) <= set("rwxa+t")


def _starts_program(call: ast.Call) -> bool:
    of = call.func.value if isinstance(call.func, ast.Attribute) else None
    return isinstance(of, ast.Name) and of.id == "subprocess" and _name(call) in STARTS


def _name(call: ast.Call) -> str:
    return call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.relative_to(MODULE).as_posix())
def test_a_file_does_nothing_that_goes_well_on_linux_only(path: Path) -> None:
    assert mistakes(path.read_text(encoding="utf-8")) == []


def test_the_developers_commands_do_neither_but_for_their_windows() -> None:
    found = mistakes(OF_DEVELOPERS.read_text(encoding="utf-8"))
    assert [mistake for mistake in found if "console window" not in mistake] == []


@pytest.mark.parametrize(
    "line",
    [
        "open(path)", "open(path, 'w')", "path.open()", "path.open('a')", "path.read_text()", "path.write_text(text)",
        "os.fdopen(descriptor, 'w')", "subprocess.Popen(command)", "subprocess.run(command, creationflags=0, text=True)",
        "subprocess.run(command, creationflags=0, preexec_fn=os.setsid)",
    ],
)  # fmt: skip
def test_what_goes_wrong_elsewhere_is_found(line: str) -> None:
    assert len(mistakes(line)) == 1


@pytest.mark.parametrize(
    "line",
    [
        "open(path, 'rb')", "path.open('xb', buffering=0)", "path.open('w', encoding='utf-8')", "archive.open('a.npy', 'w')",
        "archive.open(info)", "volume.open()", "webbrowser.open(address)", "os.fdopen(descriptor, 'wb')",
        "path.read_text(encoding='utf-8')", "subprocess.Popen(command, creationflags=0)", "process.run(command)",
    ],
)  # fmt: skip
def test_what_goes_well_everywhere_is_not(line: str) -> None:
    assert mistakes(line) == []
