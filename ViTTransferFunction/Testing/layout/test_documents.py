"""The documents lead where they say, and the one about the command line knows every option."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

import pytest

from ViTTransferFunction.CommandLine.vittf import build_parser
from ViTTransferFunction.Testing.support.real_volumes import REAL_VOLUMES

ROOT = Path(__file__).parents[3]
DOCUMENTS = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]
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


def test_the_document_of_the_command_line_names_every_option_and_no_other() -> None:
    text = (ROOT / "docs" / "COMMAND_LINE.md").read_text(encoding="utf-8")
    commands = re.sub(r"(?m)^    (python|dask) .*$", "", text)
    named = set(re.findall(r"(?<![\w-])--[a-z0-9][a-z0-9-]*", commands))
    assert named == options(build_parser()) - SHOWN_AS_LETTERS


def test_contributors_are_told_every_command_of_dev_py_and_no_other() -> None:
    (every,) = re.findall(r"every = \((.*)\)", (ROOT / "dev.py").read_text(encoding="utf-8"))
    table = re.findall(r"(?m)^\| `python dev\.py (\w+)", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"))
    assert set(table) == set(every.split(", "))


def test_contributors_are_told_every_real_volume_that_tests_ask_for() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert [name for name in REAL_VOLUMES if f"`{name}`" not in text] == []
