"""What PySide lets pass and PythonQt, in which the panel runs in Slicer, does not: looked for in the panel's files."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("trame_slicer")
pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)

from PySide6 import QtCore, QtGui, QtWidgets

from ViTTransferFunction.Testing.support.standin import ctk, node_combo_box

MODULE = Path(__file__).parents[2]
FILES = sorted((MODULE / "Widget").glob("*.py"))
OUR_OWN = {"session"}
"""What sections have of their own."""


def assigned(path: Path) -> Iterator[ast.Attribute]:
    """What a file sets on objects other than `self`."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        for target in node.targets if isinstance(node, ast.Assign) else ():
            for part in ast.walk(target):
                if isinstance(part, ast.Attribute) and isinstance(part.ctx, ast.Store) and ast.unparse(part.value) != "self":
                    yield part


def writable_properties() -> set[str]:
    """Of all classes of Qt, and of those that Slicer adds."""
    names = set()
    for module in (QtCore, QtGui, QtWidgets, ctk, node_combo_box):
        # PySide makes its classes when somebody asks for them: `vars` would miss most.
        for kind in (getattr(module, name) for name in dir(module)):
            meta: Any = getattr(kind, "staticMetaObject", None)
            properties = [meta.property(n) for n in range(meta.propertyCount())] if meta is not None else []
            names |= {each.name() for each in properties if each.isWritable()}
    return names


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_what_is_set_on_widgets_are_their_properties(path: Path) -> None:
    """PySide keeps whatever is set on a widget, such as a misspelt property; PythonQt raises AttributeError."""
    known = writable_properties() | OUR_OWN
    unknown = [f"{path.name}:{each.lineno}: {ast.unparse(each)}" for each in assigned(path) if each.attr not in known]
    assert not unknown
