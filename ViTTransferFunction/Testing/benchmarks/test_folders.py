"""Who knows whom among the benchmarks."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from ViTTransferFunction.Testing.support.imports import imports_anywhere

ROOT = Path(__file__).parents[3]
BENCHMARKS = ROOT / "Benchmarks"
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


def test_benchmarks_import_nothing_that_is_installed_for_tests_alone() -> None:
    for_tests = {
        {"scikit-image": "skimage", "scikit-learn": "sklearn"}.get(name, name) for name in extra("test") - extra("bench")
    }
    assert "pytest" in for_tests
    imported, due = set[str](), list(FILES)
    while due:
        for module in set(imports_anywhere(due.pop(), ())) - imported:
            imported.add(module)
            path = ROOT.joinpath(*module.split(".")).with_suffix(".py")
            if path.exists():
                due.append(path)
    assert not for_tests & {module.partition(".")[0] for module in imported}


def extra(name: str) -> set[str]:
    """The packages that an extra of the project names, without its other extras."""
    listed = re.search(
        rf"^{name} = \[(.*?)\]$", (ROOT / "pyproject.toml").read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    assert listed
    return set(re.findall(r'"([\w-]+)"', listed[1]))


def imported_benchmarks(path: Path) -> Iterator[tuple[str, str]]:
    """Folder and file of what a file imports from the benchmarks."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("Benchmarks."):
            room, _, name = (node.module or "").removeprefix("Benchmarks.").partition(".")
            yield from ((room, name or alias.name) for alias in node.names)
