"""What the README shows and says is there, and is what was drawn."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.files.annotation_files import read_annotations
from ViTTransferFunction.Testing.support.readme_pictures.exhibits import ANNOTATIONS

ROOT = Path(__file__).parents[3]
README = (ROOT / "README.md").read_text(encoding="utf-8")
MOST_BYTES = 5_000_000

POSITION = re.compile(r"([RL]) (\d+), ([AP]) (\d+), ([SI]) (\d+)")
"""As Slicer's Data Probe shows it."""


def for_users() -> str:
    """The README down to where developers take over."""
    return README.partition("## For developers")[0]


def printed_points(file_name: str) -> dict[tuple[str, bool], list[tuple[float, ...]]]:
    """The points of a tutorial's table, (R, A, S) millimetres, by structure and whether they lie inside."""
    table = README.partition(f"<!-- positions: {file_name} -->")[2].strip().partition("\n\n")[0]
    points: dict[tuple[str, bool], list[tuple[float, ...]]] = {}
    for line in table.splitlines()[2:]:
        structure, tool, position = (cell.strip() for cell in line.strip("|").split("|"))
        match = POSITION.fullmatch(position)
        assert match, position
        signs = [1 if letter in "RAS" else -1 for letter in match.groups()[::2]]
        ras = tuple(sign * float(number) for sign, number in zip(signs, match.groups()[1::2], strict=True))
        points.setdefault((structure, {"Inside": True, "Outside": False}[tool]), []).append(ras)
    return points


def points_in_file(file_name: str) -> dict[tuple[str, bool], list[tuple[float, ...]]]:
    classes = read_annotations(ANNOTATIONS / file_name, Geometry((1, 1, 1), np.eye(4)))
    pairs = {
        (given.name, inside): [tuple(point) for point in points.tolist()]
        for given in classes
        for inside, points in ((True, given.request.positive), (False, given.request.negative))
    }
    return {key: points for key, points in pairs.items() if points}


@pytest.mark.parametrize("file_name", ["torso_ct.json", "brain_mr.json"])
def test_the_positions_of_a_tutorial_are_those_that_its_pictures_were_drawn_with(file_name: str) -> None:
    points = points_in_file(file_name)
    assert points
    assert printed_points(file_name) == points


def test_every_picture_is_there_and_every_one_that_is_there_is_shown() -> None:
    shown = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", README)
    drawn = {f"Screenshots/{path.name}" for path in (ROOT / "Screenshots").iterdir() if path.suffix != ".json"}
    assert set(shown) == drawn
    assert len(shown) == len(drawn), "a picture is shown twice"


def test_the_three_clicks_move_and_begin_again() -> None:
    image = pytest.importorskip("PIL.Image")
    with image.open(ROOT / "Screenshots" / "three_clicks.webp") as animation:
        assert animation.n_frames > 20
        assert animation.info["loop"] == 0


def test_the_pictures_are_quickly_loaded() -> None:
    assert sum(path.stat().st_size for path in (ROOT / "Screenshots").iterdir()) < MOST_BYTES


def test_the_agreement_under_each_picture_is_the_one_that_was_measured_when_it_was_drawn() -> None:
    measured = json.loads((ROOT / "Screenshots" / "dice.json").read_text(encoding="utf-8"))
    assert measured.keys() == {"opening", "clicks", "closer", "outline", "diameter", "ct", "mr"}
    unwrapped = " ".join(README.split())
    for agreement in measured.values():
        assert ", ".join(f"{name} {value:.2f}" for name, value in agreement.items()) in unwrapped


def test_users_are_told_nothing_of_how_the_module_is_tested() -> None:
    for word in ("stand-in", "slicer-core", "benchmark", "pytest"):
        assert word not in for_users().lower(), word


def test_the_two_commands_that_everybody_needs_are_there() -> None:
    for command in ("python dev.py demo", "python dev.py test"):
        assert f"\n    {command}\n" in README
