"""The documents lead where they say, and the one about the command line knows every option."""

from __future__ import annotations

import argparse
import ast
import re
from pathlib import Path

import pytest

from ViTTransferFunction.CommandLine.vittf import build_parser
from ViTTransferFunction.Testing.support.real_volumes import REAL_VOLUMES

ROOT = Path(__file__).parents[3]
DOCUMENTS = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]
CODE = (".", "ViTTransferFunction", "ViTTransferFunction/Logic")
"""Where paths in documents begin."""
SHOWN_AS_LETTERS = {"--output"}
"""The document has its short form."""


def anchors(document: Path) -> set[str]:
    """What a link to each heading is called."""
    titles = [line.lower() for line in document.read_text(encoding="utf-8").splitlines() if line.startswith("#")]
    return {re.sub(r"[^\w -]", "", title).strip().replace(" ", "-") for title in titles}


def options(parser: argparse.ArgumentParser) -> set[str]:
    """Long options of a command and of its own commands."""
    found: set[str] = set()
    for action in parser._actions:
        found.update(name for name in action.option_strings if name.startswith("--"))
        if isinstance(action, argparse._SubParsersAction):
            found.update(*map(options, action.choices.values()))
    return found


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_link_to_a_file_or_heading_leads_somewhere(document: Path) -> None:
    for link in re.findall(r"(?<!!)\[[^\]]+\]\(([^)]+)\)", document.read_text(encoding="utf-8")):
        path, _, anchor = link.partition("#")
        if path.startswith("http"):
            continue
        target = document.parent / path if path else document
        assert target.is_file(), link
        assert not anchor or anchor in anchors(target), link


def names_in(source: Path) -> set[str]:
    """What a file defines: functions, classes and constants, and of classes `Class.name`."""
    found: set[str] = set()
    for node in ast.parse(source.read_text(encoding="utf-8")).body:
        found |= defined_by(node)
        if isinstance(node, ast.ClassDef):
            found |= {f"{node.name}.{name}" for inner in node.body for name in defined_by(inner)}
    return found


def defined_by(node: ast.stmt) -> set[str]:
    if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
        return {node.name}
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    return {name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_name_in_a_file_that_a_document_refers_to_is_there(document: Path) -> None:
    for path, name in re.findall(r"`([\w/]+\.py):([\w.]+)`", document.read_text(encoding="utf-8")):
        (source,) = [found for part in CODE if (found := ROOT / part / path).is_file()]
        assert name in names_in(source), f"{path}:{name}"


def test_the_document_of_the_command_line_names_every_option_and_no_other() -> None:
    text = (ROOT / "docs" / "COMMAND_LINE.md").read_text(encoding="utf-8")
    commands = re.sub(r"(?m)^    (python|dask|Slicer) .*$", "", text)
    named = set(re.findall(r"(?<![\w-])--[a-z0-9][a-z0-9-]*", commands))
    assert named == options(build_parser()) - SHOWN_AS_LETTERS


def test_contributors_are_told_every_command_of_dev_py_and_no_other() -> None:
    (every,) = re.findall(r"every = \((.*)\)", (ROOT / "dev.py").read_text(encoding="utf-8"))
    table = re.findall(r"(?m)^\| `python dev\.py (\w+)", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"))
    assert set(table) == set(every.split(", "))


def test_contributors_are_told_every_real_volume_that_tests_ask_for() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert [name for name in REAL_VOLUMES if f"`{name}`" not in text] == []
