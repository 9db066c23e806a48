"""Who knows whom among the benchmarks."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[3] / "Benchmarks"
FILES = sorted(BENCHMARKS.glob("*/*.py"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_no_benchmark_imports_the_run_of_another_and_shared_none(path: Path) -> None:
    for room, name in imported_benchmarks(path):
        assert name != "run" or room == path.parent.name, f"{path} imports the run of {room}"
        assert path.parent.name != "shared" or room == "shared", f"{path} is shared, and imports {room}"


@pytest.mark.parametrize("path", sorted(BENCHMARKS.glob("*/run.py")), ids=lambda path: path.parent.name)
def test_a_benchmark_says_how_it_is_run(path: Path) -> None:
    docstring = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
    assert f"python dev.py bench {path.parent.name}" in (docstring or "")


def imported_benchmarks(path: Path) -> Iterator[tuple[str, str]]:
    """Folder and file of what a file imports from the benchmarks."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("Benchmarks."):
            room, _, name = (node.module or "").removeprefix("Benchmarks.").partition(".")
            yield from ((room, name or alias.name) for alias in node.names)
