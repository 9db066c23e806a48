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
OUR_OWN = {"session", "now", "saved", "kept", "offered"}
"""What sections have of their own, and what one of them knows of a scan."""


def assigned(path: Path) -> Iterator[ast.Attribute]:
    """What a file sets on objects other than `self`."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        for target in node.targets if isinstance(node, ast.Assign) else ():
            for part in ast.walk(target):
                if isinstance(part, ast.Attribute) and isinstance(part.ctx, ast.Store) and ast.unparse(part.value) != "self":
                    yield part


def calls(path: Path) -> list[ast.Call]:
    """All calls in a file."""
    return [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)]


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


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_no_widget_is_told_apart_by_a_class_of_qt(path: Path) -> None:
    """In PythonQt, a push button is not an instance of QWidget; it has `inherits("QWidget")`."""
    asked = [ast.unparse(call) for call in calls(path) if ast.unparse(call.func) == "isinstance"]
    assert [text for text in asked if "qt." in text or "ctk." in text] == []


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_classes_of_qt_are_made_without_keywords(path: Path) -> None:
    """PySide sets properties by them; PythonQt raises ValueError."""
    with_keywords = [ast.unparse(call) for call in calls(path) if call.keywords]
    assert [text for text in with_keywords if text.startswith(("qt.", "ctk."))] == []
