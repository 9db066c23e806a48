"""What files import, read from their source."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

SHIPPED_WITH_SLICER = {"numpy", "scipy", "SimpleITK", "vtk", "vtkmodules", "slicer"}


def imports_at_file_scope(path: Path) -> Iterator[str]:
    """Top-level packages that a file imports as it loads, without relative imports and what only type checkers see."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        for module in _modules(node, ()):
            yield module.partition(".")[0]


def imports_anywhere(path: Path, package: tuple[str, ...]) -> Iterator[str]:
    """Every module that a file imports, also inside functions and for type checkers, by its full name.

    Args:
        path: of the file.
        package: the names of the packages that the file lies in, outermost first.
    """
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        yield from _modules(node, package)


def _modules(node: ast.AST, package: tuple[str, ...]) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom) and node.level == 0:
        yield node.module or ""
    elif isinstance(node, ast.ImportFrom) and package:
        above = package[: len(package) - node.level + 1]
        inner = [node.module] if node.module else [alias.name for alias in node.names]
        yield from (".".join((*above, name)) for name in inner)
