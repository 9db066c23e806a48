"""What the layout promises: the Logic loads on a bare Slicer, and beside other extensions."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

MODULE = Path(__file__).parents[2]
LOGIC = sorted((MODULE / "Logic").rglob("*.py"))
SHIPPED_WITH_SLICER = {"numpy", "scipy", "SimpleITK", "vtk", "vtkmodules", "slicer"}


@pytest.mark.parametrize("path", LOGIC, ids=lambda path: path.name)
def test_a_logic_file_imports_at_file_scope_only_what_slicer_has(path: Path) -> None:
    for name in imports_at_file_scope(ast.parse(path.read_text(encoding="utf-8"))):
        assert name in SHIPPED_WITH_SLICER or name in sys.stdlib_module_names, f"{path.name} imports {name}"


def imports_at_file_scope(tree: ast.Module) -> Iterator[str]:
    """Top-level package names, without relative imports and what only type checkers see."""
    for node in tree.body:
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield (node.module or "").partition(".")[0]


def test_the_logic_loads_where_pytorch_is_missing() -> None:
    modules = [".".join(path.relative_to(MODULE.parent).with_suffix("").parts) for path in LOGIC]
    program = f"import sys; sys.modules['torch'] = None\nimport importlib\nfor name in {modules}: importlib.import_module(name)"
    finished = subprocess.run([sys.executable, "-c", program], cwd=MODULE.parent, capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stderr


@pytest.mark.parametrize("folder", ["", "Logic", "Testing", "CommandLine"])
def test_no_folder_claims_its_name_for_itself(folder: str) -> None:
    """Another extension's folder `Logic` must stay importable beside ours."""
    assert not (MODULE / folder / "__init__.py").exists()
