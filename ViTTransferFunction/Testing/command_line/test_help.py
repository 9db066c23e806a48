"""What `--help` tells somebody who has installed `vittf`, and nothing else to read."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from ViTTransferFunction.CommandLine import package_versions
from ViTTransferFunction.CommandLine.cohort.cases import read_cases
from ViTTransferFunction.CommandLine.vittf import build_parser, main
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.files.annotation_files import read_annotations

GEOMETRY = Geometry((2, 2, 2), np.eye(4))


def parsers(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """A parser, and those of its commands."""
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for each in action.choices.values():
                yield from parsers(each)


def examples_in(command: str) -> list[str]:
    """What stands apart at the end of a command's help, by example, without its indentation."""
    (parser,) = (each for each in parsers(build_parser()) if each.prog == f"vittf {command}")
    paragraphs = (parser.epilog or "").split("\n\n")
    return [re.sub("^  ", "", paragraph, flags=re.MULTILINE) for paragraph in paragraphs if paragraph.startswith("  ")]


def test_help_of_segment_shows_a_file_of_points_that_can_be_read(tmp_path: Path) -> None:
    (example,) = examples_in("segment")
    path = tmp_path / "a.json"
    path.write_text(example, encoding="utf-8")
    (annotated,) = read_annotations(path, GEOMETRY)
    assert len(annotated.request.positive) == len(annotated.request.negative) == 1


def test_help_of_cohort_shows_a_table_that_can_be_read(tmp_path: Path) -> None:
    (example,) = examples_in("cohort")
    path = tmp_path / "cases.csv"
    path.write_text(example, encoding="utf-8")
    cases = read_cases(path)
    assert [case.volume.parent for case in cases] == [tmp_path / "scans"] * 2


@pytest.mark.parametrize("parser", list(parsers(build_parser())), ids=lambda parser: parser.prog)
def test_help_says_what_a_command_does_and_what_is_chosen_where_nothing_is(
    parser: argparse.ArgumentParser,
) -> None:
    assert "README" not in parser.format_help()
    assert parser.description
    for action in parser._actions:
        if action.option_strings and action.default not in (None, False, [], argparse.SUPPRESS):
            assert "default" in (action.help or ""), action.option_strings
        assert action.help or isinstance(action, argparse._SubParsersAction), action.option_strings or action.dest


def test_version_is_told_without_a_command(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match=r"^0$"):
        main(["--version"])
    assert re.match(rf"vittf {re.escape(metadata.version('vit-transfer-function'))}, Python 3\.", capsys.readouterr().out)


def test_version_is_told_where_the_program_was_only_unpacked(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(package_versions, "THIS_PROGRAM", "a-package-that-nobody-has")
    with pytest.raises(SystemExit, match=r"^0$"):
        main(["--version"])
    assert capsys.readouterr().out.startswith("vittf (not installed as a package), Python 3.")
